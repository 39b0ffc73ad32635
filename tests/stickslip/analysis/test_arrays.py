"""States with arrays: every analysis gives what it gives of the same system written with scalars."""

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip.analysis import (
    Maximum,
    Minimum,
    Recording,
    Segments,
    energy_ledger,
    lyapunov_spectrum,
    orbit_diagram,
    time_history,
    two_trajectory_exponent,
    volume_growth,
)
from stickslip.sweep import Carried, Compute
from tests.stickslip.hybrid._systems import stick_slip_motion

from ._arrays import Free, Scalars, machine

STEP = ss.Integrator("rk4", ss.FixedStep(0.02))
ARRAYS, SCALARS = machine(0.2, True), machine(0.2, False)
Y_ARRAYS = {"x": np.array([0.0, 0.1]), "v": np.array([0.2, -0.1])}
Y_SCALARS = Scalars(v_0=0.2, v_1=-0.1, x_0=0.0, x_1=0.1)
TIMES = np.linspace(0.0, 20.0, 41)
same = np.testing.assert_array_equal


def near(one, other):
    """To rounding: sums of an array may be added up in another order."""
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13)


def test_the_block_is_the_one_in_closed_form():
    found = time_history(ARRAYS, Y_ARRAYS, TIMES, ["x", "v", "x[0]", "slope of x[1]"], integrator=STEP)
    exact = [stick_slip_motion(t, 0.2)[0] for t in TIMES]
    np.testing.assert_allclose(found["x[0]"], exact, atol=1e-7)
    same(found.x[:, 0], found["x[0]"])
    same(found.v[:, 1], found["slope_of_x[1]"])
    assert found.x.dims == ("time", "x_0")
    assert found["slope_of_x[1]"].units == "m/s"


@pytest.mark.slow
def test_time_history():
    """The whole component with an axis of its own, one number of it, slopes and sections."""
    wanted = ["x", "slope of v", "x[1]", "slope of v[0]"]
    sections = {"top": Maximum("x[0]"), "low": Minimum("x[1]")}
    found = time_history(ARRAYS, Y_ARRAYS, TIMES, wanted, sections=sections, integrator=STEP)
    names = [f"{part}{i}" for part in ("x_", "slope of v_") for i in range(2)]
    sections = {"top": Maximum("x_0"), "low": Minimum("x_1")}
    truth = time_history(SCALARS, Y_SCALARS, TIMES, names, sections=sections, integrator=STEP)
    assert set(found.mode.values) == {0, 1}
    same(found.mode, truth.mode)
    for front, rows in (("", "time"), ("at_top_", "top_point"), ("at_low_", "low_point")):
        assert found[f"{front}x"].dims == (rows, "x_0")
        assert found[f"{front}slope_of_v"].dims == (rows, "v_0")
        for i in range(2):
            near(found[f"{front}x"][:, i], truth[f"{front}x_{i}"])
            near(found[f"{front}slope_of_v"][:, i], truth[f"{front}slope_of_v_{i}"])
        near(found[f"{front}x[1]"], truth[f"{front}x_1"])
        near(found[f"{front}slope_of_v[0]"], truth[f"{front}slope_of_v_0"])
    near(found.at_low_t, truth.at_low_t)
    assert found.sizes["low_point"] >= 2
    assert (found["x[1]"].units, found["slope_of_v[0]"].units) == ("m", "m/s/s")


def test_dataset_and_table_have_the_same_names():
    run = ss.simulate(
        ARRAYS, 0.0, 20.0, Y_ARRAYS, integrator=STEP, saveat=ss.SaveAt(ts=TIMES, events=True)
    )
    data = run.to_dataset(ARRAYS)
    assert data.x.dims == ("time", "x_0")
    assert data.slope_of_v.dims == ("time", "v_0")
    table = run.events.to_dataframe(ARRAYS)
    assert [c for c in table.columns if c.endswith("_before")][1:] == [
        "v[0]_before", "v[1]_before", "x[0]_before", "x[1]_before",
    ]  # fmt: skip
    same(table["x[1]_after"], run.events.y_after["x"][: len(table), 1])
    assert table.attrs["units"]["x[1]_after"] == "m"


@pytest.mark.slow
def test_energy_ledger():
    """A power that is an array is that of each part; the account adds them up."""
    found = energy_ledger(ARRAYS, Y_ARRAYS, TIMES, integrator=STEP)
    truth = energy_ledger(SCALARS, Y_SCALARS, TIMES, integrator=STEP)
    assert found.power_mass.dims == found.work_mass.dims == ("time", "mass_0")
    for i in range(2):
        near(found.work_mass[:, i], truth[f"work_{i}"])
    near(found.imbalance, truth.imbalance)
    assert float(abs(found.imbalance).max()) < 1e-6


PORTABLE = Compute("portable")
RUN = {"integrator": STEP, "compute": PORTABLE}


