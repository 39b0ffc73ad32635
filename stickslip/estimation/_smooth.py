"""The smoother: states from all measurements, earlier and later."""

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from .._argument_checks import check_arguments, instance
from .._types import Given
from ..hybrid import jit_plainly
from ._kalman_filter import Filtered
from ._mode_after import mode_after
from ._state_estimate import StateEstimate


@check_arguments(filtered=instance(Filtered, "what kalman_filter returns"))
def smooth(filtered: Given[Filtered]) -> StateEstimate:
    r"""States at the stamps from all measurements, of which a filter has used the earlier ones.

    The numbers are those of Rauch, Tung and Striebel. Their gain $P\Phi^T(P^-)^{-1}$ does not exist
    behind a stick, so that they are computed backwards in time as Bryson and Frazier do, with the
    innovations $e$ and $A = 1 - KH$:

    $$\lambda \mapsto \Phi^T(A^T\lambda + H^TV^{-1}e), \quad
      \Lambda \mapsto \Phi^T(A^T\Lambda A + H^TV^{-1}H)\Phi, \quad
      y^s = y + P\lambda, \quad P^s = P - P\Lambda P$$

    where $\Phi$ goes through the events of the filter's mean. The mode of a smoothed state is that of the
    filter, unless the correction goes through a guard, as there.

    **Argument** `filtered`: a result of `kalman_filter`, of one run. **Returns** a `StateEstimate`; its
    last state is that of the filter. **Raises** `TypeError` for anything else.

    ??? cite "Reference"

        G. J. Bierman, "Fixed interval smoothing with discrete measurements", *Int. J. Control*
        18(1):65, 1973.
    """
    return _compiled(filtered)


def _smooth(filtered: Filtered) -> StateEstimate:
    estimate = filtered.estimate
    size = filtered.transitions.shape[-1]

    def back(carry, row):
        pull, gained = carry
        mean, covariance, before, off, spread, transition, slope = row
        smoothed = mean + covariance @ pull, covariance - covariance @ gained @ covariance
        off = jnp.where(jnp.isnan(off) & jnp.all(jnp.isfinite(mean)), 0.0, off)
        weighed = jnp.linalg.solve(spread, slope)
        kept = jnp.eye(size) - before @ slope.T @ weighed
        pull = transition.T @ (kept.T @ pull + weighed.T @ off)
        gained = transition.T @ (kept.T @ gained @ kept + slope.T @ weighed) @ transition
        return (pull, 0.5 * (gained + gained.T)), smoothed

    flat = jax.vmap(lambda y: ravel_pytree(y)[0])(estimate.means)
    rows = (
        flat, estimate.covariances, filtered.predicted.covariances, filtered.innovations,
        filtered.innovation_covariances, filtered.transitions, filtered.slopes,
    )  # fmt: skip
    start = (jnp.zeros(size), jnp.zeros((size, size)))
    _, (means, covariances) = jax.lax.scan(back, start, rows, reverse=True)
    _, unravel = ravel_pytree(jax.tree.map(lambda a: a[0], estimate.means))

    def mode_of(t, before, after, mode):
        return mode_after(estimate.system, t, before, after, mode, estimate.args)

    states = jax.vmap(unravel)(means)
    modes = jax.vmap(mode_of)(estimate.t, estimate.means, states, estimate.modes)
    return StateEstimate(estimate.t, states, covariances, modes, estimate.system, estimate.args)


_compiled = jit_plainly(_smooth)
