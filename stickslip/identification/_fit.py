"""Results of a fit, and how it ends."""

import os
import pathlib
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._argument_checks import check_arguments, flag, instance, one_real
from .._outcome import in_words
from .._show import html_table, number
from .._types import Given, Numeric
from .._validation import check_type, is_concrete, refusal
from ..hybrid.status import item_of
from ._accuracy import ACCURACY
from ._robust import robust_covariance
from ._sensitivity import Sensitivity, errors_of
from ._unknowns import NamedValues, Space
from ._write_fit import save_fit


@in_words
class RESULTS(eqx.Enumeration):  # pyright: ignore[reportGeneralTypeIssues]
    """Outcome of a fit; `RESULTS[fit.result]` is the message."""

    successful = ""
    max_steps_reached = (
        "The fit, not a run, took all its steps before it converged. Give more to the method, as "
        "`LevenbergMarquardt(max_steps=...)`; start nearer, or see `fit.sensitivity` for combinations "
        "that the data do not see."
    )
    start_not_finite = (
        "The residual at the start is not finite: the run from there failed. Begin elsewhere."
    )
    step_not_finite = "A step could not be computed: the Jacobian is not finite."
    far_from_minimum = (
        "The optimiser took its steps, and the minimum is further away than `tolerance` standard "
        "errors. Give it more steps or another rate."
    )


CODES = ("successful", "max_steps_reached", "start_not_finite", "step_not_finite", "far_from_minimum")
CODE = {name: number for number, name in enumerate(CODES)}


def probability(owner: Any, name: str, value: Any) -> Any:
    """A probability, traced or not."""
    value = one_real(owner, name, value)
    if is_concrete(value) and not 0.0 < float(value) < 1.0:
        raise refusal(name, value, "above 0 and below 1")
    return value


