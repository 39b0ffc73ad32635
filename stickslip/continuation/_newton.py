"""The loop of every Newton's method here, and the compiled one, whose steps are halved."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY


class Ended(NamedTuple):
    """Where the loop ended: what its steps carried on, how many there were, whether it is solved."""

    carried: Any
    steps: Any
    solved: Any


def _while_loop(going: Callable, step: Callable, state: Any) -> Any:
    while going(state):
        state = step(state)
    return state


def newton(
    step: Callable, start: Any, *, enough: Any, most: int, nearly: float = 0.0,
    loop: Callable = _while_loop,
) -> Ended:  # fmt: skip
    """Steps until the error is no more than `enough`; at most so many.

    `step(carried, number) -> (carried, error)`, with numbers from 0. Rounding keeps an error from
    falling for ever: one below `nearly` that is no longer halved is an end as good. A step that fails
    says so by an error that is not a number. `loop`: `jax.lax.while_loop` for steps that are traced.
    """

    def is_solved(error, before):
        return (error <= enough) | ((error <= nearly) & (error >= 0.5 * before))

    def going(state):
        _, number, error, before = state
        # Not by `~`, which makes -2 of Python's own True.
        return (error >= 0.0) & (is_solved(error, before) ^ True) & (number < most)

    def once(state):
        carried, number, error, _ = state
        carried, after = step(carried, number)
        return carried, number + 1, after, error

    unknown = np.float64(np.inf)
    carried, steps, error, before = loop(going, once, (start, np.int32(0), unknown, unknown))
    return Ended(carried, steps, is_solved(error, before))


class Newton(NamedTuple):
    """Outcome: unknowns, Jacobian and carried values there, norm of the residual, evaluations.

    `stalled`: no step, however short, makes the residual smaller. `singular`: the Jacobian, or the step
    from it, is not finite.
    """

    u: Float[Array, " unknown"]
    jacobian: Float[Array, "unknown unknown"]
    carried: Any
    norm: Float[Array, ""]
    steps: Array
    stalled: Array
    singular: Array


def damped_newton(
    evaluate: Callable,
    u: Float[Array, " unknown"],
    state: Any,
    *,
    tolerance: Any,
    most: int,
    longest: Callable,
) -> Newton:
    """Solve `residual(u) = 0`, smooth in pieces; steps are halved while the residual does not fall.

    `evaluate(u, state) -> (residual, jacobian, norm, state, carried)`: `state` (the modes at the knots)
    is that of the accepted point, and handed to the next evaluation. A norm that is not finite rejects
    the step. `longest(u, du)`: the largest part of a step that is allowed.
    """

    def solve(jacobian, residual):
        left, strength, right = jnp.linalg.svd(jnp.where(jnp.isfinite(jacobian), jacobian, 0.0))
        # Directions that do not change the residual are left alone: the step of least length is taken
        # where a whole family of orbits solves the equations.
        kept = strength > ENGINE.slack * strength[0]
        along = (left.T @ residual) / jnp.where(kept, strength, 1.0)
        return -right.T @ jnp.where(kept, along, 0.0)

    def direction(residual, jacobian):
        du = solve(jacobian, residual)
        return du, jnp.all(jnp.isfinite(jacobian)) & jnp.all(jnp.isfinite(du))

    def stuck(norm, part):
        # Near the tolerance it is rounding that keeps the residual: few shorter steps are tried.
        rounding = (norm <= ACCURACY.far * tolerance) & (part < ACCURACY.shrinks)
        return (norm > tolerance) & ((part < ACCURACY.shortest) | rounding)

    def step(carry, number):
        u, residual, jacobian, norm, state, carried, du, part, _ = carry
        trial = u + part * du
        residual_1, jacobian_1, norm_1, state_1, carried_1 = evaluate(trial, state)
        # The first evaluation is that of the guess, whatever it is.
        better = (number == 0) | (norm_1 < (1.0 - 1e-4 * part) * norm)
        new = trial, residual_1, jacobian_1, norm_1, state_1, carried_1
        old = u, residual, jacobian, norm, state, carried
        u, residual, jacobian, norm, state, carried = jax.tree.map(
            lambda a, b: jnp.where(better, a, b), new, old
        )
        du, fine = direction(residual, jacobian)
        part = jnp.where(better, jnp.minimum(longest(u, du), 1.0), 0.5 * part)
        error = jnp.where(fine & ~stuck(norm, part), norm, jnp.nan)
        return (u, residual, jacobian, norm, state, carried, du, part, fine), error

    # The motion with its derivatives is nearly all of the program: traced once, compiled once.
    evaluate = eqx.filter_closure_convert(evaluate, u, state)
    shapes = eqx.filter_eval_shape(evaluate, u, state)
    residual, jacobian, _, _, carried = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)
    infinite, fine = jnp.full((), jnp.inf), jnp.ones((), bool)
    start = u, residual, jacobian, infinite, state, carried, jnp.zeros_like(u), jnp.ones(()), fine
    end = newton(step, start, enough=tolerance, most=most, loop=jax.lax.while_loop)
    u, _, jacobian, norm, _, carried, _, part, fine = end.carried
    return Newton(u, jacobian, carried, norm, end.steps, stuck(norm, part), ~fine)
