"""The smoother: states from all measurements, earlier and later."""

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from .._argument_checks import check_arguments, instance
from .._types import Given
from ..hybrid import jit_plainly
from ._after_correction import after_correction
from ._kalman_filter import Filtered
from ._state_estimate import StateEstimate
from ._with_spread import WithSpread


@check_arguments(filtered=instance(Filtered, "what kalman_filter returns"))
def smooth(filtered: Given[Filtered]) -> StateEstimate:
    r"""States at the stamps from all measurements, of which a filter has used the earlier ones.

    The numbers are those of Rauch, Tung and Striebel, whose gain $P\Phi^T(P^-)^{-1}$ does not exist
    behind a stick. They are computed backwards in time as Bryson and Frazier do, with the innovations
    $e$, $A = 1 - KH$, and $\Phi$ through the events of the filter's mean:

    $$y^s = y + P\lambda, \quad P^s = P - P\Lambda P, \quad
      \lambda \mapsto \Phi^T(A^T\lambda + H^TV^{-1}e), \quad
      \Lambda \mapsto \Phi^T(A^T\Lambda A + H^TV^{-1}H)\Phi$$

    A mode is that of the filter, unless the correction goes through a guard, as there; after an event
    that a correction of the filter brought about, $A$ and what follows have its saltation matrix.

    **Argument** `filtered`: a result of `kalman_filter`, of one run. **Returns** a `StateEstimate`; its
    last state is that of the filter. **Raises** `TypeError` for anything else.

    ??? cite "Reference"

        G. J. Bierman, "Fixed interval smoothing with discrete measurements", *Int. J. Control*, 1973.
    """
    return _compiled(filtered)


def _smooth(filtered: Filtered) -> StateEstimate:
    estimate = filtered.estimate
    size = filtered.transitions.shape[-1]
    whole = WithSpread(estimate.system, jnp.zeros(size))

    def back(carry, row):
        pull, gained = carry
        y, covariance, mode, t, lasts, before, off, spread, transition, slope, jump = row
        flat, unravel = ravel_pytree(y)
        after = unravel(flat + covariance @ pull)
        after, event, mode = after_correction(whole, t, lasts, y, after, mode, estimate.args)
        narrowed = event @ (covariance - covariance @ gained @ covariance) @ event.T
        off = jnp.where(jnp.isnan(off) & jnp.all(jnp.isfinite(flat)), 0.0, off)
        weighed = jnp.linalg.solve(spread, slope)
        kept = jump - jump @ before @ slope.T @ weighed
        pull = transition.T @ (kept.T @ pull + weighed.T @ off)
        gained = transition.T @ (kept.T @ gained @ kept + slope.T @ weighed) @ transition
        return (pull, 0.5 * (gained + gained.T)), (unravel(after), narrowed, mode)

    rows = (
        estimate.means, estimate.covariances, estimate.modes, estimate.t,
        jnp.diff(estimate.t, prepend=estimate.t[:1]),
        filtered.predicted.covariances, filtered.innovations, filtered.innovation_covariances,
        filtered.transitions, filtered.slopes, filtered.jumps,
    )  # fmt: skip
    start = (jnp.zeros(size), jnp.zeros((size, size)))
    means, covariances, modes = jax.lax.scan(back, start, rows, reverse=True)[1]
    return StateEstimate(estimate.t, means, covariances, modes, estimate.system, estimate.args)


_compiled = jit_plainly(_smooth)
