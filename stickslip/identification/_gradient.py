"""First-order methods of optax on the same problem."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax

from .._validation import check_positive, check_type
from ._fit import Fit
from ._sensitivity import Sensitivity
from ._unknowns import Values, checked, from_logs, to_logs, with_forward_slope


def gradient_descent(
    residual: Callable[[Values], Any],
    start: Any,
    *,
    optimiser: Any = None,
    steps: int = 300,
    tolerance: float = 0.1,
) -> Fit:
    r"""Minimise $\tfrac12\|r(p)\|^2$ by an optimiser of optax, in the logarithms of the unknowns.

    For noise in the objective, schedules and constraints of one's own; `least_squares` takes far fewer
    runs. The gradient is $J^T r$ with the Jacobian by forward mode through all events.

    **Arguments:** `residual`, `start` as for `least_squares`; `optimiser`, by default Adam with a rate
    that falls from 0.03 to 0 along a cosine; `steps`, how many; `tolerance`: a fit is successful if the
    minimum is nearer than this, in standard errors, by the linearised problem. **Returns** the best
    `Fit` on the way. **Raises** as `least_squares`, and `TypeError` for what is no optimiser.
    """
    start = checked("start", start)
    check_positive("steps", steps)
    check_positive("tolerance", tolerance)
    if optimiser is None:
        optimiser = optax.adam(optax.cosine_decay_schedule(0.03, int(steps)))
    check_type("optimiser", optimiser, optax.GradientTransformation, "an optimiser of optax")
    names = tuple(start)
    smooth = with_forward_slope(lambda z: residual(from_logs(names, z)))

    def evaluate(z):
        def twice(z):
            out = smooth(z)
            return out, out

        matrix, out = jax.jacfwd(twice, has_aux=True)(z)
        cost = 0.5 * jnp.sum(out**2)
        return jnp.where(jnp.isfinite(cost), cost, jnp.inf), out, matrix

    def one(i, carry):
        z, state, best = carry
        cost, out, matrix = evaluate(z)
        better = cost < best[0]
        best = jax.tree.map(lambda a, b: jnp.where(better, a, b), (cost, z, out, matrix), best)
        slope = jnp.where(jnp.isfinite(cost), matrix.T @ out, 0.0)
        change, state = optimiser.update(slope, state, z)
        return optax.apply_updates(z, change), state, best

    z = to_logs(start)
    shapes = jax.eval_shape(evaluate, z)
    worst = (jnp.asarray(jnp.inf), z, *(jnp.full(s.shape, jnp.nan) for s in shapes[1:]))
    carry = (z, optimiser.init(z), worst)
    _, _, (cost, z, out, matrix) = jax.lax.fori_loop(0, int(steps), one, carry)
    found = Sensitivity(names, jnp.where(jnp.isfinite(matrix), matrix, 0.0))
    seen = found.seen()
    along = found.directions @ (found.matrix.T @ out) / jnp.where(seen, found.singular_values, 1.0)
    left = jnp.sqrt(jnp.sum(jnp.where(seen, along, 0.0) ** 2))
    return Fit(
        from_logs(names, z),
        out,
        found,
        jnp.asarray(int(steps), jnp.int32),
        jnp.isfinite(cost) & (left < tolerance),
    )
