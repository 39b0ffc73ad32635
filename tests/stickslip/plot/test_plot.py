"""What is drawn is what was computed: lines, bands, marks, labels."""

import math
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip import plot
from stickslip._drawing import BLUE, GREEN, RED
from stickslip.analysis import LyapunovSpectrum, amplitude_spectrum, energy_ledger, time_history
from stickslip.control import HuntingMap
from stickslip.friction import Coulomb
from stickslip.identification import Fit, Observed, Problem, Record, Sensitivity
from stickslip.identification._unknowns import scalars
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import CoulombOscillator, Motion

GRID = np.linspace(0.0, 30.0, 301)
# Stuck from 0 to 5 s, then slips: by closed form a period of 8.90260541 s.
PERIOD = 5.0 + 2.0 * (math.pi - math.atan(2.5))
BEGINS = [0.0, PERIOD, 2 * PERIOD, 3 * PERIOD]
ENDS = [5.0, PERIOD + 5.0, 2 * PERIOD + 5.0, 30.0]


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def block(belt_speed=0.2):
    return CoulombOscillator(1.0, 1.0, 1.0, 0.5, belt_speed)


def run(belt_speed=0.2):
    start, saveat = Motion(x=0.0, v=belt_speed), ss.SaveAt(ts=jnp.asarray(GRID))
    return ss.simulate(block(belt_speed), 0.0, 30.0, start, saveat=saveat)


@pytest.fixture(scope="module")
def one():
    return run()


def bands(axis):
    """Begin and end of every band of each collection of polygons."""
    return [
        np.array([(p.vertices[:, 0].min(), p.vertices[:, 0].max()) for p in c.get_paths()])
        for c in axis.collections
    ]


@pytest.mark.more
def test_motion(one):
    above, below = plot.motion(one, block())
    for axis, values, label in (
        (above, one.outputs.y.x, "x [m]"),
        (below, one.outputs.y.v, "v [m/s]"),
    ):
        line, marks = axis.lines
        np.testing.assert_array_equal(line.get_xdata(), GRID)
        np.testing.assert_array_equal(line.get_ydata(), values)
        # Bands end where the closed form says, not at the outputs, which are 0.1 s apart.
        (drawn,) = bands(axis)
        np.testing.assert_allclose(drawn, np.transpose([BEGINS, ENDS]), atol=1e-9)
        assert len(drawn) == 1 + np.sum(np.asarray(one.events.mode_after)[: int(one.num_events)] == 1)
        np.testing.assert_array_equal(marks.get_xdata(), one.events.t[:6])
        assert axis.get_ylabel() == label
    np.testing.assert_allclose(above.lines[1].get_ydata(), [1.0, 0.0] * 3, atol=1e-9)
    assert below.get_xlabel() == "t [s]"
    assert [text.get_text() for text in above.get_legend().get_texts()] == ["belt sticks", "events"]


@pytest.mark.more
def test_motion_into_given_axes(one):
    figure, axis = plt.subplots()
    found = plot.motion(one, block(), "slope of v", contacts=(), events=False, ax=axis, color="k")
    assert found is axis
    assert plt.get_fignums() == [figure.number]
    (line,) = axis.lines
    np.testing.assert_array_equal(line.get_ydata(), one.outputs.dy.v)
    assert (line.get_color(), axis.get_ylabel(), len(axis.collections)) == (
        "k",
        "slope of v [m/s/s]",
        0,
    )


def test_without_a_log_of_events_rows_say_what_sticks(one):
    unlogged = eqx.tree_at(lambda r: r.events, one, None)
    full = eqx.tree_at(lambda r: r.events.count, one, jnp.asarray(2, jnp.int32))
    for given in (unlogged, full):
        (drawn,) = bands(plot.motion(given, block(), "x"))
        np.testing.assert_allclose(drawn, np.transpose([BEGINS, ENDS]), atol=0.1)


