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

from ..analysis._observable import with_parameters
from ..hybrid import AbstractHybridSystem, Integrator, jit_plainly, simulate, use_executor
from ..hybrid._bound import spanning
from ..hybrid._system import mode_type
from ._closing import Frame, Motion, closure, extent, known, turns_of, unknowns
from ._newton import Newton
from ._orbit import PeriodicOrbit
from ._periodic_orbit import described


class Problem(eqx.Module):
    """What is followed: a system with one free parameter or two, and how the period depends on them.

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
    of the first point; `size`: what unknowns and residuals are parts of; `extent`: of the motion.
    """

    y: Any
    phase: Any
    period: Any
    normal: Any
    size: Any
    extent: Any


def system_at(problem: Problem, values: Any) -> AbstractHybridSystem:
    """The system with the parameters at these values, `[parameter]`."""
    values = jnp.asarray(values, jnp.float64)
    return with_parameters(problem.system, {name: values[i] for i, name in enumerate(problem.names)})


def _fixed(problem: Problem, values: Any) -> Problem:
    """The same with no free parameter, at these values: one program for whatever is followed."""
    known = {name: jnp.asarray(value) for name, value in zip(problem.names, values, strict=True)}
    system = with_parameters(problem.system, known)
    return dataclasses.replace(problem, system=system, names=(), unit=jnp.zeros(0))


def _parted(problem: Problem, u: Any) -> tuple[Problem, Any]:
    """Unknowns without the parameters, and the problem with these fixed."""
    u, free = np.asarray(u, float), len(problem.names)
    return _fixed(problem, u[-free:] * np.asarray(problem.unit)), jnp.asarray(u[:-free])


def _framed(problem: Problem, anchor: Anchor, turn: Any) -> tuple[Motion, Frame]:
    system = problem.system
    period, t0 = anchor.period, jnp.zeros(())
    if problem.forcing_period is not None:
        period = problem.multiple * jnp.asarray(problem.forcing_period(system), jnp.float64)
        t0 = anchor.phase * period
    free = problem.forcing_period is None
    frame = Frame(t0, period, free, ravel_pytree(anchor.y)[0], anchor.normal, anchor.size, turn)
    return Motion(system, problem.args, problem.integrator), frame


def anchored(problem: Problem, values: Any, y: PyTree, mode: Any, phase: Any, period: Any, least: Any):
    """Anchor at a state, with its unknowns and the modes at the knots; the size is at least `least`."""
    values = np.asarray(values, float)
    y = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), y)
    least = np.broadcast_to(least, np.shape(ravel_pytree(y)[0]))
    phase, period, least = (jnp.asarray(number, jnp.float64) for number in (phase, period, least))
    anchor, u, modes = _anchored(
        _fixed(problem, values), y, jnp.asarray(mode, mode_type(problem.system)), phase, period, least
    )
    return anchor, np.append(u, values / np.asarray(problem.unit)), modes


@jit_plainly
def _anchored(problem: Problem, y: PyTree, mode: Any, phase: Any, period: Any, least: Any):
    turn = jnp.asarray(turns_of(problem.system, y))
    ones = jnp.ones(turn.shape)
    motion, frame = _framed(problem, Anchor(y, phase, period, ones, ones, ones), turn)
    integrator = spanning(motion.integrator, frame.period)
    with use_executor(problem.executor):
        moves, knots, modes = extent(
            motion._replace(integrator=integrator), y, mode, frame.t0, frame.period, problem.segments
        )
    size = jnp.maximum(moves, least)
    slope = ravel_pytree(motion.system.vector_field(frame.t0, y, mode, motion.args))[0] / size
    length = jnp.linalg.norm(slope)
    normal = slope / jnp.where(length > 0, length, 1.0)
    anchor = Anchor(y, phase, frame.period, normal, size, moves)
    return anchor, unknowns(knots, frame._replace(size=size)), modes


@jit_plainly
def evaluated(problem: Problem, u: Any, modes: Any, anchor: Anchor):
    """Residual, its derivative by all unknowns, the parameters last, and what the pieces were."""
    _, unravel = ravel_pytree(anchor.y)
    free = len(problem.names)
    turn = jnp.asarray(turns_of(problem.system, anchor.y))

    def residual(u):
        there = system_at(problem, u[-free:] * problem.unit)
        motion, frame = _framed(dataclasses.replace(problem, system=there), anchor, turn)
        span = jax.lax.stop_gradient(frame.period)
        integrator = spanning(motion.integrator, span)
        with use_executor(problem.executor):
            found = closure(u[:-free], modes, motion._replace(integrator=integrator), frame, unravel)
        return found.residual, found

    jacobian, found = jax.jacfwd(residual, has_aux=True)(u)
    return found.residual, jacobian, found


def passed(problem: Problem, u: Any, modes: Any, anchor: Anchor):
    """Events of one period from the first state of these unknowns, and whether it went well."""
    return _passed(*_parted(problem, u), modes, anchor)


@jit_plainly
def _passed(problem: Problem, u: Any, modes: Any, anchor: Anchor):
    motion, frame, unravel = _around(problem, modes, anchor)
    states, period = known(u, frame, problem.segments)
    with use_executor(problem.executor):
        run = simulate(
            motion.system, frame.t0, frame.t0 + period, unravel(states[0]), modes[0], motion.args,
            integrator=motion.integrator, max_events=problem.max_events, throw=False,
        )  # fmt: skip
    return run.events, run.successful


def orbit_at(problem: Problem, u: Any, modes: Any, anchor: Anchor, found: Any) -> PeriodicOrbit:
    """The orbit of these unknowns, simulated once more, with its multipliers."""
    residual, jacobian, closing = found
    fixed, u = _parted(problem, u)
    return _orbit_at(fixed, u, modes, anchor, (residual, jacobian[:, : u.size], closing))


@jit_plainly
def _orbit_at(problem: Problem, u: Any, modes: Any, anchor: Anchor, found: Any) -> PeriodicOrbit:
    residual, jacobian, closing = found
    motion, frame, unravel = _around(problem, modes, anchor)
    norm = jnp.max(jnp.abs(residual))
    none = jnp.zeros((), bool)
    solved = Newton(u, jacobian, closing, norm, jnp.ones((), jnp.int32), none, none)
    with use_executor(problem.executor):
        return described(
            motion, frame, solved, jnp.inf, unravel, modes[0], problem.segments, problem.max_events
        )


def _around(problem: Problem, modes: Any, anchor: Anchor) -> tuple[Motion, Frame, Any]:
    """What moves, with steps bounded as for one period, and the frame of an anchor."""
    _, unravel = ravel_pytree(anchor.y)
    motion, frame = _framed(problem, anchor, jnp.asarray(turns_of(problem.system, anchor.y)))
    integrator = spanning(motion.integrator, frame.period)
    return motion._replace(integrator=integrator), frame, unravel
