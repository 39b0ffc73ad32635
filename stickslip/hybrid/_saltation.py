"""The saltation matrix: how a small deviation of the state is changed by an event."""

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._types import Numeric, Whole
from .._validation import as_float64, check_handed_on, whole_number
from .arguments import a_time, check_field, mode_index, the_system
from .system import AbstractHybridSystem


def saltation_matrix(
    system: AbstractHybridSystem, t: Numeric, y: PyTree, mode: Whole, guard: Whole, args: PyTree = None
) -> Float[Array, "n n"]:
    r"""Saltation matrix $S$ of the transition at guard `guard` from state `y` in `mode`.

    With the jump $y^+ = R(t, y)$, the guard $g(t, y) = 0$ and the fields $f^\pm$ before and after,

    $$S = R_y + \frac{(f^+ - R_y f^- - R_t)\, g_y}{g_t + g_y f^-},$$

    so that a deviation $\delta y^-$ just before the event becomes $S\,\delta y^-$ just after it
    (Aizerman & Gantmakher 1958; Müller 1995). In stick-slip transitions $S$ loses rank where slip
    turns into stick. Rows and columns follow the flattened state (`jax.flatten_util.ravel_pytree`).
    `jax.jacfwd` of `simulate` contains the same factor at every event.

    **Arguments**: `t` [s], `y` (state before the event, e.g. `solution.events.y_before`), `mode`
    (mode before), `guard` (number), `args`. **Returns** an array of shape `[n, n]`, infinite where
    the guard has no slope (grazing).

    **Errors** `ValueError`/`TypeError` naming the argument.
    """
    the_system(system)
    check_handed_on("args", args)
    t, y = a_time("t", t), as_float64("y", y)
    mode = mode_index("mode", system, mode)
    whole_number("guard", guard, 0, len(system.guard_names) - 1)
    check_field(system, t, y, mode, args, name="y")
    flat, unravel = ravel_pytree(y)
    t = jnp.asarray(t, flat.dtype)

    def field(t, flat, mode):
        return ravel_pytree(system.vector_field(t, unravel(flat), mode, args))[0]

    def value(t, flat):
        return jnp.stack([jnp.asarray(g) for g in system.guards(t, unravel(flat), mode, args)])[guard]

    def jump(t, flat):
        after, new_mode = system.transition(t, unravel(flat), mode, guard, args)
        return ravel_pytree(after)[0], new_mode

    (after, new_mode) = jump(t, flat)
    r_t, r_y = jax.jacfwd(lambda t, z: jump(t, z)[0], argnums=(0, 1))(t, flat)
    g_t, g_y = jax.jacfwd(value, argnums=(0, 1))(t, flat)
    before = field(t, flat, mode)
    kick = field(t, after, new_mode) - r_y @ before - r_t
    return r_y + jnp.outer(kick, g_y) / (g_t + g_y @ before)