@pytest.mark.more
def test_motion_of_a_dataset():
    data = time_history(block(), Motion(x=0.0, v=0.2), GRID, ["x", "v"])
    axis = plot.motion(data, observables="v")
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), data.v)
    (drawn,) = bands(axis)
    np.testing.assert_allclose(drawn, np.transpose([BEGINS, ENDS]), atol=0.1)
    (named,) = bands(plot.motion(data, block(), "v", contacts="belt"))
    np.testing.assert_array_equal(named, drawn)


@pytest.mark.more
def test_one_run_of_a_batch(one):
    other = run(0.3)
    batch = jax.tree.map(lambda *rows: jnp.stack(rows), one, other)
    axis = plot.motion(batch, block(0.3), "x", lane=1)
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), other.outputs.y.x)
    np.testing.assert_array_equal(axis.lines[1].get_xdata(), other.events.t[: int(other.num_events)])
    (drawn,), (alone,) = bands(axis), bands(plot.motion(other, block(0.3), "x"))
    np.testing.assert_array_equal(drawn, alone)
    table = jax.tree.map(lambda a: a[None], batch)
    axis = plot.motion(table, block(0.3), "x", lane=(0, 1))
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), other.outputs.y.x)
    for given, lane, text in (
        (
            batch,
            None,
            r"solution = Solution, of shape \(2,\): it must be a single run, or lane=0 to 1",
        ),
        (batch, 2, "lane = 2, for a solution"),
        (table, 1, r"lane = 1, .* it must be 2 numbers, .* up to \(0, 1\)"),
        (one, 0, "lane = 0: it must be None: the solution is a single run"),
        (batch.to_dataset(block()), None, r"over run before `time`: .* dataset.isel\(run=0\)"),
    ):
        with pytest.raises(ValueError, match=text):
            plot.motion(given, block(), "x", lane=lane)
    data = batch.to_dataset(block())
    axis = plot.motion(data.isel(run=1), block(), "x")
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), other.outputs.y.x)


def test_numbers_of_arrays_are_drawn_by_their_names():
    def slope(t):
        return np.stack([np.sin(t), 2 * np.cos(t)], axis=-1)

    class Rows(ss.AbstractSmoothSystem):
        units: ClassVar = {"x": "m"}

        def vector_field(self, t, y, mode, args):
            return {"x": jnp.stack([jnp.cos(t), -2.0 * jnp.sin(t)])}

    rows = ss.simulate(
        Rows(), 0.0, 6.0, {"x": np.array([0.0, 2.0])}, saveat=ss.SaveAt(ts=jnp.linspace(0, 6, 31))
    )
    first, second = plot.motion(rows, Rows())
    np.testing.assert_allclose(
        second.lines[0].get_ydata(), slope(np.linspace(0, 6, 31))[:, 1], atol=1e-8
    )
    assert (first.get_ylabel(), second.get_ylabel()) == ("x[0] [m]", "x[1] [m]")
    axis = plot.motion(rows, Rows(), "slope of x[0]")
    assert axis.get_ylabel() == "slope of x[0] [m/s]"
    np.testing.assert_allclose(axis.lines[0].get_ydata(), np.cos(np.linspace(0, 6, 31)), atol=1e-8)
    with pytest.raises(
        ValueError, match=r"'slope of x': it must be a single number, one of slope of x\[0\],"
    ):
        plot.motion(rows, Rows(), "slope of x")
    data = rows.to_dataset(Rows())
    axis = plot.motion(data, observables="x[1]")
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), second.lines[0].get_ydata())
    assert axis.get_ylabel() == "x[1] [m]"
    assert plot.phase_plane(rows, Rows()).get_ylabel() == "x[1] [m]"
    points = np.arange(12.0).reshape(2, 3, 2)
    dots = xr.Dataset({"x": (("k", "point", "x_0"), points, {"units": "m"})}, {"k": [1.0, 2.0]})
    axis = plot.orbit_diagram(dots, "x[1]")
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), points[..., 1].ravel())
    assert axis.get_ylabel() == "x[1] [m]"
    with pytest.raises(
        ValueError, match=r"observable = 'x': it must be a single number, one of x\[0\], x"
    ):
        plot.orbit_diagram(dots)


