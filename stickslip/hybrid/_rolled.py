"""The stages of an explicit Runge-Kutta step as a loop: a small program, which compiles fast.

Written out, a step of n stages holds n copies of the vector field, and its derivatives as many more:
the right form for a million lanes, but most of what a single run waits for. Here the field is traced
once. The slope at the end of the step is one stage more, with the weights `b` as its row of `a`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from ._tableau import Tableau


def _coefficients(tableau: Tableau) -> tuple[np.ndarray, np.ndarray]:
    """Rows and nodes of all stages and, as the last one, of the end of the step."""
    n = tableau.stages
    # Full rows with zeros instead of the triangle: all turns of a loop do the same.
    rows = np.zeros((n + 1, n + 1))
    for i in range(1, n):
        rows[i, :i] = tableau.a[i][:i]
    rows[n, :n] = tableau.b
    return rows, np.append(tableau.c, 1.0)


def step(
    tableau: Tableau, field: Callable, t: Any, y: PyTree, dy: PyTree, h: Any, inside: Sequence = (),
    surprises: bool = False,
) -> tuple[PyTree, PyTree, tuple[PyTree, ...], tuple[PyTree, ...], PyTree | None]:  # fmt: skip
    """A step and the looks inside it, as `AbstractStepper.step_and_look`.

    `inside`: the weights of each of those states; `surprises`: whether the last stage is at the end of
    the step and is compared with it.
    """
    rows, nodes = _coefficients(tableau)
    n, differences = tableau.stages, [*tableau.error_weights]
    if surprises:
        differences.append((*[0.0] * (n - 1), -1.0, 1.0))
    start, tree = ravel_pytree(y)
    # Every slope is added, when it is known, to all sums that want it: the states of the stages, then
    # those inside and the differences. Keeping the slopes instead takes twice as long in forward
    # derivatives.
    states = n + 1 + len(inside)
    weights = np.concatenate([rows, np.zeros((len(inside) + len(differences), n + 1))])
    for place, row in enumerate((*inside, *differences), n + 1):
        weights[place, : len(row)] = row
    is_state = np.zeros((states + len(differences), 1))
    is_state[:states] = 1.0

    def stage(carry, now):
        sums, _ = carry
        column, node, i = now
        state = jax.lax.dynamic_index_in_dim(sums, i, 0, keepdims=False)
        slope = ravel_pytree(field(t + node * h, tree(state)))[0]
        return (sums + (h * column)[:, None] * slope[None, :], slope), None

    first = ravel_pytree(dy)[0]
    sums = jnp.asarray(is_state) * start[None, :] + h * jnp.asarray(weights[:, :1]) * first[None, :]
    numbers = jnp.arange(1, n + 1, dtype=jnp.int32)
    stages = jnp.asarray(weights.T[1:]), jnp.asarray(nodes[1:]), numbers
    (sums, slope), _ = jax.lax.scan(stage, (sums, first), stages)
    seen = tuple(tree(sums[i]) for i in range(n + 1, states))
    found = [tree(sums[i]) for i in range(states, states + len(differences))]
    surprise = found.pop() if surprises else None
    return tree(sums[n]), tree(slope), tuple(found), seen, surprise


def vjp(
    tableau: Tableau, field: Callable, end: Callable,
    parameters: PyTree, t: Any, y: PyTree, dy: PyTree, h: Any,
) -> tuple[PyTree, tuple[PyTree, Any, PyTree, PyTree]]:  # fmt: skip
    """Cotangents of one step, as `AbstractStepper.vjp`: the transpose of `step` written out."""
    rows, nodes = _coefficients(tableau)
    n = tableau.stages
    start, tree = ravel_pytree(y)

    def stage(slopes, now):
        row, node, i = now
        state = start + h * jnp.sum(row[:, None] * slopes, axis=0)
        slope = ravel_pytree(field(parameters, t + node * h, tree(state)))[0]
        return jax.lax.dynamic_update_index_in_dim(slopes, slope, i, 0), state

    slopes = jnp.zeros((n + 1, *start.shape)).at[0].set(ravel_pytree(dy)[0])
    numbers = jnp.arange(1, n + 1, dtype=jnp.int32)
    all_nodes = jnp.asarray(nodes[1:])
    slopes, states = jax.lax.scan(stage, slopes, (jnp.asarray(rows[1:]), all_nodes, numbers))
    (y1_bar, dy1_bar), extra = end(tree(states[-1]), tree(slopes[-1]))

    def pull(carry, now):
        parameters_bar, t_bar, state_bars = carry
        column, node, i, state, given_slope, given_state = now
        # The slope of a stage goes into the states of all later ones, whose cotangents are known here.
        bar = given_slope + h * jnp.sum(column[:, None] * state_bars, axis=0)
        back = jax.vjp(field, parameters, t + node * h, tree(state))[1]
        parameters_i, t_i, pulled = back(tree(bar))
        state_bar = given_state + ravel_pytree(pulled)[0]
        state_bars = jax.lax.dynamic_update_index_in_dim(state_bars, state_bar, i, 0)
        return (jax.tree.map(jnp.add, parameters_bar, parameters_i), t_bar + t_i, state_bars), None

    # From outside, cotangents come only to the last stage, the end of the step.
    nothing = jnp.zeros((n, *start.shape))
    given_slopes = nothing.at[-1].set(ravel_pytree(dy1_bar)[0])
    given_states = nothing.at[-1].set(ravel_pytree(y1_bar)[0])
    zero = jax.tree.map(jnp.zeros_like, parameters), jnp.zeros_like(t), jnp.zeros((n + 1, *start.shape))
    stages = jnp.asarray(rows.T[1:]), all_nodes, numbers, states, given_slopes, given_states
    (parameters_bar, t_bar, state_bars), _ = jax.lax.scan(pull, zero, stages, reverse=True)
    # The first slope came from the step before: its cotangent is handed on and not pulled here.
    dy_bar = h * jnp.sum(jnp.asarray(rows[:, :1]) * state_bars, axis=0)
    return extra, (parameters_bar, t_bar, tree(jnp.sum(state_bars, axis=0)), tree(dy_bar))
