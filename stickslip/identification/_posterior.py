"""Draws from the posterior by the No-U-Turn sampler of blackjax."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Bool, Float

from .._argument_checks import callable_as, check_arguments, count
from .._compiled_once import compiled_once
from .._types import Given
from .._validation import refusal
from ..progress import showing
from ._accuracy import ACCURACY
from ._evaluate import with_operands
from ._fit import Fit, one_fit
from ._unknowns import NamedValues, Space

INSTALL = "pip install 'stickslip[posterior]'"


class Posterior(eqx.Module):
    """Draws of the unknowns.

    - `values`: by name `[chain, draw]`, each in its unit.
    - `divergent`: `[chain, draw]`, where the sampler's steps did not hold the energy; more than a few
      mean that the density has an edge or a narrow part that is not explored.
    - `r_hat`, `effective_draws` by name: near 1, and how many independent draws these are worth.
    - `space` of the unknowns.
    """

    values: dict[str, Float[Array, "chain draw"]]
    divergent: Bool[Array, "chain draw"]
    r_hat: dict[str, Float[Array, ""]]
    effective_draws: dict[str, Float[Array, ""]]
    space: Space

    @property
    def mean(self) -> NamedValues:
        """Means by name."""
        return {name: jnp.mean(rows) for name, rows in self.values.items()}

    @property
    def standard_deviation(self) -> NamedValues:
        """Standard deviations by name."""
        return {name: jnp.std(rows) for name, rows in self.values.items()}

    def to_dataset(self) -> xr.Dataset:
        """Draws by name over `chain` and `draw`, `divergent` beside them."""
        units = dict(zip(self.space.names, self.space.units, strict=True))
        columns = {
            name: (("chain", "draw"), np.asarray(rows), {"units": units[name]})
            for name, rows in self.values.items()
        }
        columns["divergent"] = (("chain", "draw"), np.asarray(self.divergent), {})
        return xr.Dataset(columns)

    def __str__(self) -> str:
        mean, deviation, lines = self.mean, self.standard_deviation, []
        for name, unit in zip(self.space.names, self.space.units, strict=True):
            value = f"{float(mean[name]):.6g} +- {float(deviation[name]):.2g}"
            worth = f"{float(self.effective_draws[name]):.0f} draws, R {float(self.r_hat[name]):.4f}"
            lines.append(f"{name} = {value}{' ' * bool(unit)}{unit} ({worth})")
        chains, draws = self.divergent.shape
        lost = int(np.sum(np.asarray(self.divergent)))
        return "\n".join([*lines, f"{chains} chains of {draws} draws, {lost} divergent"])

    __repr__ = __str__


@check_arguments(
    residual=callable_as("f(values)", {}), fit=one_fit, draws=count(2), warmup=count(50),
    chains=count(1), seed=count(0), max_doublings=count(1),
)  # fmt: skip
@showing("posterior")
def posterior(
    residual: Given[Callable[[NamedValues], Any]],
    fit: Given[Fit],
    *,
    draws: int = 1000,
    warmup: int = 500,
    chains: int = 4,
    seed: int = 0,
    max_doublings: int = 8,
) -> Posterior:
    r"""Sample the posterior of the unknowns, from the fit outwards.

    $$\ln p(\theta) = -\tfrac12\|r(\theta)\|^2 + \ln p_0(\theta) + \text{const},$$

    with the priors $p_0$ that the unknowns state, flat within the bounds where they state none: for a
    `Problem` this is `problem.log_density`. The chains run in the coordinates of the unknowns, with the
    Jacobian of the map, scaled by the sensitivity of the fit; the gradient is taken by forward mode
    through all events.

    **Arguments:** `residual`, as for the fit, e.g. `problem.residual_function`; `fit`, one that
    converged; numbers of `draws` and of steps of `warmup`, at least 50, for each of the `chains`;
    `seed`; `max_doublings` of a trajectory. **Returns** a `Posterior`. **Raises** `ImportError` without
    blackjax; `TypeError`, `ValueError` for anything else, and for a fit whose data do not see an
    unknown that has neither a prior nor two bounds: its posterior has no integral. It looks at the
    numbers of the fit and does not work under `jit`.

    Source: M. D. Hoffman, A. Gelman, The No-U-Turn Sampler, J. Mach. Learn. Res. 15 (2014) 1593.
    """
    if not bool(fit.successful):
        raise refusal("fit", str(fit), "a fit that converged")
    _check_proper(fit)
    try:
        import blackjax
    except ImportError as error:
        raise ImportError(f"posterior needs blackjax: {INSTALL}") from error
    space, z = fit.space, fit.space.coordinates(fit.values)
    consts, evaluation = with_operands(residual, space, z)
    keys = jax.random.split(jax.random.key(seed), chains)

    def run(z, scales, keys, consts):
        evaluate = evaluation(consts)

        def density(w):
            return _log_density(evaluate, space, z + scales @ w)

        def chain(key):
            first, adapt, sample = jax.random.split(key, 3)
            start = ACCURACY.chain_spread * jax.random.normal(first, z.shape)
            nuts: Any = blackjax.nuts
            adaptation: Any = blackjax.window_adaptation(
                nuts, density, target_acceptance_rate=ACCURACY.acceptance, initial_step_size=0.5,
                max_num_doublings=max_doublings,
            )  # fmt: skip
            (state, found), _ = adaptation.run(adapt, start, warmup)
            step = nuts(density, **found).step

            def one(state, key):
                state, info = step(key, state)
                return state, (state.position, info.is_divergent)

            return jax.lax.scan(one, state, jax.random.split(sample, draws))[1]

        places, divergent = jax.vmap(chain)(keys)
        values = space.values(z + jnp.einsum("ij,cdj->cdi", scales, places))
        return values, divergent

    r_hat, worth = {}, {}
    # Blackjax relies on JAX's implicit promotions, which a user may have switched off.
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        values, divergent = compiled_once(run, z, _scales(fit), keys, consts)
        for name, rows in values.items():
            pair = rows if chains > 1 else rows[:, : draws // 2 * 2].reshape(2, -1)
            r_hat[name] = blackjax.diagnostics.potential_scale_reduction(pair)
            worth[name] = blackjax.diagnostics.effective_sample_size(pair)
    return Posterior(values, divergent, r_hat, worth, space)


def _log_density(evaluate: Callable, space: Space, z: Array) -> Array:
    """Density of the coordinates, its gradient by the Jacobian that `evaluate` returns as well."""

    def stretch(z):
        return jnp.sum(jnp.log(jnp.abs(space.slopes(space.values(z)))))

    @jax.custom_vjp
    def density(z):
        return forward(z)[0]

    def forward(z):
        residual, matrix = evaluate(z)
        value = stretch(z) - 0.5 * jnp.sum(residual**2)
        slope = jax.grad(stretch)(z) - residual @ matrix
        good = jnp.isfinite(value) & jnp.all(jnp.isfinite(slope))
        # A run that fails has no density; the sampler turns back there.
        return jnp.where(good, value, -jnp.inf), jnp.where(good, slope, 0.0)

    density.defvjp(forward, lambda slope, bar: (bar * slope,))
    return density(z)


def _scales(fit: Fit) -> Array:
    """Coordinates of one standard deviation of each combination that the data see.

    One that they do not see has none, and gets a step of one.
    """
    values, directions = fit.sensitivity.singular_values, fit.sensitivity.directions
    return directions.T / jnp.maximum(values, 1.0)[None, :]


def _check_proper(fit: Fit) -> None:
    hidden = np.asarray(fit.sensitivity.directions)[~np.asarray(fit.sensitivity.seen_directions())]
    weight = np.max(np.abs(hidden), axis=0, initial=0.0)
    active = fit.active_bounds
    for i, name in enumerate(fit.names):
        low, high = fit.space.bounds[i]
        held = fit.space.priors[i] is not None or (low is not None and high is not None)
        if weight[i] > ACCURACY.part and not held and int(active[name]) == 0:
            allowed = "one whose data see every unknown that has neither a prior nor two bounds"
            raise refusal("fit", str(fit), allowed, but=f"this one does not see {name}")
