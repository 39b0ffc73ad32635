"""A hybrid system together with small deviations of its state."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, instance, reals, whole_state
from .._types import Given
from .._validation import check_type, shape_refusal
from ..hybrid import AbstractHybridSystem, AbstractSystemWrapper
from ..hybrid.event_time import event_delay


class Deviating(NamedTuple):
    """State `y` and its deviations: the components of `y` with one more axis, last, to count them."""

    y: PyTree
    deviations: PyTree


_deviating = instance(Deviating, "a Deviating, as `start` makes it")


class WithDeviations(AbstractSystemWrapper):
    r"""The same system with infinitesimal deviations $\xi$ of its state: the tangent dynamics.

    Inside a mode $\dot\xi = f_y\,\xi$. At an event with guard $g$, jump $R$ and the fields $f^\pm$

    $$\tau = -\frac{g_y\,\xi}{g_t + g_y f^-}, \qquad
      \xi^+ = R_y(\xi + f^-\tau) + R_t\,\tau - f^+\tau$$

    with $\tau$, by which the deviated motion is late at the event: the saltation matrix times $\xi$
    (Aizerman & Gantmakher 1958; Müller 1995), by directional derivatives. Where slip turns into stick
    a direction is lost. Modes, guards and transitions are those of `system`, so that it can be
    simulated wherever the original can; unlike its derivatives, the deviations obey the step-size
    control. Where the guard has no slope (grazing) $\tau$ does not exist: it is taken as 0 and
    `Solution.flags` marks it. Deviations have the units of their components.

    **Argument** `system`: any hybrid system, differentiable inside its modes. **Errors** `TypeError`
    for anything else.
    """

    system: AbstractHybridSystem

    def __init__(self, system: Given[AbstractHybridSystem]):
        self.system = check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")

    @check_arguments(y=_deviating)
    def inner(self, y, args):
        return y.y, args

    @check_arguments(y=whole_state, columns=reals)
    def start(self, y: PyTree, columns: Given[Float[Array, "size count"]]) -> Deviating:
        """State with the deviations `columns` of the flattened `y`."""
        size = sum(np.size(leaf) for leaf in jax.tree.leaves(y))
        if np.ndim(columns) != 2 or np.shape(columns)[0] != size:
            raise shape_refusal("columns", columns, f"columns of {size}, as many as y has components")
        unravel = ravel_pytree(y)[1]
        return Deviating(y, jax.vmap(unravel, in_axes=1, out_axes=-1)(columns))

    @check_arguments(state=_deviating)
    def columns(self, state: Deviating) -> Float[Array, "size count"]:
        """Deviations as columns, in the order of the flattened `y`."""
        return jax.vmap(lambda d: ravel_pytree(d)[0], in_axes=-1, out_axes=1)(state.deviations)

    def vector_field(self, t, y, mode, args):
        def field(state):
            return self.system.vector_field(t, state, mode, args)

        def along(deviation):
            return jax.jvp(field, (y.y,), (deviation,))

        dy, rates = jax.vmap(along, in_axes=-1, out_axes=(None, -1))(y.deviations)
        return Deviating(dy, rates)

    def transition(self, t, y, mode, guard, args):
        system, t = self.system, jnp.asarray(t, jnp.float64)
        one = jnp.ones_like(t)

        def value(t, state):
            values = system.guards(t, state, mode, args)
            return sum(jnp.where(guard == i, v, 0.0) for i, v in enumerate(values))

        def jump(t, state):
            after, new_mode = system.transition(t, state, mode, guard, args)
            like = jax.tree.map(lambda a, b: jnp.asarray(a, b.dtype) + 0.0 * b, after, state)
            return like, new_mode

        before = system.vector_field(t, y.y, mode, args)
        rate = jax.jvp(value, (t, y.y), (one, before))[1]
        after, new_mode = jump(t, y.y)
        slope = system.vector_field(t, after, new_mode, args)

        def through(deviation):
            change = jax.jvp(lambda state: value(t, state), (y.y,), (deviation,))[1]
            late = event_delay(change, rate, rate != 0)
            arriving = jax.tree.map(lambda d, f: d + f * late, deviation, before)
            leaving = jax.jvp(lambda t, s: jump(t, s)[0], (t, y.y), (late, arriving))[1]
            return jax.tree.map(lambda d, f: d - f * late, leaving, slope)

        deviations = jax.vmap(through, in_axes=-1, out_axes=-1)(y.deviations)
        return Deviating(after, deviations), new_mode
