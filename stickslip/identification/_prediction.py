"""Predictions of a record by a fit: the motion with bands, and how far the record is from it."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

from .._show import amount, html_table, number
from .._validation import refusal
from ..hybrid import jit_plainly
from ._accuracy import ACCURACY
from ._fit import Fit, coordinate_covariance
from ._record import Record
from ._run import Data, Run
from ._unknowns import Space

Rows = dict[str, np.ndarray]
BANDS = ("lower", "upper", "measured_lower", "measured_upper")


class Prediction(eqx.Module):
    r"""Observations of a record as a fit predicts them, and how well they are known.

    - `times` [s]; `mean`: rows by name, of the estimates themselves. NaN where the run fails.
    - `lower`, `upper`: ends of the band that the uncertainty of the unknowns makes;
      `measured_lower`, `measured_upper`: with the noise of a measurement added.
    - `level`: probability of each band at a single time. `units` by name. `record`: as it was measured.
    - `failed`: how many of the draws could not be run; 0 without draws.
    """

    times: np.ndarray
    mean: Rows
    lower: Rows
    upper: Rows
    measured_lower: Rows
    measured_upper: Rows
    level: float = eqx.field(static=True)
    units: dict[str, str] = eqx.field(static=True)
    record: Record
    failed: int = eqx.field(static=True, default=0)

    def __repr__(self) -> str:
        lost = f", {self.failed} draws failed" if self.failed else ""
        names = ", ".join(self.mean)
        return (
            f"Prediction: {names} at {amount(self.times.size, 'time')}, bands of {self.level:g}{lost}"
        )

    def to_dataset(self) -> xr.Dataset:
        """All rows over `time`: `x`, `x_lower`, `x_upper`, `x_measured_lower`, `x_measured_upper`."""
        parts = ("mean", *BANDS)
        columns = {
            name if part == "mean" else f"{name}_{part}": (
                "time",
                rows[name],
                {"units": self.units[name]},
            )
            for part in parts
            for rows in (getattr(self, part),)
            for name in rows
        }
        return xr.Dataset(columns, coords={"time": ("time", self.times, {"units": "s"})})

    def inside(self) -> dict[str, float]:
        """Share of the measured values that lie within the band of measurements, by name."""
        found = {}
        for name, values in self.record.values.items():
            there = self.record.present[name]
            low, high = self.measured_lower[name][there], self.measured_upper[name][there]
            found[name] = float(np.mean((low <= values[there]) & (values[there] <= high)))
        return found


class Score(eqx.Module):
    r"""How far a record is from the motion of a fit that runs freely from its start.

    By name, a row over the windows: `rms` error in the `units` of what is observed; `fit`, the part
    $1 - \|y - \hat y\|/\|y - \bar y\|$ of L. Ljung, System Identification (1999), 1 if all is
    explained, below 0 if a constant is better; `chi_squared`, the mean of $((y - \hat y)/\sigma)^2$.
    `windows` [s]: where they begin and end. NaN where nothing was measured or the run fails.
    """

    windows: np.ndarray
    rms: Rows
    fit: Rows
    chi_squared: Rows
    units: dict[str, str] = eqx.field(static=True)

    def _table(self) -> list[tuple[str, ...]]:
        return [
            (name, f"{number(begin)} to {number(end)}", number(self.rms[name][k]), self.units[name],
             number(self.fit[name][k]), number(self.chi_squared[name][k]))
            for name in self.rms
            for k, (begin, end) in enumerate(zip(self.windows[:-1], self.windows[1:], strict=True))
        ]  # fmt: skip

    def __repr__(self) -> str:
        lines = [
            f"{name}, {when} s: rms {rms}{' ' * bool(unit)}{unit}, fit {fit}, chi squared {chi}"
            for name, when, rms, unit, fit, chi in self._table()
        ]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        head = ("observed", "time [s]", "rms", "unit", "fit", "chi squared")
        return html_table("Score", head, self._table())


@jit_plainly
def _rows_and_slopes(run: Run, space: Space, z: Array, data: Data, record: Any) -> tuple[Array, Array]:
    """Observations of a record, and their derivatives by the coordinates of the unknowns."""

    def twice(z):
        rows = _observations(run, space, z, data, record)
        return rows, rows

    slopes, rows = jax.jacfwd(twice, has_aux=True)(z)
    return rows, slopes


@jit_plainly
def _rows_of_many(run: Run, space: Space, zs: Array, data: Data, record: Any) -> Array:
    return jax.vmap(lambda z: _observations(run, space, z, data, record))(zs)


def _observations(
    run: Run, space: Space, z: Array, data: Data, record: Any
) -> Float[Array, "observed time"]:
    values, inputs = run.of_record(space.values(z), data, record)
    one = jnp.asarray(data.times)[record], data.begin_of(record), inputs
    return run.one(values, one, log=False)[0]


def predict(
    problem: Any, fit: Fit, record: int, level: float, draws: int | None, seed: int, robust: bool
) -> Prediction:
    """`Problem.predict` of one of its own records."""
    run, data, space = problem._run, problem._data, fit.space
    z, where = space.coordinates(fit.values), jnp.asarray(record)
    rows, slopes = map(np.asarray, _rows_and_slopes(run, space, z, data, where))
    noise = data.deviations[:, None]
    if robust:
        noise = noise * max(float(fit.reduced_chi_squared), 1.0) ** 0.5
    failed, covariance = 0, np.asarray(coordinate_covariance(fit, robust))
    if draws is None:
        ends = _by_slopes(fit, covariance, rows, slopes, noise, level)
    else:
        rng = np.random.default_rng(seed)
        ends, failed = _by_draws(fit, covariance, run, data, where, noise, level, rng, draws)
    count = problem.records[record].times.size

    def by_name(rows):
        return {name: rows[i, :count] for i, name in enumerate(problem.observed)}

    units = {name: observed.unit for name, observed in problem.observed.items()}
    bands = dict(zip(BANDS, map(by_name, ends), strict=True))
    measured = problem.records[record]
    return Prediction(
        measured.times, by_name(rows), **bands, level=level, units=units, record=measured, failed=failed
    )


def _by_slopes(
    fit: Fit, covariance: Any, rows: Any, slopes: Any, noise: Any, level: float
) -> list[Any]:
    """Ends of both bands, of the linearised problem."""
    from scipy.stats import norm

    sensitivity = fit.sensitivity
    variance = np.einsum("...i,ij,...j", slopes, covariance, slopes)
    seen, directions = np.asarray(sensitivity.seen_directions()), np.asarray(sensitivity.directions)
    if not seen.all():
        # An unknown that no datum has seen may be anything, and with it all that depends on it.
        hidden = np.abs(slopes @ directions[~seen].T).max(axis=-1)
        lost = hidden > ACCURACY.part * np.linalg.norm(slopes, axis=-1)
        variance = np.where(lost, np.inf, variance)
    width = norm.ppf(0.5 + 0.5 * level)
    own, whole = width * np.sqrt(variance), width * np.sqrt(variance + noise**2)
    return [rows - own, rows + own, rows - whole, rows + whole]


def _by_draws(
    fit: Fit,
    covariance: Any,
    run: Run,
    data: Data,
    record: Any,
    noise: Any,
    level: float,
    rng: Any,
    draws: int,
) -> tuple[list[Any], int]:
    """Ends of both bands as quantiles of motions whose unknowns are drawn; how many of them failed."""
    sensitivity, z = fit.sensitivity, np.asarray(fit.space.coordinates(fit.values))
    if not np.all(np.asarray(sensitivity.seen_directions())):
        hidden = "with draws=None where the data do not see all unknowns"
        raise refusal("draws", draws, hidden)
    zs = rng.multivariate_normal(z, covariance, draws, method="eigh")
    found = np.asarray(_rows_of_many(run, fit.space, jnp.asarray(zs), data, record))
    good = np.all(np.isfinite(found), axis=(1, 2))
    if not good.any():
        return [np.full(found.shape[1:], np.nan)] * 4, draws
    found = found[good]
    sides = [0.5 - 0.5 * level, 0.5 + 0.5 * level]
    measured = found + noise * rng.normal(size=found.shape)
    ends = (*np.quantile(found, sides, axis=0), *np.quantile(measured, sides, axis=0))
    return list(ends), int(draws - good.sum())


def score(problem: Any, rows: Rows, record: int, after: float, windows: int) -> Score:
    """`Problem.score` of the motion whose observations are `rows`."""
    measured = problem.records[record]
    begin, end = float(measured.times[0]) + after, float(measured.times[-1])
    if not begin < end:
        raise refusal(
            "after", after, f"below {end - float(measured.times[0])} s, what the record lasts"
        )
    edges = np.linspace(begin, end, windows + 1)
    number = np.clip(np.searchsorted(edges, measured.times, side="right") - 1, 0, windows - 1)
    found: dict[str, Rows] = {"rms": {}, "fit": {}, "chi_squared": {}}
    for name, values in measured.values.items():
        counts = measured.present[name] & (measured.times >= begin)
        columns = [_errors(values, rows[name], counts & (number == k)) for k in range(windows)]
        rms, part = (np.array(column) for column in zip(*columns, strict=True))
        found["rms"][name], found["fit"][name] = rms, part
        found["chi_squared"][name] = (rms / float(problem.observed[name].sd)) ** 2
    units = {name: problem.observed[name].unit for name in measured.values}
    return Score(edges, **found, units=units)


def _errors(values: np.ndarray, model: np.ndarray, there: np.ndarray) -> tuple[float, float]:
    """Root mean square error, and the part of the variation that is explained."""
    if not there.any():
        return np.nan, np.nan
    off, spread = values[there] - model[there], values[there] - values[there].mean()
    whole = np.linalg.norm(spread)
    part = 1.0 - np.linalg.norm(off) / whole if whole > 0.0 else np.nan
    return float(np.sqrt(np.mean(off**2))), float(part)


def with_own(problem: Any, given: Any, after: float) -> dict[str, Any]:
    """The shared values, and those of the unknowns of a problem's one record: where they are not given,
    from what it measures before `after` [s]."""
    run, (record,) = problem._run, problem.records
    shared, own = {name: given[name] for name in run.shared}, dict(run.local)
    if all(part in given for parts in own.values() for part in parts):
        return dict(given)
    early = record.times < record.times[0] + after
    if not early.any():
        allowed = f"above 0: {', '.join(own)} of a further record are found from what comes before"
        raise refusal("after", after, allowed)
    begins = Record(
        record.times, record.values, inputs=record.inputs, begin=record.begin, name=record.name,
        missing={name: ~(there & early) for name, there in record.present.items()},
        known={**record.known, **shared},
    )  # fmt: skip
    unknowns = {name: problem.given[name] for name in own}
    found = type(problem)(
        run.system, run.initial_state, unknowns, problem.observed, begins, integrator=run.integrator,
        delay=run.delay, correct=run.correct,
    ).fit()  # fmt: skip
    return {**shared, **found.values}