class Fit(eqx.Module):
    """Estimates and how far to trust them; under `vmap` every array has the batch axes in front.

    - `values`: the estimates by name. `residual` there, in units of its standard deviation; rows of
      priors come last.
    - `sensitivity`: at the estimate. `steps`: iterations.
    - `space`: of the unknowns, with their bounds, units and priors.
    - `code`: why the method stopped; `result` is the item of `RESULTS`, whose message says it.
    - `digest` of the data of a `Problem`, empty otherwise. `save(path)`; `load_fit(path)` reads it.

    - `instants`: of a `Problem`, the number of the time at which each datum was measured, in the
      `grid` of (records, times). Otherwise the residuals are taken as one series in their order. Rows
      between those of the data and of the priors are the logarithms in a likelihood (`KalmanFilter`).

    How well the estimates are known: `standard_errors`, `interval`, `covariance`, `correlation`, by the
    linearised problem, rows and columns in the order of `names`; `cost`, `reduced_chi_squared`,
    `active_bounds`, `jacobian`. The first three trust the noise as stated. With `robust=True` they do
    not: residuals may be larger than stated and hang together in time, as those of a model that is not
    quite right do, and of filtered signals (`robust_covariance`).
    """

    values: dict[str, Float[Array, "*batch"]]
    residual: Float[Array, "*batch row"]
    sensitivity: Sensitivity
    steps: Int[Array, "*batch"]
    space: Space
    code: Int[Array, "*batch"]
    digest: str = eqx.field(static=True, default="")
    instants: Int[Array, "*batch datum"] | None = None
    grid: tuple[int, int] = eqx.field(static=True, default=(1, 0))

    def __str__(self) -> str:
        """Estimates with standard errors and units; of a batch, how many converged."""
        if not is_concrete(self):
            return f"Fit(traced, of shape {self.steps.shape})"
        if self.steps.ndim != 0:
            done, costs = np.asarray(self.successful), np.asarray(self.cost)
            return f"{done.size} fits, {done.sum()} converged, lowest cost {costs.min():.6g}"
        poor, active = self._poor(), self.active_bounds
        errors, stated = self.standard_errors(robust=poor), self.standard_errors()
        lines = []
        for name, unit in self.units.items():
            end = {0: "", -1: ", at its lower bound", 1: ", at its upper bound"}[int(active[name])]
            value = f"{float(self.values[name]):.6g} +- {float(errors[name]):.2g}"
            trusting = f" (by the stated noise {float(stated[name]):.2g})" if poor else ""
            lines.append(f"{name} = {value}{' ' * bool(unit)}{unit}{trusting}{end}")
        message = RESULTS[self.result] or "converged"
        rows = np.size(self.data_residual)
        lines.append(
            f"{message} after {int(self.steps)} steps; reduced chi squared "
            f"{float(self.reduced_chi_squared):.4g} of {rows} residuals"
        )
        if poor:
            lines.append(
                "the residuals are far above their noise: another minimum (try more starts), another "
                "model, or more noise than stated; the standard errors are robust ones, which see how "
                "large the residuals are and how long they hang together, and no error of the model"
            )
        return "\n".join(lines)

    def _poor(self) -> bool:
        """Whether the residuals of one fit, which is known, are far above their noise."""
        return float(self.reduced_chi_squared) > ACCURACY.poor_fit

    __repr__ = __str__

    def _repr_html_(self) -> str:
        if not is_concrete(self) or self.steps.ndim != 0:
            return html_table(str(self), (), ())
        errors, active = self.standard_errors(robust=self._poor()), self.active_bounds
        ends = {0: "", -1: "lower", 1: "upper"}
        rows = []
        for name, unit in self.units.items():
            value, error = number(self.values[name]), f"{float(errors[name]):.2g}"
            rows.append((name, value, error, unit, ends[int(active[name])]))
        kind = "robust standard error" if self._poor() else "standard error"
        head = ("unknown", "estimate", kind, "unit", "at its bound")
        said = str(self).split("\n")[len(rows) :]
        return html_table("; ".join(said), head, rows)

    def save(self, path: Given[str | os.PathLike]) -> pathlib.Path:
        """Write the fit to a netCDF file, whole or not at all, from which `load_fit` reads it.

        **Returns** the path. **Raises** `TypeError` for a path that is none, `ValueError` for a fit
        that is traced, `OSError` of the file system.
        """
        return save_fit(self, CODES, path)

    @property
    def successful(self) -> Bool[Array, "*batch"]:
        """Whether it converged, which does not say that it explains the data: `reduced_chi_squared`."""
        return self.code == CODE["successful"]

    @property
    def result(self) -> Any:
        """Item of `identification.RESULTS`."""
        return item_of(RESULTS, CODES, self.code)

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns, in the order of rows and columns: alphabetical."""
        return self.space.names

    @property
    def units(self) -> dict[str, str]:
        """Units by name, as the unknowns state them."""
        return dict(zip(self.space.names, self.space.units, strict=True))

    @property
    def slopes(self) -> Float[Array, "*batch unknown"]:
        """Derivatives of the values by the coordinates in which the methods work."""
        return self.space.slopes(self.values)

    @property
    def jacobian(self) -> Float[Array, "*batch row unknown"]:
        """Derivatives of the residual by the values; zero by a value that lies at its bound."""
        slopes = self.slopes[..., None, :]
        free = slopes != 0.0
        return jnp.where(free, self.sensitivity.matrix / jnp.where(free, slopes, 1.0), 0.0)

    @property
    def active_bounds(self) -> NamedValues:
        """By name -1 or +1 where an estimate lies at its lower or upper bound, otherwise 0."""
        return self.space.active(self.values, self.standard_errors())

    @property
    def data_residual(self) -> Float[Array, "*batch datum"]:
        """The residual without the rows of logarithms and priors."""
        return self.residual[..., : self._num_data]

    @property
    def _num_data(self) -> int:
        if self.instants is not None:
            return self.instants.shape[-1]
        return self.residual.shape[-1] - self.space.num_priors

    @property
    def log_spread(self) -> Float[Array, "*batch"]:
        r"""$\sum 2\ln(s_i/\sigma_i)$ of the innovations of a `KalmanFilter`, 0 without it: with the
        squares of the residuals of the data, $-2\ln L$ but for a constant."""
        first, last = self._num_data, self.residual.shape[-1] - self.space.num_priors
        return jnp.sum(self.residual[..., first:last] ** 2, axis=-1) - 0.5 * (last - first)

    @property
    def cost(self) -> Float[Array, "*batch"]:
        r"""$\tfrac12\|r\|^2$; infinite where the residual is not finite."""
        cost = 0.5 * jnp.sum(self.residual**2, axis=-1)
        return jnp.where(jnp.isfinite(cost), cost, jnp.inf)

    @property
    def reduced_chi_squared(self) -> Float[Array, "*batch"]:
        r"""$\|r\|^2/(n - p)$ of $n$ residuals and $p$ unknowns; near 1 if the noise is as assumed."""
        rows = self._num_data + self.space.num_priors
        others = 0.5 * (self.residual.shape[-1] - rows) + self.log_spread
        return (2.0 * self.cost - others) / (rows - len(self.sensitivity.names))

    @check_arguments(robust=flag)
    def standard_errors(self, robust: bool = False) -> NamedValues:
        """Standard error of every estimate, in its own unit; infinite if the data do not see it.

        **Arguments:** `robust`, whether without trust in the stated noise.
        """
        relative = errors_of(self.sensitivity, coordinate_covariance(self, robust))
        slopes = jnp.abs(self.slopes)
        return {name: relative[name] * slopes[..., i] for i, name in enumerate(relative)}

    @check_arguments(level=probability, robust=flag)
    def interval(self, level: Numeric = 0.95, robust: bool = False) -> NamedValues:
        r"""Wald interval of every estimate, `[*batch, 2]`, lower end first, in its own unit.

        $p \pm z\sigma$ with the quantile $z$ of the normal distribution and the standard error of the
        linearised problem, cut off at the bounds of the unknown; infinite where the data do not see it
        and no bound is there. `profile` follows the curvature. **Arguments** `level`, above 0 and
        below 1; `robust` as for `standard_errors`.
        """
        width = jnp.sqrt(2.0) * jax.scipy.special.erfinv(jnp.asarray(level, jnp.float64))
        errors = self.standard_errors(robust)
        ends = jnp.asarray([-1.0, 1.0]) * width
        found = {}
        for name, (low, high) in zip(self.space.names, self.space.bounds, strict=True):
            row = jnp.expand_dims(self.values[name], -1) + ends * jnp.expand_dims(errors[name], -1)
            found[name] = jnp.clip(row, low, high)
        return found

    def correlation(self) -> Float[Array, "*batch unknown unknown"]:
        """Correlation of the estimates, to first order; NaN for unknowns that the data do not see.

        Rows and columns are in the order of `names`.
        """
        matrix, errors = self.covariance(), self.standard_errors()
        seen = jnp.stack([jnp.isfinite(errors[name]) for name in self.names], axis=-1)
        variance = jnp.diagonal(matrix, axis1=-2, axis2=-1)
        size = jnp.sqrt(jnp.where(seen & (variance > 0), variance, jnp.nan))
        return matrix / size[..., :, None] / size[..., None, :]

    @check_arguments(robust=flag)
    def covariance(self, robust: bool = False) -> Float[Array, "*batch unknown unknown"]:
        """Covariance of the values, to first order; combinations not seen are left out of it.

        Rows and columns are in the order of `names`. **Arguments:** `robust` as for `standard_errors`.
        """
        slopes = self.slopes
        return slopes[..., :, None] * coordinate_covariance(self, robust) * slopes[..., None, :]


def coordinate_covariance(fit: Fit, robust: bool) -> Float[Array, "*batch unknown unknown"]:
    """Covariance of the coordinates in which the methods work."""
    bread, priors = fit.sensitivity.covariance(), fit.space.num_priors
    if not robust:
        return bread
    instants, grid = fit.instants, fit.grid
    if instants is None:
        rows = fit.residual.shape[-1] - priors
        instants, grid = jnp.arange(rows), (1, rows)
    instants = jnp.broadcast_to(instants, (*fit.steps.shape, instants.shape[-1]))

    def one(bread, matrix, residual, instants):
        return robust_covariance(bread, matrix, residual, priors, instants, grid)

    for _ in fit.steps.shape:
        one = jax.vmap(one)
    return one(bread, fit.sensitivity.matrix, fit.residual, instants)


def one_fit(owner: Any, name: str, value: Any) -> Any:
    """A single fit whose numbers are known."""
    check_type(name, value, Fit, "a Fit")
    if not is_concrete(value) or value.steps.ndim != 0:
        raise refusal(name, value, "one fit, known: call this outside of jit and vmap")
    return value


@check_arguments(fits=instance(Fit, "a Fit"))
def best(fits: Given[Fit]) -> Fit:
    """The fit of least cost; `fits` as from `many_starts`.

    **Raises** `TypeError` for anything else, `ValueError` for a single fit.
    """
    if fits.steps.ndim != 1:
        raise refusal("fits", fits, "one row of fits", but=f"of shape {fits.steps.shape}")
    row = jnp.argmin(fits.cost)
    return jax.tree.map(lambda a: a[row] if eqx.is_array(a) else a, fits)
