"""Problems with records: against closed forms, SciPy, and rows left out by hand."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
import scipy.optimize
import xarray as xr

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import (
    RESULTS,
    Huber,
    LevenbergMarquardt,
    Normal,
    Observed,
    Problem,
    Record,
    Signal,
    SoftL1,
    Unknown,
    least_squares,
    sobol_starts,
)
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import CoulombOscillator, Motion

SIGMA = 1e-3
INTEGRATOR = ss.Integrator("tsit5", ss.AdaptiveStep(1e-9, 1e-9))
TRUTH = {"kinetic": 0.5, "stiffness": 1.0, "x": 0.1}


def block(values, inputs):
    return CoulombOscillator(1.0, values["stiffness"], 1.0, values["kinetic"], 0.2)


def start(values, inputs):
    return Motion(x=values["x"], v=0.2)


def position(t, y, system):
    return y.x


OBSERVED = {"position": Observed(position, SIGMA, "m")}
UNKNOWNS = {"kinetic": 0.55, "stiffness": 1.05, "x": Unknown(0.15, unit="m", per_record=True)}


def measured(times, noise=0.0, seed=0, **changes):
    """Positions at `times`, from the engine's own run with its default steps: an accurate reference."""
    values = TRUTH | changes
    found = ss.simulate(
        block(values, {}), 0.0, times[-1], start(values, {}), saveat=ss.SaveAt(ts=times, events=False)
    )
    clean = np.asarray(found.outputs.y.x)
    return clean + noise * np.random.default_rng(seed).normal(size=clean.size)


TIMES = np.sort(np.random.default_rng(1).uniform(0.1, 25.0, 40))


def problem(*records, **options):
    return Problem(
        block,
        start,
        UNKNOWNS,
        OBSERVED,
        records,
        integrator=options.pop("integrator", INTEGRATOR),
        **options,
    )


class Pushed(ss.AbstractSmoothSystem):
    """Free mass under a force: x'' = u(t) + offset."""

    force: Signal
    offset: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=self.force(t) + self.offset)


def pushed(values, inputs):
    return Pushed(inputs["force"], values["offset"])


def at_rest(values, inputs):
    return Motion(x=jnp.zeros(()), v=jnp.zeros(()))


def pushed_exactly(times, knots, force, offset):
    """Position under a held force, piece by piece in closed form."""
    t, x, v, found = 0.0, 0.0, 0.0, []
    stops = sorted({*times, *knots[knots < times[-1]]})
    for stop in stops:
        a = force[np.searchsorted(knots, t, side="right") - 1] + offset
        h = stop - t
        x, v, t = x + v * h + 0.5 * a * h**2, v + a * h, stop
        if stop in times:
            found.append(x)
    return np.array(found)


@pytest.mark.more
def test_held_input_is_the_exact_piecewise_solution():
    """The force jumps at times between the stamps; with steps that do not see it the error is 1e-2."""
    knots = np.array([0.0, 0.37, 1.41, 2.6, 3.3])
    force = np.array([1.0, -2.0, 3.0, 3.0, -1.0])
    times = np.array([0.5, 0.9, 1.7, 2.0, 2.9])
    exact = pushed_exactly(times, knots, force, -0.25)
    record = Record(
        times, {"x": exact}, inputs={"force": Signal(knots, force)}, begin=0.0, units={"x": "m"}
    )
    found = Problem(
        pushed, at_rest, {"offset": Unknown(0.0, unit="m/s^2")}, {"x": Observed(position, 1.0, "m")},
        record,
        integrator=ss.Integrator("rk4", ss.FixedStep(1.0)),
    )  # fmt: skip
    np.testing.assert_allclose(found.residual({"offset": -0.25}), 0.0, atol=1e-13)
    fit = found.fit()
    assert float(fit.values["offset"]) == pytest.approx(-0.25, abs=1e-12)
    events = found.simulate({"offset": -0.25}).solution.events
    np.testing.assert_allclose(events.t[: int(events.count)], [0.37, 1.41], atol=1e-14)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_interpolated_inputs(kind):
    """A polynomial of the degree that the interpolation has is given back, with a jump between."""
    times = np.array([0.0, 0.5, 1.0, 2.0, 2.0, 2.5, 3.1, 4.0])
    before, after = (np.array([0.3, 2.0]), np.array([-1.0, 5.0]))
    if kind == "cubic":
        before, after = np.array([0.1, -0.4, 0.3, 2.0]), np.array([0.2, 0.0, -1.0, 5.0])
    values = np.where(np.arange(8) < 4, np.polyval(before, times), np.polyval(after, times))
    signal = Signal(times, values, kind)
    np.testing.assert_array_equal(signal.breaks, [2.0])
    early, late = np.linspace(0.0, 1.99, 9), np.linspace(2.0, 3.99, 9)
    np.testing.assert_allclose(jax.vmap(signal)(early), np.polyval(before, early), atol=1e-12)
    np.testing.assert_allclose(jax.vmap(signal)(late), np.polyval(after, late), atol=1e-12)
    later = signal.delayed(0.25)
    np.testing.assert_allclose(jax.vmap(later)(early + 0.25), np.polyval(before, early), atol=1e-12)
    np.testing.assert_allclose(later.breaks, [2.25])