class Pair(AbstractMechanism):
    """Two blocks on a belt that know nothing of each other, one of them on a circle."""

    coordinates: ClassVar = {"x": "m", "theta": "rad"}
    contact_directions: ClassVar = {"left": {"x": 1.0}, "right": {"theta": 1.0}}
    periods: ClassVar = {"theta": 2.0 * math.pi}
    turn: Any

    def mass_matrix(self, q):
        return {"x": 1.0, "theta": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x, "theta": self.turn - v.theta}

    def contacts(self, t, q, v, args):
        law = Coulomb(1.0, 0.5)
        return {"left": Contact(law, surface_speed=0.2), "right": Contact(law)}


@pytest.mark.more
def test_contacts_share_the_height_and_an_angle_goes_round():
    pair = Pair(0.1)
    start = pair.state(v_x=0.2, v_theta=9.0)
    ts = ss.SaveAt(ts=jnp.linspace(0.0, 10.0, 501))
    motion = ss.simulate(pair, 0.0, 10.0, start, saveat=ts)
    axis = plot.motion(motion, pair, "theta")
    left, right = bands(axis)
    np.testing.assert_allclose(left, [(0.0, 5.0), (PERIOD, 10.0)], atol=1e-8)
    # v' = 0.1 - 0.5 - v from 9 is zero at log(1 + 9 / 0.4).
    np.testing.assert_allclose(right, [(math.log(23.5), 10.0)], atol=1e-8)
    heights = [c.get_paths()[0].vertices[:, 1] for c in axis.collections]
    assert [(h.min(), h.max()) for h in heights] == [(0.0, 0.5), (0.5, 1.0)]
    assert [c.get_label() for c in axis.collections] == ["left sticks", "right sticks"]
    drawn = axis.lines[0].get_ydata()
    whole = np.asarray(motion.outputs.y.theta)
    gaps = np.isnan(drawn)
    assert gaps.sum() == np.floor((whole[-1] + math.pi) / (2 * math.pi)) > 0
    assert np.nanmax(np.abs(drawn)) <= math.pi
    turns = (whole - drawn)[~gaps] / (2 * math.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    (only,) = bands(plot.motion(motion, pair, "x", contacts=["right"]))
    np.testing.assert_array_equal(only, right)


def test_phase_plane(one):
    axis = plot.phase_plane(one, block())
    np.testing.assert_array_equal(axis.lines[0].get_xdata(), one.outputs.y.x)
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), one.outputs.y.v)
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("x [m]", "v [m/s]")
    batch = jax.tree.map(lambda *rows: jnp.stack(rows), one, run(0.3))
    lines = plot.phase_plane(batch, block(), "v", "x").lines
    assert len(lines) == 2
    np.testing.assert_array_equal(lines[1].get_ydata(), batch.outputs.y.x[1])


def test_orbit_diagram():
    points = np.array([[1.0, np.nan, np.nan], [1.0, 2.0, np.nan]])
    data = xr.Dataset(
        {"x": (("k", "point"), points, {"units": "m"}), "period": (("k",), [1, 2])},
        {"k": ("k", [3.0, 4.0], {"units": "N/m", "long_name": "stiffness"})},
    )
    axis = plot.orbit_diagram(data)
    np.testing.assert_array_equal(axis.lines[0].get_xdata(), [3.0, 4.0, 4.0])
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), [1.0, 1.0, 2.0])
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("stiffness [N/m]", "x [m]")
    np.testing.assert_array_equal(plot.orbit_diagram(data, "period").lines[0].get_ydata(), [1, 2])
    assert axis.get_legend() is None
    status = {"flag_values": [0, 1, 2], "flag_meanings": "ok not_settled left_domain"}
    axis = plot.orbit_diagram(data.assign(status=("k", [0, 1], status)))
    assert [line.get_ydata().tolist() for line in axis.lines] == [[1.0], [1.0, 2.0]]
    assert [line.get_color() for line in axis.lines] == [BLUE, RED]
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ["not settled: 1 lane"]
    status = {"flag_values": [0, 1, 2], "flag_meanings": "ok no_crossing at_rest"}
    axis = plot.orbit_diagram(data.assign(status=("k", [1, 2], status), end_x=("k", [0.3, 0.5])))
    texts = [text.get_text() for text in axis.get_legend().get_texts()]
    assert texts == ["no crossing: 1 lane", "at rest: 1 lane"]
    assert [line.get_color() for line in axis.lines] == [BLUE, RED, GREEN, GREEN]
    assert axis.lines[3].get_xydata().tolist() == [[4.0, 0.5]]
    with pytest.raises(ValueError, match=r"dataset = .*of points over m, k: it must be over one param"):
        plot.orbit_diagram(data.expand_dims(m=[0.0, 1.0]))


