"""One lane of an orbit diagram: drop the transient, record points, say what became of it."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ..hybrid import RESULTS, Integrator, Section, simulate
from ._attractor import period_of
from ._observable import InArgs, Observable, OverArgs

# What became of a lane: ours first, then the engine's.
STATUS = (
    "ok",
    "left_domain",
    "no_crossing",
    "buffer_full",
    "max_steps_reached",
    "dt_min_reached",
    "chattering",
    "no_admissible_mode",
    "nonfinite",
    "other_failure",
)
_ENGINE = STATUS[4:-1]


class Plan(NamedTuple):
    """All that the lanes of a diagram have in common."""

    build: Callable  # system of a point of the grid
    section: Section  # over args = (system, args)
    observables: dict[str, Observable]
    domain: tuple[Observable, ...]
    settles: bool  # whether a transient is dropped
    size: int  # points recorded at most
    stops: bool  # whether a full record is the end, not a failure
    mode0: Any
    args: PyTree
    period_tolerance: float
    max_period: int


class Numbers(NamedTuple):
    """What may differ between two runs of one compiled program."""

    t0: Any
    transient: Any
    duration: Any
    step: Any  # step-size rule of the integrator, with `None` for all that is not a number


def run_lane(plan: Plan, integrator: Integrator, numbers: Numbers, y0: PyTree, point: dict[str, Any]):
    """End state, and the results of the lane by name."""
    step = eqx.combine(numbers.step, integrator.step)
    integrator = eqx.tree_at(lambda i: i.step, integrator, step)
    inner = plan.build(point)
    system, args = InArgs(inner), (inner, plan.args)  # pyright: ignore[reportCallIssue]
    start = jnp.asarray(numbers.t0, jnp.float64)
    begin = start + numbers.transient
    y0 = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y0)
    mode = system.initial_mode(start, y0, args) if plan.mode0 is None else plan.mode0
    borders = tuple(Section(OverArgs(f), "falling", terminal=True) for f in plan.domain)
    inside = jnp.ones((), bool)
    if plan.domain:
        slope = system.vector_field(start, y0, mode, args)
        for f in plan.domain:
            # A terminal section sees crossings only, not a start on the wrong side.
            inside &= f(inner, start, y0, slope, mode, plan.args) >= 0
    options: dict[str, Any] = {"integrator": integrator, "max_events": None, "throw": False}
    early = jnp.zeros((), jnp.int32)
    y = y0
    if plan.settles:
        settled = simulate(
            system, start, jnp.where(inside, begin, start), y0, mode, args, sections=borders, **options
        )
        y, mode, early = settled.y1, settled.mode1, engine_status(settled.result)
    early = jnp.where(inside, early, STATUS.index("left_domain"))
    going = early == 0
    recorded = simulate(
        system, begin, jnp.where(going, begin + numbers.duration, begin), y, mode, args,
        sections=(plan.section, *borders), max_crossings=plan.size, **options,
    )  # fmt: skip
    rows = recorded.crossings[0]
    valid = jnp.arange(plan.size, dtype=rows.count.dtype) < rows.count

    def values(f):
        seen = jax.vmap(lambda t, y, dy, m: f(inner, t, y, dy, m, plan.args))(
            rows.t, rows.y, rows.dy, rows.mode
        )
        return jnp.where(valid, seen, jnp.nan)

    points = {name: values(f) for name, f in plan.observables.items()}
    late = engine_status(recorded.result)
    full = recorded.result == RESULTS.max_crossings_reached
    late = jnp.where(full, 0 if plan.stops else STATUS.index("buffer_full"), late)
    late = jnp.where((late == 0) & (rows.count == 0), STATUS.index("no_crossing"), late)
    status = jnp.where(going, late, early).astype(jnp.int32)
    count = jnp.where(going, rows.count, 0).astype(jnp.int32)
    seen = jnp.stack([v for name, v in points.items() if name != "t"] or list(points.values()), axis=1)
    period, slow = period_of(seen, count, tolerance=plan.period_tolerance, max_period=plan.max_period)
    usable = (status == 0) | (status == STATUS.index("buffer_full"))
    results = {
        **points,
        "count": count,
        "status": status,
        "period": jnp.where(usable, period, 0).astype(jnp.int32),
        "slow_transient": usable & slow,
    }
    # A lane that failed has nothing to hand on.
    end = jax.tree.map(lambda a, b: jnp.where(usable & jnp.isfinite(a), a, b), recorded.y1, y0)
    return end, results


def engine_status(result: RESULTS) -> Any:  # pyright: ignore[reportInvalidTypeForm]
    """Index in `STATUS` of the engine's result code."""
    status = jnp.asarray(STATUS.index("other_failure"), jnp.int32)
    for name in ("successful", "event_occurred", *_ENGINE):
        number = {"successful": 0, "event_occurred": STATUS.index("left_domain")}.get(name)
        number = STATUS.index(name) if number is None else number
        status = jnp.where(result == getattr(RESULTS, name), number, status)
    return status


def halved(integrator: Integrator) -> Integrator:
    """The integrator to check another with: half the step, or a 32nd of the tolerances."""
    step: Any = integrator.step
    if step.adaptive:
        finer = jax.tree.map(lambda tolerance: tolerance / 32, (step.rtol, step.atol))
        step = eqx.tree_at(lambda s: (s.rtol, s.atol), step, finer, is_leaf=lambda a: a is None)
    else:
        step = eqx.tree_at(lambda s: s.h, step, step.h / 2)
    return eqx.tree_at(lambda i: i.step, integrator, step)