class Sledge(AbstractMechanism):
    """1.3 kg on the ground (1.7 N) and on a spring, pushed."""

    push: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.3}

    def forces(self, t, q, v, args):
        return {"x": self.push(t) - 20.0 * q.x}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(1.7))}


@pytest.mark.more
def test_steps_that_end_on_a_break_are_not_tried_again():
    """Rounding of the time there looked like a hidden event once: 9,338 attempts for 1,807."""
    t = np.arange(0.0, 4.0, 0.02)
    problem = Problem(
        lambda values, inputs: Sledge(inputs["push"]), lambda values, inputs: Sledge(None).state(),
        {"scale": 1.0}, {"x": Observed(lambda t, y, system: y.x, SIGMA, "m")},
        Record(t, {"x": 0.0 * t}, inputs={"push": 6.0 * np.sin(3.0 * t)}, interpolation="linear"),
    )  # fmt: skip
    assert int(problem.simulate({"scale": 1.0}).solution.stats.num_attempts) < 2_000


def test_linear_inputs_bend():
    assert Signal([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 0.0], "linear").breaks.tolist() == [2.0]


@pytest.mark.more
def test_known_parameters_come_back_from_stick_slip_records():
    """Two records of different lengths, irregular times: each has its own initial position."""
    one, two = TIMES, TIMES[:25]
    found = problem(
        Record(one, {"position": measured(one)}, begin=0.0, name="a"),
        Record(two, {"position": measured(two, x=-0.2)}, begin=0.0, name="b"),
    )
    assert sorted(found.unknowns) == ["kinetic", "stiffness", "x[a]", "x[b]"]
    fit = found.fit(method=LevenbergMarquardt())
    expected = {"kinetic": 0.5, "stiffness": 1.0, "x[a]": 0.1, "x[b]": -0.2}
    for name, value in expected.items():
        assert float(fit.values[name]) == pytest.approx(value, abs=1e-7)
    assert bool(fit.successful)
    parts = found.parts(fit.residual)
    assert parts["b"]["position"][1].shape == (25,)
    np.testing.assert_array_equal(parts["a"]["position"][0], one)
    # Each alone: the record with fewer rows is the program of the longer, padded.
    alone = problem(Record(two, {"position": measured(two, x=-0.2)}, begin=0.0, name="b"))
    values = {"kinetic": 0.52, "stiffness": 1.01, "x[b]": -0.15}
    both = found.residual(values | {"x[a]": 0.0})
    np.testing.assert_allclose(both[one.size :], alone.residual(values), atol=1e-9)


