"""`periodic_orbit`: from a guess to a periodic orbit, by Newton's method through all events."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from .._types import Given, Numeric
from .._validation import as_parameter, check_count, check_type, is_concrete, one_number, refusal
from ..analysis import divergence
from ..analysis.held_directions import held_directions
from ..analysis.neutral_directions import projection_on
from ..derived import WithIntegrals
from ..hybrid import (
    AbstractHybridSystem,
    SaveAt,
    current_executor,
    jit_plainly,
    simulate,
    use_executor,
)
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import a_time, check_field, start_of, the_system
from ..hybrid.longest_step import spanning
from ..hybrid.tree import with_float_arrays
from ._accuracy import ACCURACY
from ._beginning import beside_breaks
from ._closing import (
    Extent,
    Frame,
    Motion,
    Sampled,
    check_autonomous,
    closure,
    equations,
    extent,
    in_units,
    plane_across,
    samples_of,
    states_and_period,
    unknowns,
)
from ._extremes import ROWS, run_with_extremes
from ._floquet import multipliers_of, split_off, with_ones
from ._guess import OrbitGuess, check_seen, gained_by
from ._holding import holds, own_mode
from ._monodromy import through_events
from ._newton import Newton, damped_newton
from ._options import SHOOTING, Shooting
from ._orbit import PeriodicOrbit
from ._outcome import first_of
from ._settling import settles
from ._turns import apart, turns_of, without


def periodic_orbit(
    system: Given[AbstractHybridSystem],
    guess: Given[OrbitGuess | PeriodicOrbit],
    *,
    forced: Given[bool] = False,
    shooting: Given[Shooting] = SHOOTING,
    tolerance: Numeric = 1e-12,
    max_steps: Given[int] = 25,
    args: PyTree = None,
) -> PeriodicOrbit:
    r"""Periodic orbit near a guess, with Floquet multipliers; the mode sequence is found, not given.

    Solves $\varphi_T(y_0) = y_0$, where $\varphi$ is the motion as `simulate` computes it with all its
    events, by Newton's method; the Jacobian is exact (forward mode through the events). Without forcing
    the period $T$ is an unknown too, and $y_0$ is looked for in the plane through the guess that is
    perpendicular to the motion there, or at the guess's angle where angles go round. Sticks, slips and
    impacts may appear and vanish while Newton's method runs. Where a stick takes directions
    away the return map has lower rank; nothing has to be done about it.

    **Arguments**

    - `system`, `args`: as for `simulate`.
    - `guess`: an `OrbitGuess` (of `orbit_guess`, from a simulation, or by hand), or another
      `PeriodicOrbit`: of other parameters, or from a file.
    - `forced`: whether the system depends on the time itself, periodically: then the period of the
      guess is that of the forcing, or a multiple of it, and is kept.
    - `shooting`: a `Shooting`. An orbit that is too unstable to be simulated to a hundredth of its
      size, with multipliers above some 1e9, is `not_reproduced`, with however many `segments`.
    - `tolerance`: of the residual, in parts of the motion's size; more where the rounding of `t0`, in
      parts of the period, is. `max_steps`: evaluations of the return map.

    **Returns** a `PeriodicOrbit`; `result` says, also under `jit`, `vmap` and `map_lanes`, whether it
    is one. The orbit was simulated once more from a state on it, in the mode that the system itself
    gives to this state; one that does not return is not `successful`. Neither derivatives of the
    result nor second derivatives of the motion exist.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation; also for a system that
    depends on the time without `forced`: what returns after any time else is not periodic.

    Where a shift of the state changes nothing, as that of a body on the ground which no spring holds,
    each orbit is one of a family. Its place is then that of the guess, and it need not close along the
    shift: `drift` says by how much it moves on, as of a motion whose place is `cyclic`. Of a motion of
    unknown period that only turns, evenly, the period is that of the turn.
    """
    the_system(system)
    check_type("guess", guess, OrbitGuess | PeriodicOrbit, "an OrbitGuess or a PeriodicOrbit")
    if not isinstance(forced, bool):
        raise refusal("forced", forced, "True or False", TypeError)
    check_type("shooting", shooting, Shooting, "a Shooting")
    one_number("tolerance", tolerance, "positive")
    check_count("max_steps", max_steps, 1)
    t0 = a_time("guess.t0", guess.t0)
    check_seen("guess", guess)
    period = as_parameter(one_number("guess.period", guess.period, "positive"))
    y0, mode0 = start_of(system, t0, guess.y0, guess.mode0, args)
    system, args = with_float_arrays((system, args))
    numbers = y0, mode0, t0, period, gained_by(system, guess), as_parameter(tolerance)
    program = _compiled if is_concrete((system, args, numbers)) else _orbit
    return program(
        system, args, shooting.integrator_or(), current_executor(), *numbers, forced=forced,
        segments=shooting.segments, max_steps=max_steps, max_events=shooting.max_events,
    )  # fmt: skip


def _orbit(
    system, args, integrator, execute, y0, mode0, t0, period, gained, tolerance,
    *, forced, segments, max_steps, max_events,
):  # fmt: skip
    # Here, where the program is traced: the checks trace the field and its guards, too.
    check_field(system, t0, y0, mode0, args)
    if not forced:
        check_autonomous("forced", system, t0, y0, mode0, args, "True")
    _, unravel = ravel_pytree(y0)
    with use_executor(execute):
        t0, y0, mode0 = beside_breaks(system, args, spanning(integrator, period), t0, y0, mode0)
        # No orbit closes to less than the rounding of the time, a part of the period.
        tolerance = jnp.maximum(tolerance, ENGINE.some_roundings * jnp.abs(t0) / period)
        motion = Motion(system, args, spanning(integrator, period))
        solved = solve_orbit(
            motion, samples_of(motion, y0, mode0, t0, period, segments), t0, period, gained, tolerance,
            forced=forced, segments=segments, max_steps=max_steps,
        )  # fmt: skip
        motion, frame, found, modes = solved
        rests = settles(motion, frame, found, unravel, modes[0]) if frame.free else False
        return describe_orbit(
            motion, frame, found, tolerance, unravel, modes[0], segments, max_events, rests
        )


class Solved(NamedTuple):
    """Where Newton's method ended, with what it solved; `modes`: at the knots of the guess."""

    motion: Motion
    frame: Frame
    found: Newton
    modes: Any


