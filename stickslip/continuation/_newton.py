"""Newton's method for square systems that are smooth in pieces, compiled as one loop."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY


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


def newton(
    evaluate: Callable,
    u: Float[Array, " unknown"],
    state: Any,
    *,
    tolerance: Any,
    most: int,
    longest: Callable,
) -> Newton:
    """Solve `residual(u) = 0` by Newton's method with steps halved while the residual does not fall.

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

    def going(carry):
        _, _, _, norm, _, _, _, part, fine, steps = carry
        return (norm > tolerance) & ~stuck(norm, part) & fine & (steps < most)

    def body(carry):
        u, residual, jacobian, norm, state, carried, du, part, _, steps = carry
        trial = u + part * du
        residual_1, jacobian_1, norm_1, state_1, carried_1 = evaluate(trial, state)
        # The first evaluation is that of the guess, whatever it is.
        better = (steps == 0) | (norm_1 < (1.0 - 1e-4 * part) * norm)
        new = trial, residual_1, jacobian_1, norm_1, state_1, carried_1
        old = u, residual, jacobian, norm, state, carried
        u, residual, jacobian, norm, state, carried = jax.tree.map(
            lambda a, b: jnp.where(better, a, b), new, old
        )
        step, fine = direction(residual, jacobian)
        part = jnp.where(better, jnp.minimum(longest(u, step), 1.0), 0.5 * part)
        return u, residual, jacobian, norm, state, carried, step, part, fine, steps + 1

    # The motion with its derivatives is nearly all of the program: traced once, compiled once.
    evaluate = eqx.filter_closure_convert(evaluate, u, state)
    shapes = eqx.filter_eval_shape(evaluate, u, state)
    residual, jacobian, _, _, carried = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)
    infinite, fine = jnp.full((), jnp.inf), jnp.ones((), bool)
    start = (
        u, residual, jacobian, infinite, state, carried, jnp.zeros_like(u), jnp.ones(()), fine,
        jnp.zeros((), jnp.int32),
    )  # fmt: skip
    end = jax.lax.while_loop(going, body, start)
    u, residual, jacobian, norm, state, carried, _, part, fine, steps = end
    return Newton(u, jacobian, carried, norm, steps, stuck(norm, part), ~fine)
