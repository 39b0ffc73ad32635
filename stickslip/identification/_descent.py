"""First-order methods of optax as a method."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax

from .._argument_checks import check_arguments, count, instance, number, or_none
from .._types import Given
from ._fit import CODE, Fit
from ._losses import AbstractLoss, loss_or_none
from ._methods import AbstractIterativeMethod, Iteration
from ._sensitivity import Sensitivity


@check_arguments(
    optimiser=or_none(instance(optax.GradientTransformation, "an optimiser of optax")),
    steps=count(1), tolerance=number("positive"), loss=loss_or_none,
)  # fmt: skip
class GradientDescent(AbstractIterativeMethod):
    r"""An optimiser of optax that follows the gradient; the best point on the way is kept.

    For noise in the objective, schedules and constraints of your own; `LevenbergMarquardt` takes far
    fewer runs. The gradient is $J^T r$ with the Jacobian by forward mode through all events.

    **Arguments:** `optimiser`, by default Adam with a rate that falls from 0.03 to 0 along a cosine;
    `steps`, how many; `tolerance`: a fit is successful if the minimum is nearer than this, in standard
    errors, by the linearised problem; `loss`, a robust loss such as `Huber()`, or `None`. **Raises**
    `TypeError`, `ValueError` for anything else.
    """

    optimiser: Given["optax.GradientTransformation | None"] = eqx.field(static=True, default=None)
    steps: int = 300
    tolerance: float = 0.1
    loss: AbstractLoss | None = None

    @property
    def _optimiser(self) -> optax.GradientTransformation:
        usual = optax.cosine_decay_schedule(0.03, self.steps)
        return optax.adam(usual) if self.optimiser is None else self.optimiser

    def begin(self, z, rows, space=None):
        nothing = jnp.full((rows,), jnp.nan), jnp.full((rows, z.shape[0]), jnp.nan)
        best = (jnp.asarray(jnp.inf), z, *nothing)
        state = self._optimiser.init(z)
        return Iteration(z, (state, best), jnp.zeros((), jnp.int32), jnp.zeros((), bool))

    def advance(self, now, residual, matrix):
        state, best = now.kept
        cost = 0.5 * jnp.sum(residual**2)
        cost = jnp.where(jnp.isfinite(cost), cost, jnp.inf)
        here = (cost, now.z, residual, matrix)
        best = jax.tree.map(lambda a, b: jnp.where(cost < best[0], a, b), here, best)
        slope = jnp.where(jnp.isfinite(cost), matrix.T @ residual, 0.0)
        change, state = self._optimiser.update(slope, state, now.z)
        steps = now.steps + 1
        z: Any = optax.apply_updates(now.z, change)
        return Iteration(z, (state, best), steps, steps >= self.steps)

    def finish(self, space, now):
        cost, z, residual, matrix = now.kept[1]
        found = Sensitivity(space.names, jnp.where(jnp.isfinite(matrix), matrix, 0.0))
        seen = found.seen_directions()
        along = found.directions @ (found.matrix.T @ residual)
        along = along / jnp.where(seen, found.singular_values, 1.0)
        left = jnp.sqrt(jnp.sum(jnp.where(seen, along, 0.0) ** 2))
        near = jnp.isfinite(cost) & (left < self.tolerance)
        code = jnp.where(near, CODE["successful"], CODE["far_from_minimum"])
        code = jnp.where(jnp.isfinite(cost), code, CODE["start_not_finite"]).astype(jnp.int32)
        return Fit(space.values(z), residual, found, now.steps, space, code)