def solve_orbit(
    motion: Motion, run: Sampled, t0, period, gained, tolerance, *, forced, segments, max_steps,
    shifts=True,
) -> Solved:  # fmt: skip
    """Newton's method to the equations of an orbit, from a simulation of one period.

    `shifts`: whether those of the state that change nothing keep the place of the guess; otherwise what
    the motion conserves does.
    """
    y0, mode0, unravel = run.y0, run.mode0, ravel_pytree(run.y0)[1]
    reach = extent(motion, run, t0, period, segments, not forced, gained)
    reach = reach if shifts else reach._replace(shifts=jnp.zeros_like(reach.shifts))
    frame = _frame(motion, y0, mode0, t0, period, reach, forced)

    def evaluate(u, modes):
        def found_from(u):
            return closure(u, modes, motion, frame, unravel)

        residual, jacobian, found = equations(found_from, u, frame, segments)
        norm = jnp.max(jnp.abs(residual))
        good = jnp.all(found.good) & jnp.isfinite(norm)
        after = jnp.roll(found.modes, 1).at[0].set(modes[0])
        return residual, jacobian, jnp.where(good, norm, jnp.inf), after, found

    found = damped_newton(
        evaluate, unknowns(reach.knots, frame), reach.modes, tolerance=tolerance, most=max_steps,
        longest=lambda u, du: _longest(u, du, frame, jnp.maximum(reach.moves, reach.least)),
    )  # fmt: skip
    return Solved(motion, frame, found, reach.modes)


_compiled = jit_plainly(_orbit)


def _frame(motion: Motion, y0, mode0, t0, period, found: Extent, forced: bool) -> Frame:
    flat, turn = ravel_pytree(y0)[0], turns_of(motion.system, y0)
    slope = ravel_pytree(motion.system.vector_field(t0, y0, mode0, motion.args))[0]
    normal = plane_across(slope, found.moves, found.shifts, found.turns, turn, period)
    return Frame(t0, period, not forced, flat, normal, found.moves, found.shifts, turn, found.turns)


def _longest(u, du, frame: Frame, reach):
    """A step may halve the period, not more, and move no component by ten times the motion's size, or
    its value."""
    states = (du[:-1] if frame.free else du).reshape(-1, reach.size) * (frame.size / reach)[None, :]
    part = ACCURACY.far / jnp.maximum(jnp.max(jnp.abs(states)), ACCURACY.far)
    if frame.free:
        part = jnp.minimum(part, ACCURACY.shorter * u[-1] / jnp.maximum(jnp.abs(du[-1]), 1e-300))
    return part