@pytest.mark.more
def test_missing_rows_are_rows_left_out():
    rows = measured(TIMES, noise=SIGMA)
    away = np.zeros(40, bool)
    away[[3, 17, 30]] = True
    marked = problem(
        Record(TIMES, {"position": np.where(away, np.nan, rows)}, missing="nan", begin=0.0)
    )
    named = problem(Record(TIMES, {"position": rows}, missing={"position": away}, begin=0.0))
    dropped = problem(Record(TIMES[~away], {"position": rows[~away]}, begin=0.0))
    values = {"kinetic": 0.52, "stiffness": 1.01, "x[0]": 0.12}
    # Fewer output times change the steps, so the comparison is to their tolerance.
    np.testing.assert_allclose(marked.residual(values), dropped.residual(values), atol=1e-4)
    np.testing.assert_array_equal(marked.residual(values), named.residual(values))
    assert marked.residual(values).shape == (37,)


@pytest.mark.slow
def test_log_density_is_that_of_the_normal_distribution():
    """Against the logarithms of the densities by SciPy, up to a constant."""
    rows = measured(TIMES, noise=SIGMA)
    unknowns = UNKNOWNS | {"stiffness": Unknown(1.0, (0, None), prior=Normal(1.1, 0.05))}
    found = Problem(
        block, start, unknowns, OBSERVED, Record(TIMES, {"position": rows}, begin=0.0),
        integrator=INTEGRATOR,
    )  # fmt: skip

    def by_scipy(values):
        model = np.asarray(found.simulate(values).observed["position"])
        data = scipy.stats.norm(model, SIGMA).logpdf(rows).sum()
        return data + scipy.stats.norm(1.1, 0.05).logpdf(values["stiffness"])

    one = {"kinetic": 0.5, "stiffness": 1.0, "x[0]": 0.1}
    other = one | {"stiffness": 1.0005}
    difference = float(found.log_density(other) - found.log_density(one))
    assert difference == pytest.approx(by_scipy(other) - by_scipy(one), abs=1e-6)


@pytest.mark.more
def test_same_optimum_as_scipy_with_fewer_runs():
    """SciPy with finite differences on the same residual, counted in runs of the model."""
    rows = measured(TIMES, noise=SIGMA)
    found = problem(Record(TIMES, {"position": rows}, begin=0.0))
    names = list(found.unknowns)
    runs = 0

    def residual(p):
        nonlocal runs
        runs += 1
        return np.asarray(found.residual(dict(zip(names, p, strict=True))))

    theirs = scipy.optimize.least_squares(
        residual, [0.55, 1.05, 0.15], x_scale=[0.5, 1.0, 0.1], xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    ours = found.fit(method=LevenbergMarquardt(tolerance=1e-14))
    errors = ours.standard_errors()
    for name, value in zip(names, theirs.x, strict=True):
        assert abs(float(ours.values[name]) - value) < 1e-3 * float(errors[name])
    assert 5 * int(ours.steps) < 2 * runs


@pytest.mark.parametrize(("loss", "name"), [(Huber(1.5), "huber"), (SoftL1(1.5), "soft_l1")])
def test_robust_losses_are_those_of_scipy(loss, name):
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 1.0, 40)
    data = 2.0 + 3.0 * t + 0.1 * rng.normal(size=40)
    data[::8] += 3.0

    def residual(p):
        return (p["a"] + p["b"] * t - data) / 0.1

    start = {"a": Unknown(1.0), "b": Unknown(1.0)}
    method = LevenbergMarquardt(loss=loss, tolerance=1e-14, max_steps=300)
    ours = least_squares(residual, start, method)
    theirs = scipy.optimize.least_squares(
        lambda p: (p[0] + p[1] * t - data) / 0.1, [1.0, 1.0], loss=name, f_scale=1.5,
        xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=1000,
    )  # fmt: skip
    assert bool(ours.successful)
    np.testing.assert_allclose([ours.values["a"], ours.values["b"]], theirs.x, rtol=1e-6)
    assert float(ours.cost) == pytest.approx(theirs.cost, rel=1e-10)
    plain = least_squares(residual, start)
    assert abs(float(plain.values["a"]) - 2.0) > 3 * abs(float(ours.values["a"]) - 2.0)


