"""One lane of an orbit diagram: drop the transient, record points, say how it ended."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from ..hybrid import RESULTS, Integrator, SaveAt, Section, simulate
from ._attractor import CANNOT_TELL, PERIOD_STATUS, ROUNDING, period_of
from ._recording import PeriodTest
from .observable import Angle, Observable, whole_of

# Fates of a lane. New words go to the end: stored numbers keep their meaning.
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
    "not_settled",
    "fewer_points",
    "too_few_points",
)
_ENGINE = STATUS[4:9]
# Lanes whose points are those of the motion, though there may be more or the first are too early.
USABLE = ("ok", "buffer_full", "not_settled", "fewer_points", "too_few_points")
# Fractions of the recorded time at which the motion is sampled for its size. Uneven, so that no period
# of the motion is hit at one phase all the time; dense at the beginning, which is all there is where a
# lane stops after so many points.
SAMPLES = ((np.arange(24) + 1.0) / 24) ** 3
FEWEST_SAMPLES = 8


class OrbitPlan(NamedTuple):
    """All that the lanes of a diagram have in common."""

    build: Callable  # system of a point of the grid
    sections: dict[str, Section]
    several: bool  # whether results are given by section
    observables: dict[str, Observable]
    domain: tuple[Observable, ...]
    settles: bool  # whether a transient is dropped
    size: int  # points recorded at most
    stops: bool  # whether a full record is the end, not a failure
    mode0: Any
    args: PyTree
    period: PeriodTest


class Numbers(NamedTuple):
    """Numbers that may differ between two runs of one compiled program."""

    t0: Any
    transient: Any
    duration: Any
    step: Any  # step-size rule of the integrator, with `None` for all that is not a number


def run_lane(
    plan: OrbitPlan, integrator: Integrator, numbers: Numbers, y0: PyTree, point: dict[str, Any]
):
    """End state, and the results of the lane by name."""
    step = eqx.combine(numbers.step, integrator.step)
    integrator = eqx.tree_at(lambda i: i.step, integrator, step)
    system, args = plan.build(point), plan.args
    start = jnp.asarray(numbers.t0, jnp.float64)
    begin = start + numbers.transient
    y0 = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y0)
    mode = system.initial_mode(start, y0, args) if plan.mode0 is None else plan.mode0
    borders = tuple(Section(f, "falling", terminal=True) for f in plan.domain)
    inside = jnp.ones((), bool)
    if plan.domain:
        slope = system.vector_field(start, y0, mode, args)
        for f in plan.domain:
            # A terminal section sees crossings only, not a start on the wrong side.
            inside &= f(system, start, y0, slope, mode, args) >= 0
    options: dict[str, Any] = {"integrator": integrator, "throw": False}
    early, flags = jnp.zeros((), jnp.int32), jnp.zeros((), jnp.int32)
    y, first_mode = y0, mode
    if plan.settles:
        settled = simulate(
            system, start, jnp.where(inside, begin, start), y0, mode, args,
            saveat=SaveAt(sections=borders, max_events=None), **options,
        )  # fmt: skip
        y, mode, early = settled.y1, settled.mode1, engine_status(settled.result)
        flags = settled.flags
    early = jnp.where(inside, early, STATUS.index("left_domain"))
    going = early == 0
    length = jnp.where(going, numbers.duration, 0.0)
    recorded = simulate(
        system, begin, begin + length, y, mode, args,
        saveat=SaveAt(
            ts=begin + length * SAMPLES, sections=(*plan.sections.values(), *borders),
            max_events=None, max_crossings=plan.size,
        ),
        **options,
    )  # fmt: skip
    logs, samples = recorded.crossings[: len(plan.sections)], recorded.outputs
    assert samples is not None

    def values(f, log):
        """Observable over the rows of a log, NaN past its count."""
        seen = jax.vmap(lambda t, y, dy, m: f(system, t, y, dy, m, args))(
            log.t, log.y, log.dy, log.mode
        )
        kept = jnp.arange(log.t.size, dtype=log.count.dtype) < log.count
        return jnp.where(kept.reshape(-1, *(1,) * (seen.ndim - 1)), seen, jnp.nan)

    late = engine_status(recorded.result)
    full = recorded.result == RESULTS.max_crossings_reached
    late = jnp.where(full, 0 if plan.stops else STATUS.index("buffer_full"), late)
    most = functools.reduce(jnp.maximum, [rows.count for rows in logs])
    late = jnp.where((late == 0) & (most == 0), STATUS.index("no_crossing"), late)
    status = jnp.where(going, late, early).astype(jnp.int32)
    usable = _is_one_of(status, USABLE[:2])
    failed = ~(usable | (status == STATUS.index("no_crossing")))
    # Time never repeats: it has no say in the period unless it is all there is.
    judged = [name for name in plan.observables if name != "t"] or list(plan.observables)
    found = [plan.observables[name] for name in judged]
    # Of what goes round, whole turns are left out by the judge, which knows how far the motion goes.
    functions = [whole_of(f) for f in found]
    slope0 = system.vector_field(start, y0, first_mode, args)
    begun = [
        jnp.asarray(f(system, start, y0, slope0, first_mode, args), jnp.float64) for f in functions
    ]
    # Each number of an array is judged by itself.
    turns = tuple(
        f.period if isinstance(f, Angle) else None
        for f, at_start in zip(found, begun, strict=True)
        for _ in range(at_start.size)
    )
    span = _span(_columns([values(f, samples) for f in functions]), samples.count)

    def of_section(rows):
        """Points, their number, and the verdict on them."""
        points = {name: values(f, rows) for name, f in plan.observables.items()}
        count = jnp.where(going, rows.count, 0).astype(jnp.int32)
        seen = [
            values(whole, rows) if isinstance(f, Angle) else points[name]
            for name, f, whole in zip(judged, found, functions, strict=True)
        ]
        columns = _columns(seen)
        verdict = period_of(
            columns,
            count,
            span,
            tolerance=plan.period.tolerance,
            max_period=plan.period.longest,
            periods=turns if any(turns) else None,
            start=jnp.concatenate([a.reshape(-1) for a in begun]),
        )
        # So few samples of the motion do not give its size, which the tolerance refers to.
        judged_by = jnp.where(
            samples.count < FEWEST_SAMPLES, PERIOD_STATUS.index("too_few_points"), verdict.status
        )
        judged_by = jnp.where(failed, PERIOD_STATUS.index("lane_failed"), judged_by)
        told = judged_by <= PERIOD_STATUS.index("none")
        # Points that agree are those of the motion, however few they are.
        ends = _span(columns, count)
        spread = jnp.ptp(ends, axis=0)
        size = jnp.maximum(jnp.ptp(span, axis=0), spread)
        rounding = ROUNDING * jnp.max(jnp.abs(ends), axis=0)
        apart = jnp.any(spread > plan.period.tolerance * size + rounding)
        results = {
            **points,
            "count": count,
            "period": jnp.where(told, verdict.period, CANNOT_TELL).astype(jnp.int32),
            "period_status": judged_by.astype(jnp.int32),
        }
        still = judged_by == PERIOD_STATUS.index("not_settled")
        undecided = (judged_by == PERIOD_STATUS.index("too_few_points")) & apart
        return results, verdict.slow, told, still, undecided

    parts, slows, tolds, stills, short_ones = zip(*map(of_section, logs), strict=True)
    results = jax.tree.map(lambda *rows: jnp.stack(rows), *parts) if plan.several else parts[0]
    any_of = functools.partial(functools.reduce, jnp.logical_or)
    slow = usable & any_of(slows)
    most = jnp.where(going, most, 0)
    short = (most < plan.size) if plan.stops else jnp.zeros((), bool)
    status = jnp.where((status == 0) & short, STATUS.index("fewer_points"), status)
    # One section whose points tell is enough: the others are of the same motion.
    untold = (status == 0) & ~any_of(tolds)
    if plan.settles:
        unsettled = ((status == 0) & slow) | (untold & any_of(stills))
        status = jnp.where(unsettled, STATUS.index("not_settled"), status)
    few = (status == 0) & untold & any_of(short_ones)
    status = jnp.where(few, STATUS.index("too_few_points"), status)
    results |= {
        "status": status.astype(jnp.int32),
        "slow_transient": slow,
        "flags": flags | recorded.flags,
    }
    # A lane that failed has nothing to hand on; one that never crossed its section ends somewhere too.
    sound = usable | (status == STATUS.index("no_crossing"))
    end = jax.tree.map(lambda a, b: jnp.where(sound & jnp.isfinite(a), a, b), recorded.y1, y0)
    return end, results


def _columns(seen):
    """Observables side by side: a column for each number of each."""
    return jnp.concatenate([a.reshape(a.shape[0], -1) for a in seen], axis=1)


def _span(seen, count):
    """Least and greatest of each observable over the rows in use; NaN where one is NaN."""
    valid = (jnp.arange(seen.shape[0], dtype=count.dtype) < count)[:, None]
    low = jnp.min(jnp.where(valid, seen, jnp.inf), axis=0)
    high = jnp.max(jnp.where(valid, seen, -jnp.inf), axis=0)
    # Without samples the points alone say how far the motion goes.
    none = count == 0
    return jnp.stack([jnp.where(none, 0.0, low), jnp.where(none, 0.0, high)])


def _is_one_of(status, words):
    return jnp.any(jnp.stack([status == STATUS.index(word) for word in words]), axis=0)


def engine_status(result: RESULTS) -> Any:  # pyright: ignore[reportInvalidTypeForm]
    """Index in `STATUS` of the engine's result code."""
    status = jnp.asarray(STATUS.index("other_failure"), jnp.int32)
    for name in ("successful", "event_occurred", *_ENGINE):
        number = {"successful": 0, "event_occurred": STATUS.index("left_domain")}.get(name)
        number = STATUS.index(name) if number is None else number
        status = jnp.where(result == getattr(RESULTS, name), number, status)
    return status


def finer_integrator(integrator: Integrator) -> Integrator:
    """The integrator to check another with: half the step, or a 32nd of the tolerances."""
    step: Any = integrator.step
    if step.adaptive:
        finer = jax.tree.map(lambda tolerance: tolerance / 32, (step.rtol, step.atol))
        step = eqx.tree_at(lambda s: (s.rtol, s.atol), step, finer, is_leaf=lambda a: a is None)
    else:
        step = eqx.tree_at(lambda s: s.h, step, step.h / 2)
    return eqx.tree_at(lambda i: i.step, integrator, step)
