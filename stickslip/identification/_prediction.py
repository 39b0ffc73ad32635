"""Predictions of a record by a fit: the motion with bands, and how far the record is from it."""

from typing import Any, NamedTuple

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


class Part(NamedTuple):
    """Unknowns that one fit has found: coordinates of a record move by `moves` times theirs."""

    fit: Fit
    moves: np.ndarray


class Known(NamedTuple):
    """How well the unknowns of a record are known: their coordinates, and the parts that move them,
    which are independent of each other."""

    space: Space
    z: np.ndarray
    parts: list[Part]


def known_by(fit: Fit) -> Known:
    """The unknowns of a record that a fit has found all of."""
    z = np.asarray(fit.space.coordinates(fit.values))
    return Known(fit.space, z, [Part(fit, np.eye(z.size))])


def rows_and_slopes(problem: Any, space: Space, z: np.ndarray, record: int) -> list[np.ndarray]:
    """Observations of a record of a problem, and their derivatives by the coordinates."""
    where = jnp.asarray(record)
    found = _rows_and_slopes(problem._run, space, jnp.asarray(z), problem._data, where)
    return [np.asarray(a) for a in found]


def predict(
    problem: Any, known: Known, record: int, level: float, draws: int | None, seed: int, robust: bool
) -> Prediction:
    """`Problem.predict` of one of its own records."""
    rows, slopes = rows_and_slopes(problem, known.space, known.z, record)
    noise = problem._data.deviations[:, None]
    if robust:
        left = float(known.parts[0].fit.reduced_chi_squared)
        noise = noise * max(left, 1.0) ** 0.5
    failed = 0
    if draws is None:
        ends = _by_slopes(known, robust, rows, slopes, noise, level)
    else:
        zs = _coordinates_at_random(known, robust, np.random.default_rng(seed), draws)
        ends, failed = _by_draws(known.space, zs, problem, record, noise, level, seed)
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
    known: Known, robust: bool, rows: Any, slopes: Any, noise: Any, level: float
) -> list[Any]:
    """Ends of both bands, of the linearised problem."""
    from scipy.stats import norm

    variance = sum(_variance(part.fit, robust, slopes @ part.moves) for part in known.parts)
    width = norm.ppf(0.5 + 0.5 * level)
    own, whole = width * np.sqrt(variance), width * np.sqrt(variance + noise**2)
    return [rows - own, rows + own, rows - whole, rows + whole]


def _variance(fit: Fit, robust: bool, slopes: np.ndarray) -> Any:
    """Of what moves by `slopes` with the unknowns of a fit; infinite where no datum tells."""
    sensitivity = fit.sensitivity
    covariance = np.asarray(coordinate_covariance(fit, robust))
    variance = np.einsum("...i,ij,...j", slopes, covariance, slopes)
    seen, directions = np.asarray(sensitivity.seen_directions()), np.asarray(sensitivity.directions)
    if not seen.all():
        # An unknown that no datum has seen may be anything, and with it all that depends on it.
        hidden = np.abs(slopes @ directions[~seen].T).max(axis=-1)
        lost = hidden > ACCURACY.part * np.linalg.norm(slopes, axis=-1)
        variance = np.where(lost, np.inf, variance)
    return variance


def _coordinates_at_random(known: Known, robust: bool, rng: Any, draws: int) -> np.ndarray:
    """Rows of coordinates, of the normal distribution of each part."""
    zs = np.tile(known.z, (draws, 1))
    for fit, moves in known.parts:
        if not np.all(np.asarray(fit.sensitivity.seen_directions())):
            raise refusal("draws", draws, "with draws=None where the data do not see all unknowns")
        covariance = np.asarray(coordinate_covariance(fit, robust))
        zero = np.zeros(len(covariance))
        zs += rng.multivariate_normal(zero, covariance, draws, method="eigh") @ moves.T
    return zs


def _by_draws(
    space: Space, zs: np.ndarray, problem: Any, record: int, noise: Any, level: float, seed: int
) -> tuple[list[Any], int]:
    """Ends of both bands as quantiles of motions whose unknowns are drawn; how many of them failed."""
    where = jnp.asarray(record)
    found = np.asarray(_rows_of_many(problem._run, space, jnp.asarray(zs), problem._data, where))
    good = np.all(np.isfinite(found), axis=(1, 2))
    if not good.any():
        return [np.full(found.shape[1:], np.nan)] * 4, len(zs)
    found = found[good]
    sides = [0.5 - 0.5 * level, 0.5 + 0.5 * level]
    measured = found + noise * np.random.default_rng([seed, 1]).normal(size=found.shape)
    ends = (*np.quantile(found, sides, axis=0), *np.quantile(measured, sides, axis=0))
    return list(ends), int(len(zs) - good.sum())


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