def test_results_are_messages():
    def residual(p):
        return jnp.stack([10.0 * (p["b"] - p["a"] ** 2), 1.0 - p["a"]])

    for fit, word in (
        (
            least_squares(residual, dict(a=0.3, b=3.0), LevenbergMarquardt(max_steps=2)),
            "`LevenbergMarquardt(max_steps=...)`",
        ),
        (least_squares(lambda p: p["a"][None] * jnp.nan, dict(a=1.0)), "at the start"),
    ):
        assert not bool(fit.successful)
        assert word in RESULTS[fit.result]
    assert RESULTS[least_squares(residual, dict(a=0.3, b=3.0)).result] == ""


def test_tables_of_pandas_and_xarray():
    rows = measured(TIMES)
    plain = Record(TIMES, {"position": rows}, inputs={"u": np.arange(40.0)}, units={"position": "m"})
    frame = pd.DataFrame({"t": TIMES, "x": rows, "u": np.arange(40.0)})
    data = xr.Dataset({"x": ("t", rows, {"units": "m"}), "u": ("t", np.arange(40.0))}, {"t": TIMES})
    for table in (frame, data):
        record = Record.from_table(table, time="t", values={"position": "x"}, inputs=("u",))
        assert eqx.tree_equal(record.values, plain.values)
        assert eqx.tree_equal(record.inputs, plain.inputs)
    assert record.units == {"position": "m"}
    with pytest.raises(ValueError, match="time = 'stamp': it must be a column"):
        Record.from_table(frame, time="stamp", values=("x",))


@pytest.mark.slow
def test_delay_of_the_stamps():
    """Stamps that are late by 0.05 s, an unknown."""
    clock = TIMES + 0.05
    unknowns = {
        "delay": Unknown(0.01, bounds=(-1.0, 1.0), unit="s"),
        "stiffness": 1.05,
        "kinetic": 0.55,
    }
    # The initial position is known: a block that sticks at first is elsewhere at another time.
    record = Record(clock, {"position": measured(TIMES)}, begin=0.0, known={"x": 0.1})
    found = Problem(
        block, start, unknowns, OBSERVED, record, integrator=INTEGRATOR, delay="delay",
    )  # fmt: skip
    residual = found.residual({"delay": 0.05, "kinetic": 0.5, "stiffness": 1.0})
    np.testing.assert_allclose(residual, 0.0, atol=1e-4)
    fit = found.fit(method=LevenbergMarquardt())
    assert float(fit.values["delay"]) == pytest.approx(0.05, abs=1e-6)


def test_starts_fill_the_bounds_evenly():
    unknowns = {"a": Unknown(0.5, (0.0, 4.0)), "b": 2.0, "c": Unknown(0.0, prior=Normal(1.0, 0.1))}
    rows = sobol_starts(unknowns, 64, spread=3.0)
    # A Sobol sequence has as many points in every quarter as it should, to one.
    counts = np.histogram(rows["a"], np.linspace(0.0, 4.0, 5))[0]
    assert abs(counts - 16).max() <= 1
    assert rows["b"].min() > 2.0 / 3.0
    assert rows["b"].max() < 6.0
    assert abs(np.mean(rows["c"][1:]) - 1.0) < 0.02
    assert [rows[name][0] for name in "abc"] == [0.5, 2.0, 0.0]


@pytest.mark.slow
def test_many_fits_of_a_problem_compile_once():
    rows = measured(TIMES, noise=SIGMA)
    found = problem(Record(TIMES, {"position": rows}, begin=0.0))
    best = found.fit(method=LevenbergMarquardt(tolerance=1e-13), starts=3, chunk_size=3)
    again = found.with_records(Record(TIMES, {"position": measured(TIMES)}, begin=0.0))
    compiled = 0

    def count(event, *_, **__):
        nonlocal compiled
        compiled += event == "/jax/core/compile/backend_compile_duration"

    jax.monitoring.register_event_duration_secs_listener(count)
    other = again.fit(method=LevenbergMarquardt(tolerance=1e-13), starts=3, chunk_size=3)
    assert compiled == 0
    assert float(other.values["stiffness"]) == pytest.approx(1.0, abs=1e-6)
    assert abs(float(best.values["stiffness"]) - 1.0) < 5 * float(best.standard_errors()["stiffness"])


