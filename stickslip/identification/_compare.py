"""Fits of several models to the same data, side by side."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from .._argument_checks import check_arguments, flag, known_number
from .._types import Given, NamedRows
from .._validation import check_known, check_mapping, numbers, refusal, shape_refusal
from ._fit import Fit, one_fit

COLUMNS = {
    "unknowns": "number of unknowns", "chi_squared": "sum of the squared residuals",
    "aic": "Akaike's criterion", "aicc": "the same for short records", "bic": "Schwarz's criterion",
    "held_out": "root mean square of the error on held-out data",
}  # fmt: skip


class Comparison:
    """Table of fits, one row each: `table` by name of the column, `names` of the fits.

    Criteria are smaller for the better model, and only their differences mean something: from 10 on the
    worse one has no support. `held_out` is in `unit`, and `held_out_weighted` in standard deviations.
    """

    def __init__(self, names: tuple[str, ...], table: dict[str, np.ndarray], noise_known: bool):
        self.names, self.table, self.noise_known = names, table, noise_known

    def best(self, by: str = "bic") -> str:
        """Name of the fit with the least `by`, a column. **Raises** `ValueError` for another one."""
        if not isinstance(by, str) or by not in self.table or by == "unknowns":
            raise refusal("by", by, f"one of {', '.join(c for c in self.table if c != 'unknowns')}")
        return self.names[int(np.nanargmin(self.table[by]))]

    def to_dataset(self) -> xr.Dataset:
        """The table with the dimension `fit`."""
        columns = {name: ("fit", values) for name, values in self.table.items()}
        attributes = {"noise": "known" if self.noise_known else "estimated from the residuals"}
        return xr.Dataset(columns, {"fit": list(self.names)}, attributes)

    def __str__(self) -> str:
        width = max(len(name) for name in ("model", *self.names))
        heads = list(self.table)
        lines = ["  ".join([f"{'model':<{width}}", *(f"{h:>12}" for h in heads)])]
        for i, name in enumerate(self.names):
            cells = [f"{self.table[h][i]:>12.6g}" for h in heads]
            lines.append("  ".join([f"{name:<{width}}", *cells]))
        return "\n".join(lines)

    __repr__ = __str__


@check_arguments(sigma=known_number("positive"), noise_known=flag)
def compare(
    fits: Given[Mapping[str, Fit]],
    *,
    held_out: NamedRows | None = None,
    sigma: float = 1.0,
    noise_known: bool = True,
) -> Comparison:
    r"""Criteria and held-out scores of fits to the same data.

    With $n$ residuals, $p$ unknowns and $\chi^2 = \|r\|^2$ the misfit is $D = \chi^2$ where the noise
    is known, and $D = n\ln(\chi^2/n)$ where its standard deviation is one unknown more
    ($k = p + 1$ instead of $k = p$); of a `KalmanFilter` with `Fit.log_spread` added. Then
    AIC $= D + 2k$, AICc $=$ AIC $+ 2k(k+1)/(n-k-1)$, BIC $= D + k\ln n$. Use `noise_known=False` where
    the model's own errors outweigh the noise, which
    otherwise make every further unknown look well founded.

    **Arguments:** `fits` by name, with as many residuals each; `held_out`: by name the errors of each
    fit on data that it has not seen, in their own unit, NaN where missing; `sigma` of their noise, in
    that unit. **Returns** a `Comparison`. **Raises** `TypeError`, `ValueError` for anything else. It
    reads numbers and does not work under `jit`. Source: Burnham & Anderson, Model Selection and
    Multimodel Inference, sections 2.2 to 2.4 and 6.4.
    """
    allowed = "a mapping from names to Fits, not empty"
    if not isinstance(fits, Mapping) or not fits or not all(isinstance(k, str) for k in fits):
        raise refusal("fits", fits, allowed, TypeError)
    for name, fit in fits.items():
        one_fit(None, f"fits[{name!r}]", fit)
    rows = {name: np.asarray(fit.data_residual) for name, fit in fits.items()}
    sizes = {name: int(np.isfinite(row).sum()) for name, row in rows.items()}
    if len(set(sizes.values())) != 1:
        raise refusal("fits", fits, "fits to the same data", but=f"with residuals {sizes}")
    errors = rows_by_name("held_out", held_out)
    if not set(errors) <= set(fits):
        raise refusal("held_out", held_out, f"errors by names among {', '.join(fits)}", TypeError)
    n = next(iter(sizes.values()))
    table: dict[str, list[float]] = {name: [] for name in COLUMNS}
    for name, fit in fits.items():
        chi = float(np.nansum(rows[name] ** 2))
        count = len(fit.names)
        k = count if noise_known else count + 1
        misfit = float(fit.log_spread) + (chi if noise_known else n * np.log(chi / n))
        aic = misfit + 2 * k
        small = 2 * k * (k + 1) / (n - k - 1) if n > k + 1 else np.inf
        score = errors.get(name)
        values = (
            count, chi, aic, aic + small, misfit + k * np.log(n),
            np.nan if score is None else np.sqrt(np.nanmean(score**2)),
        )  # fmt: skip
        for column, value in zip(table, values, strict=True):
            table[column].append(float(value))
    arrays = {name: np.array(values) for name, values in table.items()}
    arrays["held_out_weighted"] = arrays["held_out"] / float(sigma)
    if not errors:
        del arrays["held_out"], arrays["held_out_weighted"]
    return Comparison(tuple(fits), arrays, noise_known)


def rows_by_name(name: str, given: Any) -> dict[str, np.ndarray]:
    """Rows of numbers, or one per record, by name, not all of them missing; none for `None`."""
    found = {}
    for key, row in check_mapping(name, given, "rows by name").items():
        where = f"{name}[{key!r}]"
        found[key] = numbers(where, check_known(where, row)).astype(np.float64)
        if found[key].ndim not in (1, 2) or not np.isfinite(found[key]).any():
            raise shape_refusal(where, row, "a row, or one per record, not all of it missing")
    return found