def describe_orbit(
    motion, frame: Frame, found, tolerance, unravel, mode0, segments, max_events, rests=False
):  # fmt: skip
    """The orbit with its multipliers, simulated once more; `rests`: where it is none, it settles."""
    system, args, unit = motion.system, motion.args, frame.size
    y, period = states_and_period(found.u, frame, segments)
    carried = found.carried
    mode1 = carried.modes[-1]
    # The end of the last piece: on the sticking set to the last digit, unlike Newton's start.
    end = jnp.where(jnp.all(carried.good), carried.ends[-1], y[0])
    on_set = held_directions(
        system, frame.t0, unravel(y[0]), mode1, args, unit, jnp.ones_like(unit)
    )  # fmt: skip
    free = _free_shifts(frame.shifts, carried.neutral, on_set)
    neutral = in_units(free, unit)
    flat = y[0] + without(end - y[0], frame.turns, neutral, frame.turn)
    start = unravel(flat)

    ledger = WithIntegrals(system, _rates)
    own = own_mode(system, frame.t0, flat, unravel, mode1, args, unit)

    def run(begin, span, state, mode):
        ts = begin + span * jnp.arange(ACCURACY.parts + 1.0) / ACCURACY.parts
        return simulate(
            ledger, begin, ts[-1], state, mode, args, integrator=motion.integrator,
            saveat=SaveAt(ts=ts, steps=True, max_rows=ROWS, max_events=max_events), throw=False,
        )  # fmt: skip

    solution, low, high = run_with_extremes(
        run, frame.t0, period, ledger.start(start, frame.t0, args), own, system, args,
        motion.integrator, lambda state: state.y,
    )  # fmt: skip
    outputs, log = solution.outputs, solution.events
    assert outputs is not None
    assert log is not None
    states = jax.vmap(lambda s: ravel_pytree(s.y)[0])(outputs.y)
    gained = states[1:] - flat[None, :]
    back = apart(gained, neutral, frame.turn)
    away = jnp.max(jnp.abs(back / unit[None, :]), axis=1)
    moves = jnp.max(away)
    closing = jnp.max(jnp.abs(without(gained[-1], frame.turns, neutral, frame.turn) / unit))
    whole = frame.turns * np.where(np.isfinite(frame.turn), frame.turn, 0.0)
    drift = neutral @ (gained[-1] - whole)

    recurs = (
        jnp.ones((), bool)
        if frame.free and not np.any(np.isfinite(frame.turn))
        else _recurs(motion, frame, states, whole + drift, outputs.mode, period, unravel)
    )

    monodromy = jnp.eye(unit.shape[0])
    for piece in carried.pieces:
        monodromy = piece @ monodromy
    rank, by_events = through_events(system, args, log, unit)
    # A direction that is held all the time, and by no event, has no part in the volume of deviations.
    held = jnp.eye(unit.shape[0]) - on_set
    within = on_set @ monodromy @ on_set
    alone = jnp.linalg.det(within + held) if holds(system, args, start) else jnp.linalg.det(monodromy)
    determinant = jnp.where(rank < unit.shape[0], jnp.linalg.det(monodromy), alone)
    monodromy = within
    by_events = by_events * jnp.exp(solution.y1.integrals["divergence"])
    # Shifts that change nothing are taken out of what becomes of deviations: their multipliers are 1.
    beside = jnp.eye(unit.shape[0]) - free
    count = jnp.round(jnp.trace(free)).astype(jnp.int32)
    if frame.free:
        slope = ravel_pytree(system.vector_field(frame.t0, start, mode1, args))[0] / unit
        trivial, rest = split_off(beside @ monodromy @ beside, beside @ slope)
        multipliers = with_ones(multipliers_of(rest, rank - 1 - count), count)
        rank = 1 + jnp.sum(multipliers != 0.0, dtype=jnp.int32)
    else:
        trivial, multipliers = (
            jnp.asarray(jnp.nan),
            with_ones(multipliers_of(beside @ monodromy @ beside, rank - count), count),
        )
        rank = jnp.sum(multipliers != 0.0, dtype=jnp.int32)

    # Where the motion touches a guard rounding decides whether there is an event.
    same = jnp.sum(carried.num_events, dtype=jnp.int32) == solution.num_events
    if segments == 1:
        same &= carried.sequence[0] == solution.sequence

    reached = (found.norm <= tolerance) | (found.stalled & (found.norm <= ACCURACY.stalled * tolerance))
    strength = jnp.maximum(jnp.max(jnp.abs(monodromy)), 1.0)
    allowed = jnp.minimum(motion.closes * strength, ACCURACY.near)
    result = first_of(
        (~jnp.isfinite(found.norm), "guess_failed"),
        (~reached & jnp.asarray(rests), "at_rest"),
        (found.singular, "singular"),
        (~reached & found.stalled, "stalled"),
        (~reached, "not_converged"),
        (moves < ENGINE.zero, "at_rest"),
        (mode1 != mode0, "mode_differs"),
        (~recurs, "period_differs"),
        (~(solution.successful & (closing <= allowed)), "not_reproduced"),
        (~same, "grazes"),
    )
    return PeriodicOrbit(
        t0=frame.t0,
        y0=start,
        mode0=mode1,
        period=period,
        multipliers=multipliers,
        trivial=trivial,
        rank=rank,
        repeats=_repeats(states, unit, neutral, frame.turn, strength, closing, multipliers),
        # In the units of the state: row by column.
        monodromy=in_units(monodromy, unit),
        determinant=determinant,
        determinant_by_events=by_events,
        residual=found.norm,
        closing_error=closing,
        steps=found.steps,
        lowest=unravel(low),
        highest=unravel(high),
        events=eqx.tree_at(lambda e: (e.y_before, e.y_after), log, (log.y_before.y, log.y_after.y)),
        sequence=solution.sequence,
        flags=solution.flags,
        result=result,
        simulation=solution.result,
        neutral=neutral,
        drift=unravel(drift),
        turns=jax.tree.map(lambda leaf: leaf.astype(jnp.int32), unravel(frame.turns)),
    )