@pytest.mark.more
def test_what_the_data_do_not_see_is_a_verdict():
    """An unknown that nothing depends on: no error, an infinite interval."""
    found = Problem(
        block, start, UNKNOWNS | {"colour": 2.0}, OBSERVED,
        Record(TIMES, {"position": measured(TIMES, noise=SIGMA)}, begin=0.0), integrator=INTEGRATOR,
    )  # fmt: skip
    errors = found.fit(method=LevenbergMarquardt()).standard_errors()
    assert np.isinf(errors["colour"])
    assert np.isfinite(errors["stiffness"])


def test_what_nobody_declared_is_named():
    def mistaken(values, inputs):
        return block({**values, "kinetic": values["kinetc"]}, inputs)

    def late(values, inputs):
        return Motion(x=values["x"], v=inputs["speed"])

    record = Record([0.0, 1.0], {"position": [0.1, 0.2]})
    for system, first, words in (
        (mistaken, start, r"system\(values, inputs\) asks for 'kinetc'.*'kinetic', 'stiffness', 'x'"),
        (block, late, r"initial_state\(values, inputs\) asks for 'speed'.*inputs are none"),
    ):
        wrong = Problem(system, first, UNKNOWNS, OBSERVED, record, integrator=INTEGRATOR)
        with pytest.raises(KeyError, match=words):
            wrong.fit()


def test_bad_records():
    x = {"position": np.zeros(3)}
    nan = {"position": np.array([0.0, np.nan, 1.0])}
    for make, error, text in (
        (lambda: Record([0.0, 2.0, 1.0], x), ValueError, r"times\[2\] = 1.0: it must be above"),
        (lambda: Record([0.0, 1.0], x), ValueError, r"values\['position'\] = .* as many as times"),
        (lambda: Record([0.0, 1.0, 2.0], nan), ValueError, r"\]\[1\] = nan.*row 1, time 1.0 s"),
        (lambda: Record([0.0, 1.0, np.inf], x), ValueError, r"times\[2\] = inf"),
        (lambda: Record([0.0, 1.0, 2.0], x, begin=1.0), ValueError, "begin = 1.0: it must be at most"),
        (lambda: Record([0.0, 1.0, 2.0], x, units={"y": "m"}), ValueError, r"units\['y'\] = 'm'"),
        (
            lambda: Record([0.0, 1.0, 2.0], x, inputs={"u": Signal([0.0, 1.0], [0.0, 1.0], "linear")}),
            ValueError, r"inputs\['u'\] = .*ends at 1.0 s: it must be as long as the record",
        ),
        (lambda: Record([0.0, 1.0, 2.0], x, inputs={"u": [0.0, np.nan, 1.0]}), ValueError, "no gaps"),
        (lambda: Signal([0.0, 0.0], [1.0, 2.0]), ValueError, r"times\[1\] = 0.0: it must be above"),
        (lambda: Signal([0.0, 1.0], [1.0, 2.0, 3.0]), ValueError, "values = .* as times"),
    ):  # fmt: skip
        with pytest.raises(error, match=text):
            make()


def test_bad_problems():
    good = Record([0.0, 1.0, 2.0], {"position": np.zeros(3)}, units={"position": "m"})
    other = Record([0.0, 1.0], {"angle": np.zeros(2)})
    wrong = Record([0.0, 1.0], {"position": np.zeros(2)}, units={"position": "mm"})
    loaded = Record([0.0, 1.0], {"position": np.zeros(2)}, known={"load": 1.0})
    for records, text in (
        ([good, other], r"records\[1\] = Record, with values of 'angle': it must be of values named"),
        ([good, wrong], r"records\[1\].units\['position'\] = 'mm': it must be in 'm'"),
        ([good, loaded], r"records\[1\] = Record, with \['load'\]"),
        ([good, Record([0.0, 1.0], {"position": np.zeros(2)}, name="0")], "different names"),
    ):
        with pytest.raises((ValueError, TypeError), match=text):
            problem(*records)
    found = problem(good)
    with pytest.raises(
        ValueError, match=r"values = .*: it must be numbers by the names kinetic, stiff"
    ):
        found.residual({"kinetic": 1.0})