def test_spectrum():
    found = amplitude_spectrum(np.sin(0.4 * GRID), 0.1)
    axis = plot.spectrum(found, unit="m", bases={"f": 0.4 / (2 * math.pi)})
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), found.amplitude[1:])
    np.testing.assert_array_equal(axis.lines[0].get_xdata(), found.frequency[1:])
    assert axis.lines[1].get_xdata()[0] == 0.4 / (2 * math.pi)
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("frequency [Hz]", "amplitude [m]")
    assert axis.get_yscale() == "log"


def test_exponents():
    local = jnp.asarray([[1.0, -jnp.inf], [2.0, -1.0], [3.0, -1.0], [2.0, -1.0]])
    found = LyapunovSpectrum(
        jnp.asarray([2.0, -jnp.inf]), jnp.asarray([0.25, jnp.nan]), local, jnp.arange(1.0, 5.0),
        jnp.zeros(2, jnp.int32), 4.0, (),
    )  # fmt: skip
    axis = plot.exponents(found)
    line, _ = axis.lines
    np.testing.assert_allclose(line.get_ydata(), [1.0, 1.5, 2.0, 2.0])
    (band,) = axis.patches
    assert (band.get_y(), band.get_height()) == (1.75, 0.5)
    data = xr.Dataset(
        {
            "exponents": (("exponent", "k"), [[0.5, 0.1], [-np.inf, -1.0]], {"units": "1/s"}),
            "error": (("exponent", "k"), [[0.1, 0.2], [np.nan, 0.1]]),
        },
        {"k": [3.0, 4.0]},
    )
    axis = plot.exponents(data)
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), [0.5, 0.1])
    np.testing.assert_array_equal(axis.lines[1].get_ydata(), [np.nan, -1.0])
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("k", "exponent [1/s]")


@pytest.mark.more
def test_energy_account():
    ledger = energy_ledger(block(), Motion(x=0.0, v=0.2), GRID)
    above, below = plot.energy_account(ledger)
    drawn = {line.get_label(): line.get_ydata() for line in above.lines}
    np.testing.assert_array_equal(drawn["gain of energy"], ledger.energy - ledger.energy[0])
    np.testing.assert_array_equal(drawn["work of friction"], ledger.work_friction)
    assert set(drawn) == {"gain of energy", "work of belt", "work of friction"}
    np.testing.assert_array_equal(below.lines[0].get_ydata(), ledger.imbalance)
    assert above.get_ylabel() == "energy [J]"


@pytest.mark.more
def test_fit():
    times = np.linspace(0.0, 4.0, 9)
    truth = Motion(x=0.3, v=0.2)
    data = truth.x * np.cos(times) + truth.v * np.sin(times)
    data[3] = np.nan
    problem = Problem(
        system=lambda p, inputs: CoulombOscillator(1.0, p["k"], 0.0, 0.0, 0.0),
        initial_state=lambda p, inputs: truth,
        unknowns={"k": 1.1},
        observed={"position": Observed(lambda t, y, system: y.x, 1e-2, "m")},
        records=Record(times, {"position": data}, missing="nan"),
    )
    values = {"k": jnp.asarray(1.02)}
    residual, weight = problem.residual(values), Sensitivity(("k",), jnp.ones((8, 1)))
    three, converged = jnp.asarray(3, jnp.int32), jnp.asarray(0, jnp.int32)
    space = scalars("unknowns", {"k": 1.1})[0]
    found = Fit(values, residual, weight, three, space, converged)
    above, below = plot.fit(found, problem)
    dots, model = above.lines
    np.testing.assert_array_equal(dots.get_ydata(), data[np.isfinite(data)])
    expected = problem.simulate(found.values).observed["position"]
    np.testing.assert_array_equal(model.get_ydata(), expected)
    np.testing.assert_array_equal(below.lines[0].get_ydata(), found.data_residual)
    assert (above.get_ylabel(), below.get_ylabel()) == ("position [m]", "residual [sd]")
    known = truth.x * np.cos(1.02**0.5 * times) + truth.v * np.sin(1.02**0.5 * times) / 1.02**0.5
    np.testing.assert_allclose(model.get_ydata(), known, atol=1e-9)
    alone = plot.fit(found)
    np.testing.assert_array_equal(alone.lines[0].get_ydata(), found.data_residual)
    weight = Sensitivity(("q",), jnp.ones((8, 1)))
    space = scalars("unknowns", {"q": 1.0})[0]
    other = Fit({"q": jnp.ones(())}, residual, weight, three, space, converged)
    with pytest.raises(ValueError, match=r"found = Fit, with the unknowns q: it must be a Fit of the"):
        plot.fit(other, problem)


