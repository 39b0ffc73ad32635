"""`simulate`: one machine, three ways to compute its motion."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

import stickslip as ss
from stickslip import RESULTS, Integrator, SaveAt
from stickslip.checks import (
    MOST,
    Numeric,
    as_float64,
    as_parameter,
    check_count,
    check_flag,
    check_in,
    check_type,
    one_concrete,
    one_number,
    refusal,
)
from stickslip.derived import Augmented, WithIntegrals
from stickslip.hybrid import (
    Executor,
    current_executor,
    jit_by_code,
    jit_plainly,
    raise_failures,
    use_executor,
)

from ._arguments import the_errata, the_integrator
from ._contacts import Line, kinetic_limits, sliding_speeds
from ._errata import Errata
from ._fixed_step import march
from ._modes import mode_dmn, mode_signs
from ._parameters import CoreXYParameters
from ._solution import Accelerations, CoreXYSolution, Ledger
from ._system import CoreXY, CoreXYState
from ._voltage import AbstractVoltage

MOTORS = ("motor_1", "motor_2")
METHODS = ("consistent", "as_printed", "smoothed")


def simulate(
    parameters: CoreXYParameters,
    voltage: AbstractVoltage,
    t1: Numeric = 6.0,
    *,
    method: str = "consistent",
    rows: int = 601,
    y0: CoreXYState | None = None,
    **options: Any,
) -> CoreXYSolution:
    """Motion of the machine from `t = 0` to `t1` [s].

    **Arguments**

    - `parameters`, `voltage`: e.g. `*scenario(1)`.
    - `method`: `"consistent"` (all contacts at once, event-driven; the default), `"as_printed"` (the
      paper's algorithm), `"smoothed"` (regularised friction).
    - `rows`: number of equally spaced output times, both ends included.
    - `y0`: initial state, `CoreXY.state(...)`; at rest at the origin if not given.
    - `options`: those of `simulate_consistent`, `simulate_as_printed` or `simulate_smoothed`.

    **Returns** a `CoreXYSolution`. **Raises** `ValueError`, `TypeError` for bad arguments, before
    compilation.
    """
    from ._smoothed import simulate_smoothed  # it builds on what this module offers

    check_in("method", method, METHODS)
    run = {
        "consistent": simulate_consistent,
        "as_printed": simulate_as_printed,
        "smoothed": simulate_smoothed,
    }[method]
    return run(parameters, voltage, t1, rows=rows, y0=y0, **options)


def prepared(parameters, voltage, t1, rows, y0):
    """The checked system, end, and initial state."""
    system, t1, y0 = checked(parameters, voltage, t1, rows, y0)
    return system, t1, system.state() if y0 is None else y0


def checked(parameters, voltage, t1, rows, y0):
    """The same, with no state for none that is given."""
    system = CoreXY(parameters, voltage)  # which checks them
    t1 = as_parameter(one_number("t1", t1, "positive"))
    check_count("rows", rows, 2)
    if y0 is not None:
        y0 = as_float64("y0", check_type("y0", y0, CoreXYState, "a CoreXYState"))
    return system, t1, y0


def motor_work(system: Any, t: Any, y: CoreXYState, mode: Any, args: Any) -> dict[str, Any]:
    """Power of both motors [W]."""
    one, two = system.torques(t, y)
    return dict(zip(MOTORS, (one * y.omega_1, two * y.omega_2), strict=True))


def simulate_consistent(
    parameters: CoreXYParameters,
    voltage: AbstractVoltage,
    t1: Numeric = 6.0,
    *,
    rows: int = 601,
    y0: CoreXYState | None = None,
    integrator: Integrator | None = None,
    max_events: int = 1024,
    throw: bool = True,
) -> CoreXYSolution:
    """Event-driven motion under the law of all contacts at once; exact derivatives.

    **Arguments** as for `simulate`, and: `integrator`, by default Dormand-Prince 8(5,3) with
    tolerance 1e-10; `max_events`, room in the log; `throw`, raise where the run fails, else say so in
    `result`. Friction losses follow from the log: within a mode every contact loses its kinetic
    friction times its path.
    """
    system, t1, y0 = checked(parameters, voltage, t1, rows, y0)
    the_integrator(integrator)
    check_count("max_events", max_events, 0)
    check_flag("throw", throw)
    given = system, t1, y0, rows, integrator, max_events, current_executor()
    found, fine = _consistent(*given)
    return raise_failures(found, fine) if throw else found


def _motion(system: CoreXY, t1, y0, rows: int, integrator, max_events, execute: Executor):
    """The solution, and whether the run reached its end; all that is computed, as one program."""
    if y0 is None:
        y0 = system.state()
    ledger = WithIntegrals(system, motor_work, units=dict.fromkeys(MOTORS, "J"))
    # As `ledger.start` would have it, which traces the integrands to know their names.
    start = Augmented(y0, dict.fromkeys(MOTORS, jnp.zeros(())))
    ts = jnp.linspace(0.0, 1.0, rows) * t1
    with use_executor(execute):
        solution = ss.simulate(
            ledger, 0.0, t1, start, integrator=integrator, saveat=SaveAt(ts=ts, max_events=max_events),
            throw=False,
        )  # fmt: skip
    return _from_engine(system, y0, solution), solution.successful


_consistent = jit_plainly(_motion)


def _from_engine(system: CoreXY, y0: CoreXYState, solution: ss.Solution) -> CoreXYSolution:
    log, outputs = solution.events, solution.outputs
    assert log is not None
    assert outputs is not None
    y, dy = outputs.y.y, outputs.dy.y
    senses = jnp.stack(mode_signs(jnp.maximum(outputs.mode, 0)), axis=-1)
    work = outputs.y.integrals
    friction, slip = _losses(system, y0, log, outputs.t, y, outputs.mode)
    ledger = Ledger(work["motor_1"], work["motor_2"], friction, slip)
    a = Accelerations(dy.vx, dy.vy, dy.omega_1, dy.omega_2)
    dmn = jnp.where(outputs.mode < 0, -1, mode_dmn(jnp.maximum(outputs.mode, 0)))
    return CoreXYSolution(
        system.parameters, system.voltage, outputs.t, y, a, dmn, senses, ledger,
        eqx.tree_at(lambda e: (e.y_before, e.y_after), log, (log.y_before.y, log.y_after.y)),
        solution.flags, solution.result, "consistent",
    )  # fmt: skip


def _paths(system: CoreXY, y: CoreXYState) -> jax.Array:
    """Sliding coordinate of every contact [m]; its rate is the sliding speed."""
    r = system.parameters.r
    return jnp.stack(sliding_speeds(Line(y.x, y.y, r * y.theta_1, r * y.theta_2)), axis=-1)


def _losses(system, y0, log, t, y, mode):
    """Friction energy and slip distances at the output times, from the log of events."""
    happened = jnp.arange(log.t.shape[0], dtype=jnp.int32) < log.count
    at_event = jnp.where(happened[:, None], _paths(system, log.y_before.y), 0.0)
    ends = jnp.concatenate([_paths(system, y0)[None], at_event])
    signs = jnp.stack(mode_signs(jnp.maximum(log.mode_before, 0)), axis=-1)
    lengths = jnp.where(happened[:, None], signs * jnp.diff(ends, axis=0), 0.0)
    until = jnp.concatenate([jnp.zeros((1, lengths.shape[1])), jnp.cumsum(lengths, axis=0)])
    times = jnp.where(happened, log.t, jnp.inf)
    last = jnp.searchsorted(jax.lax.stop_gradient(times), jax.lax.stop_gradient(t), side="right")
    since = jnp.stack(mode_signs(jnp.maximum(mode, 0)), axis=-1) * (_paths(system, y) - ends[last])
    length = until[last] + since
    return -jnp.stack(kinetic_limits(system.parameters))[None] * length, length[:, 6:]


def simulate_as_printed(
    parameters: CoreXYParameters,
    voltage: AbstractVoltage,
    t1: Numeric = 6.0,
    *,
    rows: int = 601,
    y0: CoreXYState | None = None,
    dt: float = 1e-4,
    errata: Errata | None = None,
) -> CoreXYSolution:
    """The paper's fixed-step algorithm with time step `dt` [s] (T = 1e-4 s in Table 1).

    In each step: the ideal acceleration and the friction that rolling needs (74)-(84), the dynamic
    model of the step (72), its accelerations with the dead zone of each axis at zero velocity
    (28)-(30), one explicit Euler step (the paper says "integrate"), the speeds after it (73).

    The paper leaves two things open. The state found with the numbers of a step, index k - 1 in Eq.
    (74), rules that step here; taken one step later, the first step would be one of RR, which kicks
    the machine out of its rest. And the dead zone of an axis is that of the contacts at rest, not of
    all contacts. `experiments/corexy/_runs.py` says which statements depend on it.

    **Arguments** as for `simulate`, and `errata`: which errata are corrected, none by default. `t1`
    must be a multiple of `dt` times `rows - 1`; `ValueError` otherwise.
    """
    system, _, y0 = prepared(parameters, voltage, t1, rows, y0)
    dt = float(one_concrete("dt", dt, "positive"))
    errata = the_errata(errata)
    one_concrete("t1", t1)
    end = float(t1)
    if end / dt > MOST:
        raise refusal("t1", end, f"at most {MOST} steps of dt = {dt}")
    stride = round(end / dt / (rows - 1))
    if stride < 1 or abs(stride * dt * (rows - 1) - end) > 1e-9 * end:
        raise refusal("t1", end, f"a multiple of dt * (rows - 1) = {dt * (rows - 1)}, dt = {dt}")
    steps = jnp.asarray(stride, jnp.int32)
    step = jnp.asarray(dt, jnp.float64)
    found = _march(system, y0, step, rows, steps, errata, current_executor())
    finite = jnp.all(jnp.isfinite(found.y.vx) & jnp.isfinite(found.y.vy))
    outcomes: Any = RESULTS
    result = outcomes.where(finite, RESULTS.successful, RESULTS.nonfinite)
    return CoreXYSolution(
        system.parameters, system.voltage, found.t, found.y, found.a, found.dmn, found.senses,
        found.ledger, None, jnp.zeros((), jnp.int32), result, "as_printed",
    )  # fmt: skip


@jit_by_code
def _march(system, y0, dt, rows: int, stride: jax.Array, errata: Errata, execute: Executor):
    return march(system.parameters, system.voltage, y0, dt, rows, stride, errata, execute)
