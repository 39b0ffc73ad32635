"""Statements about one unknown before a fit."""

from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from .._argument_checks import check_arguments, flag, instance, number, or_none
from .._types import Given, Numeric
from .._validation import as_parameter, check_that, one_static, refusal


class Normal(eqx.Module):
    """Normal distribution with `mean` and standard deviation `sd`, in the unit of what it describes.

    **Raises** `ValueError`, `TypeError` for a `mean` that is not finite, an `sd` that is not positive.
    """

    mean: Float[Array, ""]
    sd: Float[Array, ""]

    @check_arguments(mean=number(), sd=number("positive"))
    def __init__(self, mean: Numeric, sd: Numeric):
        self.mean, self.sd = as_parameter(mean), as_parameter(sd)


Bounds = tuple[float | None, float | None]


class Unknown(eqx.Module):
    r"""A number to be estimated: where to start, where it may lie, and what is known of it.

    Methods see an unbounded coordinate $z$ instead of the value $p$:

    | bounds | value |
    |---|---|
    | none | $p = s z$ with the `scale` $s$ |
    | `(low, None)` | $p = \mathrm{low} + e^z$ |
    | `(None, high)` | $p = \mathrm{high} - e^z$ |
    | `(low, high)` | $p = \mathrm{low} + (\mathrm{high} - \mathrm{low})/(1 + e^{-z})$ |

    A plain positive number in place of an `Unknown` is one with the bounds `(0, None)`.

    >>> Unknown(-3.0, unit="N").bounds
    (None, None)
    >>> Unknown(2.0, bounds=(3.0, None))
    Traceback (most recent call last):
        ...
    ValueError: start = 2.0: it must be above bounds[0] = 3.0.

    **Arguments**

    - `start`: where a fit begins, strictly within the bounds; for `many_starts` a row.
    - `bounds`: numbers of Python, low and high; `None` for no bound.
    - `prior`: what is known before the data, a `Normal` of the value, or `None`. It is one more row of
      residuals, $(p - \mathrm{mean})/\mathrm{sd}$.
    - `unit`: of the value, for reports.
    - `per_record`: one value per record of a `Problem`, rather than one for all.
    - `scale`: a typical size of an unknown without bounds; by default the deviation of the prior, or
      the size of the start, or 1.

    **Raises** `ValueError`, `TypeError` for anything else.
    """

    start: Float[Array, "..."]
    bounds: Bounds = eqx.field(static=True)
    prior: Normal | None
    unit: str = eqx.field(static=True)
    per_record: bool = eqx.field(static=True)
    scale: Float[Array, ""] | None

    @check_arguments(
        start="finite", prior=or_none(instance(Normal, "a Normal or None")),
        unit=instance(str, "a text"), per_record=flag, scale=or_none(number("positive")),
    )  # fmt: skip
    def __init__(
        self,
        start: Numeric,
        bounds: Given[Bounds] = (None, None),
        prior: Given[Normal | None] = None,
        unit: str = "",
        per_record: bool = False,
        scale: Numeric | None = None,
    ):
        self.bounds = _pair(bounds)
        low, high = self.bounds
        if low is not None:
            check_that("start", start, lambda x: x > low, f"above bounds[0] = {low}")
        if high is not None:
            check_that("start", start, lambda x: x < high, f"below bounds[1] = {high}")
        self.start = as_parameter(start)
        self.prior, self.unit, self.per_record = prior, unit, per_record
        self.scale = None if scale is None else as_parameter(scale)


def _pair(bounds: Any) -> Bounds:
    if not isinstance(bounds, tuple | list) or len(bounds) != 2:
        raise refusal("bounds", bounds, "a pair (low, high), each a number or None", TypeError)
    low, high = (_bound(f"bounds[{i}]", b) for i, b in enumerate(bounds))
    if low is not None and high is not None and not low < high:
        raise refusal("bounds", bounds, "a pair with low < high")
    return low, high


def _bound(name: str, bound: Any) -> float | None:
    """A finite number of Python; an infinite one stands for none."""
    if bound is None:
        return None
    if isinstance(bound, np.floating | np.integer):
        bound = bound.item()
    one_static(name, bound, "any")
    return float(bound) if np.isfinite(bound) else None
