"""The compiled pieces of continuation: residual and derivative along parameters, and the orbit."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from ..analysis.observable import with_parameters
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, jit_plainly, simulate, use_executor
from ..hybrid.longest_step import spanning
from ..hybrid.system import mode_type
from ._closing import (
    Frame,
    Motion,
    closure,
    equations,
    extent,
    plane_across,
    samples_of,
    states_and_period,
    unknowns,
)
from ._newton import Newton
from ._orbit import PeriodicOrbit
from ._periodic_orbit import describe_orbit
from ._turns import turns_of


class Problem(eqx.Module):
    """Problem of a branch: a system with one free parameter or two, on which its period may depend.

    `forcing_period(system)` [s] and `multiple`, or None for a period that is an unknown. `unit`,
    `[parameter]`: the size of a step of each parameter.
    """

    system: AbstractHybridSystem
    args: PyTree
    integrator: Integrator
    unit: Any
    names: tuple[str, ...] = eqx.field(static=True)
    forcing_period: Callable | None = eqx.field(static=True)
    multiple: int = eqx.field(static=True)
    segments: int = eqx.field(static=True)
    max_events: int = eqx.field(static=True)
    executor: Any = eqx.field(static=True)


class Anchor(NamedTuple):
    """The orbit around which unknowns are measured: at unknown 1 of the period it has `period`.

    `phase`: time of the first point, in parts of the period (of the forced system); `normal`: the plane
    of the first point; `size`: what unknowns and residuals are parts of; `extent`: of the motion, and
    `largest`, of those on the branch up to here; `shifts`: columns that change nothing, of states;
    `turns`: how often angles go round.
    """

    y: Any
    phase: Any
    period: Any
    normal: Any
    size: Any
    extent: Any
    largest: Any
    shifts: Any
    turns: Any


def system_at(problem: Problem, values: Any) -> AbstractHybridSystem:
    """The system with the parameters at these values, `[parameter]`."""
    values = jnp.asarray(values, jnp.float64)
    return with_parameters(problem.system, {name: values[i] for i, name in enumerate(problem.names)})


def _problem_at(problem: Problem, values: Any) -> Problem:
    """The same with no free parameter, at these values: one program for whatever is followed."""
    known = {name: jnp.asarray(value) for name, value in zip(problem.names, values, strict=True)}
    system = with_parameters(problem.system, known)
    return dataclasses.replace(problem, system=system, names=(), unit=jnp.zeros(0))


def _split_unknowns(problem: Problem, u: Any) -> tuple[Problem, Any]:
    """Unknowns without the parameters, and the problem with these fixed."""
    u, free = np.asarray(u, float), len(problem.names)
    return _problem_at(problem, u[-free:] * np.asarray(problem.unit)), jnp.asarray(u[:-free])


def _frame_of(problem: Problem, anchor: Anchor) -> tuple[Motion, Frame]:
    turn = turns_of(problem.system, anchor.y)
    system = problem.system
    period, t0 = anchor.period, jnp.zeros(())
    if problem.forcing_period is not None:
        period = problem.multiple * jnp.asarray(problem.forcing_period(system), jnp.float64)
        t0 = anchor.phase * period
    free = problem.forcing_period is None
    flat, size = ravel_pytree(anchor.y)[0], anchor.size
    shifts = anchor.shifts / size[:, None]
    longest = jnp.max(jnp.abs(shifts), axis=0)
    shifts = shifts / jnp.where(longest > 0.0, longest, 1.0)[None, :]
    frame = Frame(t0, period, free, flat, anchor.normal, size, shifts, turn, anchor.turns)
    return Motion(system, problem.args, problem.integrator), frame


def anchor_at(
    problem: Problem, values: Any, y: PyTree, mode: Any, phase: Any, period: Any,
    before: tuple[Anchor, bool] | None = None, gained: Any = np.nan,
):  # fmt: skip
    """Anchor at a state, with its unknowns and the modes at the knots.

    `before`: the anchor of the orbit before it on the branch, and whether that begins at the same place
    of the motion. Sizes do not become smaller. They grow where a component is carried along, as the
    speed of what rotates: it moves on while its ripple stays what it is. `gained`: by how much the
    state goes on in the period; NaN where that is what it does in the simulation.
    """
    values = np.asarray(values, float)
    y = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), y)
    flat = np.asarray(ravel_pytree(y)[0])
    if before is None:
        size = largest = reached = shift = np.zeros(flat.shape)
    else:
        old, same = before
        size, largest, reached = (np.asarray(a) for a in (old.size, old.largest, old.extent))
        shift = same * np.abs(flat - np.asarray(ravel_pytree(old.y)[0]))
    gained = np.broadcast_to(gained, flat.shape)
    numbers = (phase, period, size, largest, reached, shift, gained)
    anchor, u, modes = _anchor_at(
        _problem_at(problem, values), y, jnp.asarray(mode, mode_type(problem.system)),
        *(jnp.asarray(number, jnp.float64) for number in numbers),
    )  # fmt: skip
    return anchor, np.append(u, values / np.asarray(problem.unit)), modes


@jit_plainly
def _anchor_at(
    problem: Problem, y: PyTree, mode: Any, phase, period, size, largest, reached, shift, gained
):  # fmt: skip
    ones = jnp.ones(size.shape)
    motion, frame = _frame_of(
        problem,
        Anchor(y, phase, period, ones, ones, ones, ones, jnp.zeros((size.size, size.size)), 0.0 * ones),
    )
    integrator = spanning(motion.integrator, frame.period)
    with use_executor(problem.executor):
        motion = motion._replace(integrator=integrator)
        run = samples_of(motion, y, mode, frame.t0, frame.period, problem.segments)
        found = extent(motion, run, frame.t0, frame.period, problem.segments, frame.free, gained)
    change = jnp.maximum(jnp.abs(found.moves - reached), 1e-300)
    size = jnp.maximum(jnp.maximum(size, found.moves), jnp.minimum(size * shift / change, found.least))
    slope = ravel_pytree(motion.system.vector_field(frame.t0, y, mode, motion.args))[0]
    largest = jnp.maximum(largest, found.moves)
    shifts = found.shifts * found.moves[:, None]
    anchor = Anchor(y, phase, frame.period, ones, size, found.moves, largest, shifts, found.turns)
    _, frame = _frame_of(problem, anchor)
    normal = plane_across(slope, size, frame.shifts, found.turns, frame.turn, frame.period)
    return anchor._replace(normal=normal), unknowns(found.knots, frame), found.modes


@jit_plainly
def equations_at(problem: Problem, u: Any, modes: Any, anchor: Anchor):
    """Residual, its derivative by all unknowns, the parameters last, and what the pieces were."""
    _, unravel = ravel_pytree(anchor.y)
    free = len(problem.names)

    def found_from(u):
        there = system_at(problem, u[-free:] * problem.unit)
        motion, frame = _frame_of(dataclasses.replace(problem, system=there), anchor)
        span = jax.lax.stop_gradient(frame.period)
        integrator = spanning(motion.integrator, span)
        with use_executor(problem.executor):
            return closure(u[:-free], modes, motion._replace(integrator=integrator), frame, unravel)

    return equations(found_from, u, _frame_of(problem, anchor)[1], problem.segments)


def events_along(problem: Problem, u: Any, modes: Any, anchor: Anchor):
    """Events of one period from the first state of these unknowns, and whether it went well."""
    return _events_along(*_split_unknowns(problem, u), modes, anchor)


@jit_plainly
def _events_along(problem: Problem, u: Any, modes: Any, anchor: Anchor):
    motion, frame, unravel = _around(problem, modes, anchor)
    states, period = states_and_period(u, frame, problem.segments)
    with use_executor(problem.executor):
        run = simulate(
            motion.system, frame.t0, frame.t0 + period, unravel(states[0]), modes[0], motion.args,
            integrator=motion.integrator, saveat=SaveAt(max_events=problem.max_events), throw=False,
        )  # fmt: skip
    return run.events, run.successful


def orbit_at(problem: Problem, u: Any, modes: Any, anchor: Anchor, found: Any) -> PeriodicOrbit:
    """The orbit of these unknowns, simulated once more, with its multipliers."""
    residual, jacobian, closing = found
    fixed, u = _split_unknowns(problem, u)
    return _orbit_at(fixed, u, modes, anchor, (residual, jacobian[:, : u.size], closing))


@jit_plainly
def _orbit_at(problem: Problem, u: Any, modes: Any, anchor: Anchor, found: Any) -> PeriodicOrbit:
    residual, jacobian, closing = found
    motion, frame, unravel = _around(problem, modes, anchor)
    norm = jnp.max(jnp.abs(residual))
    none = jnp.zeros((), bool)
    solved = Newton(u, jacobian, closing, norm, jnp.ones((), jnp.int32), none, none)
    with use_executor(problem.executor):
        return describe_orbit(
            motion, frame, solved, jnp.inf, unravel, modes[0], problem.segments, problem.max_events
        )


def _around(problem: Problem, modes: Any, anchor: Anchor) -> tuple[Motion, Frame, Any]:
    """The motion, with steps bounded as for one period, and the frame of an anchor."""
    _, unravel = ravel_pytree(anchor.y)
    motion, frame = _frame_of(problem, anchor)
    integrator = spanning(motion.integrator, frame.period)
    return motion._replace(integrator=integrator), frame, unravel
