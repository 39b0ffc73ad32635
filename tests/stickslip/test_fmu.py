"""Functional mock-up units, run by FMPy: the digits of `simulate`, events inside of steps included."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
import stickslip as ss
from stickslip.systems import BlockOnBeltSetValued, BouncingBall, CoulombOscillator, Motion

TIGHT = ss.Integrator(step=ss.AdaptiveStep(1e-13))


class Force(NamedTuple):
    force: Any


class Kicked(ss.AbstractHybridSystem):
    """A mass on a spring under a force, whose speed is reversed in part as it passes a mark."""

    stiffness: float
    kick: float

    mode_names: ClassVar = ("free",)
    guard_names: ClassVar = ("passes the mark", "comes to the wall", "never")
    guard_directions: ClassVar = ("both", "rising", "falling")
    units: ClassVar = {"x": "m", "v": "m/s"}
    parameter_units: ClassVar = {"stiffness": "N/m"}

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=args.force - self.stiffness * y.x)

    def guards(self, t, y, mode, args):
        return y.x, y.x - 1.5, 1.0

    def transition(self, t, y, mode, guard, args):
        return Motion(x=y.x, v=jnp.where(guard == 0, self.kick * y.v, -0.5 * y.v)), mode

    def initial_mode(self, t, y, args):
        return jnp.where(y.x > 1.5, -1, 0)


KICKED, START = Kicked(1.0, 1.1), Motion(x=1.0, v=0.0)


@pytest.fixture(scope="module")
def kicked(tmp_path_factory):
    path = tmp_path_factory.mktemp("units") / "kicked.fmu"
    power = {"power": lambda system, t, y, mode, args: args.force * y.v}
    return ss.export_fmu(
        KICKED, START, path, args=Force(0.2), inputs=["args.force"], outputs=power, integrator=TIGHT
    )


def description(path):
    """What the unit says of itself, judged by FMPy, whose imports take long."""
    import fmpy

    return fmpy.read_model_description(str(path), validate=True, validate_variable_names=True)


def by_fmpy(path, kind, t1, output, count=40, **more):
    import fmpy

    rows = fmpy.simulate_fmu(
        str(path), fmi_type=kind, start_time=0.0, stop_time=t1, output_interval=t1 / count,
        relative_tolerance=1e-11, output=[*output, "mode", "events", "event_time"],
        record_events=False, **more,
    )  # fmt: skip
    return rows, np.stack([rows[name] for name in output], 1)


def by_simulate(system, y0, t1, mode0=None, args=None, count=40):
    ts = jnp.linspace(0.0, t1, count + 1)
    run = ss.simulate(
        system, 0.0, t1, y0, mode0, args, integrator=TIGHT, saveat=ss.SaveAt(ts=ts)
    )  # fmt: skip
    return run, np.stack(jax.tree.leaves(run.outputs.y), 1)


def step_by_step(system, y, t1, mode, count=40):
    rows = [jax.tree.leaves(y)]
    for i in range(count):
        run = ss.simulate(system, i * t1 / count, (i + 1) * t1 / count, y, mode, integrator=TIGHT)
        y, mode = run.y1, run.mode1
        rows.append(jax.tree.leaves(y))
    return np.asarray(rows)


CASES = {
    "block on belt": lambda: (
        (block := BlockOnBeltSetValued.constructed(k3=85.0)), block.state(), 4.0, None
    ),
    "oscillator": lambda: (
        CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2), Motion(x=0.0, v=0.2), 20.0, "stick"
    ),
    "bouncing ball": lambda: (BouncingBall(1.0, 9.81, 0.8), Motion(x=1.0, v=0.0), 2.1, None),
    "CoreXY": lambda: ((machine := cx.CoreXY(*cx.scenario(3))), machine.state(), 0.6, None),
}  # fmt: skip


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=pytest.mark.slow if c == "CoreXY" else pytest.mark.more) for c in CASES],
)
def test_a_machine_in_fmpy_moves_as_in_simulate(case, tmp_path):
    system, y0, t1, mode0 = CASES[case]()
    path = ss.export_fmu(system, y0, tmp_path / "a.fmu", mode0=mode0, integrator=TIGHT)
    assert {v.name for v in description(path).modelVariables} >= set(type(y0)._fields)
    run, expected = by_simulate(system, y0, t1, mode0)
    sizes = np.abs(expected).max(0)
    sizes[sizes == 0.0] = 1.0
    names = list(type(y0)._fields)
    # The same run in one go has other steps, and FMPy integrates with its own accuracy.
    for kind, close in (("CoSimulation", 5e-11), ("ModelExchange", 1e-6)):
        rows, found = by_fmpy(path, kind, t1, names)
        if kind == "CoSimulation":
            stepped = step_by_step(system, y0, t1, mode0)
            np.testing.assert_allclose(found / sizes, stepped / sizes, rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(found / sizes, expected / sizes, rtol=0.0, atol=close)
        np.testing.assert_array_equal(rows["mode"], run.outputs.mode)
        assert rows["events"][-1] == int(run.num_events) > 1
        last = float(run.events.t[int(run.num_events) - 1])
        np.testing.assert_allclose(rows["event_time"][-1], last, rtol=close)


@pytest.mark.more
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_inputs_parameters_and_start_values_are_those_of_the_tool(kicked, kind):
    """The force jumps in the middle: two runs of `simulate`, one after the other."""
    system, first, second = Kicked(2.0, 1.1), Force(0.3), Force(-0.4)
    start = Motion(x=0.5, v=0.1)
    before, rows_before = by_simulate(system, start, 4.0, args=first)
    after, rows_after = by_simulate(system, before.y1, 4.0, args=second)
    signal = np.array(
        [(0.0, 0.3), (4.0, 0.3), (4.0, -0.4), (9.0, -0.4)], [("time", float), ("args.force", float)]
    )
    values = {"system.stiffness": 2.0, "x": 0.5, "v": 0.1}
    rows, found = by_fmpy(kicked, kind, 8.0, ["x", "v"], 80, input=signal, start_values=values)
    close = 1e-12 if kind == "CoSimulation" else 1e-6
    np.testing.assert_allclose(found, [*rows_before, *rows_after[1:]], rtol=0.0, atol=close)
    events = int(before.num_events), int(after.num_events)
    assert min(events) > 1
    assert rows["events"][-1] == sum(events)


@pytest.fixture
def unit(kicked):
    """An instance for co-simulation, and the numbers of its variables."""
    import fmpy.fmi3

    about = description(kicked)
    slave = fmpy.fmi3.FMU3Slave(
        guid=about.guid, unzipDirectory=fmpy.extract(str(kicked)),
        modelIdentifier=about.coSimulation.modelIdentifier, instanceName="kicked",
    )  # fmt: skip
    slave.instantiate(loggingOn=True)
    yield slave, {v.name: v.valueReference for v in about.modelVariables}
    slave.freeInstance()


@pytest.mark.more
def test_a_tool_can_go_back(unit):
    """As those do that try a long step and then two short ones."""
    slave, number = unit
    slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    slave.doStep(0.0, 1.0)
    kept = slave.getFMUState()
    again = slave.deserializeFMUState(slave.serializeFMUState(kept))
    slave.doStep(1.0, 5.0)
    far = slave.getFloat64([number["x"], number["v"], number["power"], number["event_time"]])
    for state in (kept, again):
        slave.setFMUState(state)
        assert slave.getInt64([number["events"]]) == [0]
        slave.doStep(1.0, 5.0)
        values = slave.getFloat64([number["x"], number["v"], number["power"], number["event_time"]])
        assert list(values) == list(far)
    assert far[2] == 0.2 * far[1]


@pytest.mark.more
def test_a_start_without_a_mode_is_an_error_of_the_first_step(unit, capfd):
    """And never an exception in the library that calls the unit: it would end the process later."""
    slave, number = unit
    slave.enterInitializationMode(startTime=0.0)
    slave.setFloat64([number["x"]], [2.0])
    slave.exitInitializationMode()
    with pytest.raises(Exception, match=r"failed with status 3 \(error\)"):
        slave.doStep(0.0, 1.0)
    assert "no_admissible_mode at 0.0 s" in capfd.readouterr().out


@pytest.mark.more
def test_outputs_are_there_before_the_start_and_cannot_be_set(unit, capfd):
    slave, number = unit
    slave.enterInitializationMode(startTime=0.0)
    slave.setFloat64([number["v"], number["power"]], [0.5, 3.0])
    assert slave.getFloat64([number["power"], number["der(v)"]]) == [0.2 * 0.5, 0.2 - 1.0]
    assert "An output cannot be set" in capfd.readouterr().out


@pytest.mark.more
def test_in_model_exchange_such_a_start_ends_the_simulation(kicked):
    with pytest.raises(Exception, match="requested termination during initial event update"):
        by_fmpy(kicked, "ModelExchange", 1.0, ["x"], start_values={"x": 2.0})


class Swings(ss.AbstractSmoothSystem):
    """Three bodies on equal springs, with a state and arguments of any names."""

    rates: Any
    count: int

    def vector_field(self, t, y, mode, args):
        return {
            "x": y["speed of x"],
            "speed of x": args["it's"][0] * jnp.sin(t) - (self.rates @ self.rates) * y["x"],
        }


@pytest.mark.more
def test_a_smooth_system_of_arrays_and_any_names(tmp_path):
    swings, args = Swings(jnp.array([1.0, 2.0]), 3), {"it's": [0.3, 1j, 2], "none": None}
    y0 = {"x": jnp.array([1.0, 0.5, 0.1]), "speed of x": jnp.zeros(3)}
    path = ss.export_fmu(swings, y0, tmp_path / "swings.fmu", args=args)
    names = {variable.name for variable in description(path).modelVariables}
    assert {"x[2]", r"args.'it\'s'[0]", "system.rates[1]", "der('speed of x'[1])"} <= names
    rows, found = by_fmpy(path, "CoSimulation", 3.0, ["x[0]", "'speed of x'[2]"])
    end = ss.simulate(swings, 0.0, 3.0, y0, args=args).y1
    np.testing.assert_allclose(found[-1], [end["x"][0], end["speed of x"][2]], rtol=1e-9)
    assert rows["events"][-1] == 0


def test_what_a_unit_cannot_have_is_refused(tmp_path):
    path = tmp_path / "none.fmu"
    args = Force(0.2)
    with pytest.raises(ValueError, match=r"inputs = 'force': it must be among .*args.force"):
        ss.export_fmu(KICKED, START, path, args=args, inputs=["force"])
    with pytest.raises(ValueError, match=r"outputs = 'mode': it must be a name of its own"):
        ss.export_fmu(KICKED, START, path, args=args, outputs={"mode": lambda *_: 1.0})
    with pytest.raises(ValueError, match=r"outputs\['x2'\] = .*: it must be one number"):
        ss.export_fmu(KICKED, START, path, args=args, outputs={"x2": lambda *_: jnp.ones(2)})
    assert list(tmp_path.iterdir()) == []