def test_hunting():
    """Each loop stands at its gains; those that hunt have the colour of their amplitude."""
    kp, ki = np.meshgrid([1.0, 2.0, 3.0], [10.0, 20.0], indexing="ij")
    code, amplitude = np.array([[0, 1], [2, 1], [3, 0]]), np.array([[0.0, 0.5], [0.1, 2.0], [9.0, 0.0]])
    axis = plot.hunting(HuntingMap({"kp": kp, "ki": ki}, code, amplitude, amplitude))
    drawn = {marks.get_label(): marks for marks in axis.collections}
    assert drawn.keys() == {"rests", "hunts", "creeps", "unstable"}
    np.testing.assert_array_equal(drawn["hunts"].get_offsets(), [[1.0, 20.0], [2.0, 20.0]])
    np.testing.assert_array_equal(drawn["hunts"].get_array(), [0.5, 2.0])
    np.testing.assert_array_equal(drawn["rests"].get_offsets(), [[1.0, 10.0], [3.0, 20.0]])
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("kp", "ki")
    with pytest.raises(ValueError, match=r"axes = \('kp', 'kd'\): it must be two of kp, ki"):
        plot.hunting(HuntingMap({"kp": kp, "ki": ki}, code, amplitude, amplitude), ("kp", "kd"))


def test_shade():
    holds = np.array([True, True, False, True])
    axis = plot.shade(np.arange(4.0), holds, label="open")
    np.testing.assert_array_equal(bands(axis)[0], [(0.0, 1.0), (3.0, 3.0)])


def test_wrong_arguments(one):
    batch = jax.tree.map(lambda a: a[None], one)
    with pytest.raises(ValueError, match=r"solution = Solution, of shape \(1,\): .* one run of"):
        plot.motion(batch, block())
    with pytest.raises(ValueError, match=r"solution = Solution: it must be of a run with saveat="):
        plot.motion(eqx.tree_at(lambda r: r.outputs, one, None), block())
    with pytest.raises(ValueError, match=r"contacts = 'rail': .* 'belt'"):
        plot.motion(one, block(), contacts="rail")
    with pytest.raises(TypeError, match="system = None: it must be the system of the solution"):
        plot.motion(one)
    with pytest.raises(ValueError, match=r"ax = .*, of length 1: it must be 2 axes"):
        plot.motion(one, block(), ax=[plt.subplots()[1]])
    with pytest.raises(TypeError, match=r"colour = 'k': .* properties of a line"):
        plot.phase_plane(one, block(), colour="k")


def test_the_second_picture_compiles_nothing(compiled, one):
    def pull(system, t, y, dy, mode, args):
        return -system.stiffness * y.x

    def draw(solution):
        drawn = plot.motion(solution, block(), [pull, "slope of v"])[0].lines[0].get_ydata()
        np.testing.assert_array_equal(drawn, -solution.outputs.y.x)
        plot.phase_plane(solution, block())
        solution.to_dataset(block())

    draw(one)
    count = len(compiled)
    draw(jax.tree.map(jnp.asarray, one))
    assert len(compiled) == count