def _free_shifts(shifts, neutral, on_set):
    """Projection on the shifts that change nothing and are not held.

    While a contact sticks nothing depends on its speed, as if it were a place that is free; but a
    deviation of it is none of the motion, and its multiplier is 0.
    """
    left = jnp.maximum(jnp.abs(neutral @ shifts - shifts), jnp.abs(on_set @ shifts - shifts))
    return projection_on(jnp.where(jnp.max(left, axis=0) <= ENGINE.same, shifts, 0.0))


def _rates(system, t, y, mode, args):
    return {"divergence": divergence(system, t, y, mode, args)}


def _recurs(motion: Motion, frame: Frame, states, gained, modes, period, unravel):
    """Whether field and guards, of the same states, are a period later what they are in the period.

    The state returns after other times than the forcing's period too, to go on to elsewhere.
    `gained`: whole turns of angles, and shifts that change nothing. States beside the motion are asked
    too: of an even rotation all rates are rounding.
    """
    states = jnp.concatenate([states, states + ENGINE.points_inside[0] * frame.size[None, :]])
    modes = jnp.concatenate([modes, modes])
    # Not at the instants of the motion: at these a load may jump.
    ts = (
        frame.t0
        + period
        * (jnp.tile(jnp.arange(ACCURACY.parts + 1.0), 2) + ENGINE.points_inside[0])
        / ACCURACY.parts
    )

    def acting(t, y, mode):
        y, mode = unravel(y), jnp.maximum(mode, 0)
        slope = motion.system.vector_field(t, y, mode, motion.args)
        return ravel_pytree((slope, motion.system.guards(t, y, mode, motion.args)))[0]

    both = jax.vmap(acting)(
        jnp.concatenate([ts, ts + period]),
        jnp.concatenate([states, states + gained[None, :]]),
        jnp.concatenate([modes, modes]),
    )
    now, later = jnp.split(both, 2)
    largest = jnp.max(jnp.abs(now), axis=0)
    return ~jnp.any(jnp.abs(later - now) > ACCURACY.closes * largest[None, :])


def _repeats(states, unit, neutral, turn, strength, closing, multipliers):
    """How often the motion is repeated within the period, of numbers that divide ACCURACY.parts.

    All of it is compared: where a body rests for a while no single state tells. `strength`: how much
    deviations grow in the period; in half of it they grow by the root of that. `closing`: how far the
    end was from the beginning, and by which a state is off that nearly returns wherever it is.
    """
    numbers = np.array([n for n in range(2, ACCURACY.parts + 1) if ACCURACY.parts % n == 0], np.int32)

    def off(part):
        later = jnp.roll(states[:-1], -part, axis=0)
        return jnp.max(jnp.abs(apart(later - states[:-1], neutral, turn) / unit[None, :]))

    away = jax.lax.map(off, ACCURACY.parts // numbers)
    from_one = jnp.abs(1.0 - multipliers)
    weakest = jnp.min(jnp.where(from_one > 0.0, from_one, jnp.inf), initial=1.0)
    near = jnp.maximum(ACCURACY.closes * strength ** (1.0 / numbers), 2.0 * closing / weakest)
    near = jnp.minimum(near, ENGINE.same)
    return jnp.max(jnp.where(away <= near, numbers, np.int32(1)))