def recording(section, observables, duration=30.0, **more):
    return Recording(0.0, duration, section, observables, max_points=6, **more)


SPEEDS = np.array([0.2, 0.25, 0.3])


@pytest.mark.slow
def test_orbit_diagram():
    grid = {"belt_speed": SPEEDS}
    found = orbit_diagram(
        lambda belt_speed: machine(belt_speed, True), grid, Y_ARRAYS,
        recording({"top": Maximum("x[0]"), "low": Minimum("x[1]")}, ["x", "slope of v[1]"], check=2),
        **RUN,
    )  # fmt: skip
    truth = orbit_diagram(
        lambda belt_speed: machine(belt_speed, False), grid, Y_SCALARS,
        recording(
            {"top": Maximum("x_0"), "low": Minimum("x_1")}, ["x_0", "x_1", "slope of v_1"], check=2
        ),
        **RUN,
    )  # fmt: skip
    assert found.x.dims == ("belt_speed", "section", "point", "x_0")
    assert found.error_x.dims == ("checked", "section", "x_0")
    assert found.end_x.dims == ("belt_speed", "x_0")
    assert found.x.units == found.end_x.units == "m"
    assert int(found["count"].min()) >= 3
    for i in range(2):
        near(found.x[..., i], truth[f"x_{i}"])
        near(found.end_x[:, i], truth[f"end_x_{i}"])
        np.testing.assert_allclose(found.error_x[..., i], truth[f"error_x_{i}"], rtol=1e-4)
    near(found["slope_of_v[1]"], truth.slope_of_v_1)
    for name in ("count", "status", "period", "period_status", "slow_transient", "flags"):
        same(found[name], truth[name])


STROBE = ss.Section(lambda system, t, y, dy, mode, args: jnp.sin(2 * np.pi * t), "rising")
FREE = {
    "system": Free(1.0),
    "grid": {"stiffness": np.array([1.0, 1.44])},
    "record": recording(STROBE, ["x"], 6.3, check=0),
    **RUN,
}
TWO = {"x": np.array([0.5, -0.25]), "v": np.array([0.0, 1.0])}


def over(dims, state=TWO):
    return {name: xr.DataArray(values, dims=dims) for name, values in state.items()}


def exact(x, v, omega, t):
    """Displacement of an oscillator; NumPy broadcasts."""
    return x * np.cos(omega * t) + v / omega * np.sin(omega * t)


OMEGA, N = np.array([1.0, 1.2]), np.arange(1.0, 7.0)


@pytest.mark.more
def test_a_number_for_each_lane():
    """An array of two over a grid of two may be either, and its dimensions say which."""
    with pytest.raises(ValueError, match=r"y0\['v'\] = .*, of shape \(2,\): it must be told apart"):
        orbit_diagram(**FREE, y0=TWO)
    own = orbit_diagram(**FREE, y0=over(["stiffness"]))
    assert own.x.dims == ("stiffness", "point")
    truth = exact(TWO["x"][:, None], TWO["v"][:, None], OMEGA[:, None], N)
    np.testing.assert_allclose(own.x[:, :6], truth, atol=1e-6)


@pytest.mark.slow
def test_an_array_for_all_lanes():
    shared = orbit_diagram(**FREE, y0=over(["mass"]))
    assert shared.x.dims == ("stiffness", "point", "x_0")
    truth = exact(TWO["x"], TWO["v"], OMEGA[:, None, None], N[:, None])
    np.testing.assert_allclose(shared.x[:, :6], truth, atol=1e-6)
    # A section of one number says what is meant.
    said = orbit_diagram(**{**FREE, "record": recording(Maximum("x[0]"), ["x"], 6.3, check=0)}, y0=TWO)
    assert said.x.dims == ("stiffness", "point", "x_0")


@pytest.mark.more
def test_an_array_for_each_lane_beside_one_for_all():
    mixed = {"x": np.stack([TWO["x"], 2 * TWO["x"]]), "v": TWO["v"]}
    found = orbit_diagram(**FREE, y0=mixed)
    start = np.array([1.0, 2.0])[:, None, None] * TWO["x"]
    truth = exact(start, TWO["v"], OMEGA[:, None, None], N[:, None])
    np.testing.assert_allclose(found.x[:, :6], truth, atol=1e-6)


