"""One lane of an orbit diagram: drop the transient, record points, say how it ended."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from ..hybrid import (
    RESULTS,
    AbstractHybridSystem,
    Integrator,
    SaveAt,
    Section,
    Solution,
    simulate,
)
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._attractor import CANNOT_TELL, PERIOD_STATUS, period_of
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
    "at_rest",
)
_ENGINE = STATUS[4:9]
# Lanes whose points are those of the motion, though there may be more or the first are too early.
USABLE = ("ok", "buffer_full", "not_settled", "fewer_points", "too_few_points")
# Fractions of the recorded time at which the motion is sampled for its size. Uneven, so that no period
# of the motion is hit at one phase all the time; dense at the beginning, which is all there is where a
# lane stops after so many points.
SAMPLES = ((np.arange(24) + 1.0) / 24) ** 3


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
    lane = _lane_at(plan, integrator, numbers, y0, point)
    y, mode, early, flags = _after_transient(plan, lane)
    going = early == 0
    recorded = _recorded_run(plan, lane, y, mode, jnp.where(going, numbers.duration, 0.0))
    logs, samples = recorded.crossings[: len(plan.sections)], recorded.outputs
    most = functools.reduce(jnp.maximum, [rows.count for rows in logs])
    late = _status_of_record(plan, recorded, most)
    status = jnp.where(going, late, early).astype(jnp.int32)
    usable = _is_one_of(status, USABLE[:2])
    failed = ~(usable | (status == STATUS.index("no_crossing")))
    judged = _judged_observables(plan, lane, samples)
    rests = (usable | (status == STATUS.index("no_crossing"))) & _rests(plan, lane, recorded)
    parts, verdicts = zip(
        *(_points_of(plan, lane, judged, rows, going, (failed, rests)) for rows in logs), strict=True
    )
    results = jax.tree.map(lambda *rows: jnp.stack(rows), *parts) if plan.several else parts[0]
    slow = usable & _any_of([verdict.slow for verdict in verdicts])
    sound = usable | (status == STATUS.index("no_crossing"))
    status = _status_by_points(plan, status, jnp.where(going, most, 0), slow, verdicts)
    status = jnp.where(rests & (status != STATUS.index("buffer_full")), STATUS.index("at_rest"), status)
    results |= {
        "status": status.astype(jnp.int32),
        "slow_transient": slow,
        "flags": flags | recorded.flags,
    }
    # A lane that failed has nothing to hand on; one that never crossed its section ends somewhere too.
    end = jax.tree.map(lambda a, b: jnp.where(sound & jnp.isfinite(a), a, b), recorded.y1, lane.y0)
    return end, results


class _Lane(NamedTuple):
    """A lane before it runs."""

    system: AbstractHybridSystem
    args: PyTree
    start: Any  # time at the start
    begin: Any  # time at which the record begins
    y0: PyTree
    mode: Any
    borders: tuple[Section, ...]  # of the domain
    inside: Any  # whether the start lies in the domain
    options: dict[str, Any]  # of `simulate`

    def values(self, f: Observable, log: Any) -> Any:
        """Observable over the rows of a log, NaN past its count."""
        seen = jax.vmap(lambda t, y, dy, m: f(self.system, t, y, dy, m, self.args))(
            log.t, log.y, log.dy, log.mode
        )
        kept = jnp.arange(log.t.size, dtype=log.count.dtype) < log.count
        return jnp.where(kept.reshape(-1, *(1,) * (seen.ndim - 1)), seen, jnp.nan)


def _lane_at(plan: OrbitPlan, integrator: Integrator, numbers: Numbers, y0: PyTree, point) -> _Lane:
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
    options = {"integrator": integrator, "throw": False}
    return _Lane(system, args, start, begin, y0, mode, borders, inside, options)


def _after_transient(plan: OrbitPlan, lane: _Lane) -> tuple[PyTree, Any, Any, Any]:
    """State, mode, status and flags once the transient is dropped."""
    early, flags = jnp.zeros((), jnp.int32), jnp.zeros((), jnp.int32)
    y, mode = lane.y0, lane.mode
    if plan.settles:
        end = jnp.where(lane.inside, lane.begin, lane.start)
        settled = simulate(
            lane.system, lane.start, end, y, mode, lane.args,
            saveat=SaveAt(sections=lane.borders, max_events=None), **lane.options,
        )  # fmt: skip
        y, mode, early = settled.y1, settled.mode1, engine_status(settled.result)
        flags = settled.flags
    return y, mode, jnp.where(lane.inside, early, STATUS.index("left_domain")), flags


def _recorded_run(plan: OrbitPlan, lane: _Lane, y: PyTree, mode: Any, length: Any) -> Solution:
    """The motion after the transient, with the crossings of the sections and samples for its size."""
    return simulate(
        lane.system, lane.begin, lane.begin + length, y, mode, lane.args,
        saveat=SaveAt(
            ts=lane.begin + length * SAMPLES, sections=(*plan.sections.values(), *lane.borders),
            max_events=None, max_crossings=plan.size,
        ),
        **lane.options,
    )  # fmt: skip


def _status_of_record(plan: OrbitPlan, recorded: Solution, most: Any) -> Any:
    """Status by how the record ended, and by the `most` points of a section."""
    status = engine_status(recorded.result)
    full = recorded.result == RESULTS.max_crossings_reached
    status = jnp.where(full, 0 if plan.stops else STATUS.index("buffer_full"), status)
    return jnp.where((status == 0) & (most == 0), STATUS.index("no_crossing"), status)


def _rests(plan: OrbitPlan, lane: _Lane, recorded: Solution) -> Any:
    """Whether the whole state keeps its place, to the tolerance, over the last quarter of the record.

    To rounding where it is no more than that of the start, or of the way that its first slope leads.
    """
    logs = [recorded.outputs, *recorded.crossings[: len(plan.sections)]]
    late_from = recorded.t1 - 0.25 * (recorded.t1 - lane.begin)
    kept = [jnp.isfinite(log.t) for log in logs]
    # Where the last quarter has no two samples, as after few points, all has to keep its place.
    few = jnp.sum(logs[0].t >= late_from) <= 1
    late = [rows & (few | (log.t >= late_from)) for log, rows in zip(logs, kept, strict=True)]
    slope = lane.system.vector_field(lane.start, lane.y0, lane.mode, lane.args)
    still = jnp.ones((), bool)
    leaves = (jax.tree.leaves(tree) for tree in (lane.y0, slope, *(log.y for log in logs)))
    for begun, rate, *rows in zip(*leaves, strict=True):
        begun, way = jnp.abs(jnp.ravel(begun)), jnp.ravel(rate) * (recorded.t1 - lane.start)
        columns = [row.reshape(row.shape[0], -1) for row in rows]
        low, high = _ends(columns, kept)
        least, most = _ends(columns, late)
        largest = jnp.maximum(jnp.maximum(jnp.abs(low), jnp.abs(high)), begun)
        rounding = ENGINE.some_roundings * jnp.maximum(largest, jnp.abs(way))
        still &= jnp.all(most - least <= jnp.maximum(plan.period.tolerance * (high - low), rounding))
    return still


def _ends(columns: list[Any], chosen: list[Any]) -> tuple[Any, Any]:
    """Least and greatest number of each column over the chosen rows of several tables."""
    both = [*zip(columns, chosen, strict=True)]
    low = [jnp.min(jnp.where(rows[:, None], x, jnp.inf), axis=0) for x, rows in both]
    high = [jnp.max(jnp.where(rows[:, None], x, -jnp.inf), axis=0) for x, rows in both]
    return functools.reduce(jnp.minimum, low), functools.reduce(jnp.maximum, high)


class _Judged(NamedTuple):
    """Observables by which points are compared, whole turns left in, and how far the motion goes."""

    names: list[str]
    observables: list[Observable]
    whole: list[Observable]
    begun: list[Any]  # at the start
    turns: tuple  # period of each number, or None
    span: Any  # least and greatest over the samples
    samples: Any  # how many there are


def _judged_observables(plan: OrbitPlan, lane: _Lane, samples: Any) -> _Judged:
    # Time never repeats: it has no say in the period unless it is all there is.
    names = [name for name in plan.observables if name != "t"] or list(plan.observables)
    found = [plan.observables[name] for name in names]
    # Whole turns of a motion that goes round are left out by the judge, which knows how far it goes.
    functions = [whole_of(f) for f in found]
    system, start, y0, mode, args = lane.system, lane.start, lane.y0, lane.mode, lane.args
    slope = system.vector_field(start, y0, mode, args)
    begun = [jnp.asarray(f(system, start, y0, slope, mode, args), jnp.float64) for f in functions]
    # Each number of an array is judged by itself.
    turns = tuple(
        f.period if isinstance(f, Angle) else None
        for f, at_start in zip(found, begun, strict=True)
        for _ in range(at_start.size)
    )
    span = _span(_columns([lane.values(f, samples) for f in functions]), samples.count)
    return _Judged(names, found, functions, begun, turns, span, samples.count)


class _Verdict(NamedTuple):
    """Verdict on the points of a section."""

    slow: Any
    told: Any  # whether it says something on the period
    still: Any  # whether the points still come nearer to something
    undecided: Any  # whether they are too few


def _points_of(
    plan: OrbitPlan, lane: _Lane, judged: _Judged, rows: Any, going: Any, fate: tuple[Any, Any]
) -> tuple[dict[str, Any], _Verdict]:
    """Points of a section with their number and period, and the verdict on them.

    `fate`: whether the lane failed, and whether it comes to rest.
    """
    failed, rests = fate
    points = {name: lane.values(f, rows) for name, f in plan.observables.items()}
    count = jnp.where(going, rows.count, 0).astype(jnp.int32)
    seen = [
        lane.values(whole, rows) if isinstance(f, Angle) else points[name]
        for name, f, whole in zip(judged.names, judged.observables, judged.whole, strict=True)
    ]
    columns = _columns(seen)
    verdict = period_of(
        columns,
        count,
        judged.span,
        tolerance=plan.period.tolerance,
        max_period=plan.period.longest,
        periods=judged.turns if any(judged.turns) else None,
        start=jnp.concatenate([a.reshape(-1) for a in judged.begun]),
    )
    # So few samples of the motion do not give its size, which the tolerance refers to.
    few = PERIOD_STATUS.index("too_few_points")
    status = jnp.where(judged.samples < ACCURACY.fewest_samples, few, verdict.status)
    status = jnp.where(rests, PERIOD_STATUS.index("constant"), status)
    status = jnp.where(failed, PERIOD_STATUS.index("lane_failed"), status)
    told = status <= PERIOD_STATUS.index("none")
    # Points that agree are those of the motion, however few they are.
    ends = _span(columns, count)
    spread = jnp.ptp(ends, axis=0)
    size = jnp.maximum(jnp.ptp(judged.span, axis=0), spread)
    rounding = ENGINE.some_roundings * jnp.max(jnp.abs(ends), axis=0)
    apart = jnp.any(spread > plan.period.tolerance * size + rounding)
    results = {
        **points,
        "count": count,
        "period": jnp.where(told, verdict.period, CANNOT_TELL).astype(jnp.int32),
        "period_status": status.astype(jnp.int32),
    }
    still = status == PERIOD_STATUS.index("not_settled")
    return results, _Verdict(verdict.slow, told, still, (status == few) & apart)


def _status_by_points(plan: OrbitPlan, status: Any, most: Any, slow: Any, verdicts: tuple) -> Any:
    """Status of a lane whose run succeeded, by the verdicts on its sections."""
    short = (most < plan.size) if plan.stops else jnp.zeros((), bool)
    status = jnp.where((status == 0) & short, STATUS.index("fewer_points"), status)
    # One section whose points tell is enough: the others are of the same motion.
    untold = (status == 0) & ~_any_of([verdict.told for verdict in verdicts])
    if plan.settles:
        still = _any_of([verdict.still for verdict in verdicts])
        unsettled = ((status == 0) & slow) | (untold & still)
        status = jnp.where(unsettled, STATUS.index("not_settled"), status)
    few = (status == 0) & untold & _any_of([verdict.undecided for verdict in verdicts])
    return jnp.where(few, STATUS.index("too_few_points"), status)


def _any_of(flags: list) -> Any:
    return functools.reduce(jnp.logical_or, flags)


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