@pytest.mark.slow
def test_carried_lanes_hand_on_arrays():
    grid = {"belt_speed": SPEEDS}
    options = {**RUN, "carried": Carried("downwards")}
    found = orbit_diagram(
        lambda belt_speed: machine(belt_speed, True), grid, Y_ARRAYS,
        recording(Maximum("x[0]"), "x", check=2), **options,
    )  # fmt: skip
    truth = orbit_diagram(
        lambda belt_speed: machine(belt_speed, False), grid, Y_SCALARS,
        recording(Maximum("x_0"), ["x_0", "x_1"], check=2), **options,
    )  # fmt: skip
    for i in range(2):
        near(found.x[..., i], truth[f"x_{i}"])
        near(found.carry_x[:, i], truth[f"carry_x_{i}"])
        np.testing.assert_allclose(found.error_x[:, i], truth[f"error_x_{i}"], rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("store", [False, True])
def test_all_cores_and_a_store(store, tmp_path):
    options = {**FREE, "compute": Compute(), "record": recording(STROBE, ["x", "x[1]"], 6.3, check=0)}
    place = {"store": tmp_path / "store"} if store else {}
    found = orbit_diagram(**options, **place, y0=over(["mass"]))
    truth = orbit_diagram(**{**options, "compute": PORTABLE}, y0=over(["mass"]))
    near(found.x, truth.x)
    same(found["x[1]"], found.x[..., 1])


LONG = {"record": Segments(1.0, 20), "integrator": STEP}


def test_exponents_of_one_mass():
    """That of the driven mass by itself, x'' = -1.7 x - 0.1 x'."""
    found = lyapunov_spectrum(ARRAYS, Y_ARRAYS, **LONG, components=("x[1]", "v[1]"))
    assert found.exponents.shape == (2,)
    np.testing.assert_allclose(found.sum, -0.1, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("part", [None, ("x[1]", "v[1]")])
def test_lyapunov_spectrum(part):
    names = None if part is None else [name.replace("[", "_")[:-1] for name in part]
    found = lyapunov_spectrum(
        ARRAYS, Y_ARRAYS, **LONG, components=part, scales={"x": np.array([1.0, 2.0]), "v": 3.0}
    )
    truth = lyapunov_spectrum(
        SCALARS, Y_SCALARS, **LONG, components=names, scales=Scalars(3.0, 3.0, 1.0, 2.0)
    )
    assert found.exponents.size == (4 if part is None else 2)
    same(found.status, truth.status)
    np.testing.assert_allclose(found.exponents, truth.exponents, rtol=1e-9, atol=1e-10)


@pytest.mark.slow
def test_two_trajectories_and_volume():
    found = two_trajectory_exponent(ARRAYS, Y_ARRAYS, **LONG, components="x", distance=1e-6)
    truth = two_trajectory_exponent(
        SCALARS, Y_SCALARS, **LONG, components=["x_0", "x_1"], distance=1e-6
    )
    np.testing.assert_allclose(found.distance, truth.distance, rtol=1e-6)
    short = Segments(0.15, 20, warm_up=0)  # ends before the first event
    np.testing.assert_allclose(
        volume_growth(ARRAYS, Y_ARRAYS, short, integrator=STEP), -0.1, atol=1e-12
    )
    long = Segments(1.0, 20, warm_up=0)
    assert float(volume_growth(ARRAYS, Y_ARRAYS, long, integrator=STEP)) == -np.inf


def history(observables, sections=None):
    return time_history(ARRAYS, Y_ARRAYS, TIMES, observables, sections=sections)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: history("x[2]"), r"observables\['x\[2\]'\] = 'x\[2\]': .* \(v\[0\] to v\[1\], x\[0\]"),
        (lambda: history("x[0, 0]"), r"'x\[0, 0\]': it must be a component"),
        (lambda: history("x[-1]"), r"'x\[-1\]': it must be a component"),
        (lambda: history({"all": lambda system, t, y, dy, mode, args: y}), "which gives a dict"),
        (
            lambda: history("x", {"a": Maximum("x")}),
            r"sections\['a'\].observable = 'x', of shape \(2,\)",
        ),
        (
            lambda: orbit_diagram(
                **{**FREE, "record": recording(STROBE, ["x"], domain="slope of x")}, y0=over(["mass"])
            ),
            r"domain = 'slope of x', of shape \(2,\): it must be one number, of slope of x\[0\] to",
        ),
        (
            lambda: orbit_diagram(**FREE, y0={"x": np.zeros(3), "v": np.zeros(4)}),
            r"y0 = .*, with components of shapes \[\(3,\), \(4,\)\].*: it must be of the system's own",
        ),
        (
            lambda: orbit_diagram(**FREE, y0=over(["stiffness"], {"x": np.zeros(3), "v": np.zeros(3)})),
            r"of sizes \{'stiffness': 3\}: it must be of size 2 along 'stiffness', as the grid",
        ),
        (
            lambda: lyapunov_spectrum(ARRAYS, Y_ARRAYS, **LONG, components="x[2]"),
            r"components = 'x\[2\]': it must be names of components",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused_before_anything_is_compiled(call, text, monkeypatch):
    def compiled(*_, **__):
        raise AssertionError("compiled")

    monkeypatch.setattr("stickslip.hybrid._simulate.core", compiled)
    with pytest.raises(ValueError, match=text):
        call()
