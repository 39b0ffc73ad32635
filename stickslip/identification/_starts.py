"""Many starts spread over the space of the unknowns."""

from typing import Any

import numpy as np

from .._argument_checks import check_arguments, count, static_number
from ._unknowns import NamedUnknowns, scalars


@check_arguments(count=count(1), spread=static_number("positive"), seed=count(0))
def sobol_starts(
    unknowns: NamedUnknowns, count: int, *, spread: float = 2.0, seed: int = 0
) -> dict[str, np.ndarray]:
    """Starts for `many_starts` that fill the space of the unknowns evenly: a scrambled Sobol sequence.

    An unknown with two finite bounds is spread evenly between them; one with a prior as the prior is,
    within the bounds; any other within a factor `spread` of its start, or of its distance from the
    bound, on both sides; without bounds within `spread` times its scale. The first start is the
    unknowns' own.

    **Arguments:** `unknowns` as for `least_squares`; `count`; `spread`, above 1; `seed`.
    **Returns** rows of values by name: for a `Problem`, `problem.fit(starts=...)` and `fits(rows)` keep
    bounds, units and priors; for `many_starts` each row belongs into its `Unknown` again, for plain
    rows are of positive unknowns. **Raises** `TypeError`, `ValueError` for anything else.
    """
    from scipy.stats import norm, qmc

    space, first = scalars("unknowns", unknowns)
    sobol: Any = qmc.Sobol  # `seed` is called `rng` in new versions, which take both
    points = sobol(len(space.names), seed=seed).random(2 ** int(np.ceil(np.log2(count + 1))))
    points = np.clip(points[:count], 1e-3, 1.0 - 1e-3)
    found = {}
    for i, name in enumerate(space.names):
        value, u = float(first[name]), points[:, i]
        low, high = space.bounds[i]
        prior = space.priors[i]
        if prior is not None:
            row = float(prior.mean) + float(prior.sd) * norm.ppf(u)
        elif low is not None and high is not None:
            row = low + (high - low) * u
        elif low is not None or high is not None:
            bound: Any = low if high is None else high
            row = bound + (value - bound) * spread ** (2.0 * u - 1.0)
        else:
            row = value + float(space.scales[i]) * spread * (2.0 * u - 1.0)
        row = _inside(row, low, high, value)
        row[0] = value
        found[name] = row
    return found


def _inside(row: np.ndarray, low: float | None, high: float | None, value: float) -> np.ndarray:
    """Rows of a prior may lie beyond the bounds: those come back to the start."""
    good = np.ones(row.shape, bool)
    if low is not None:
        good &= row > low
    if high is not None:
        good &= row < high
    return np.where(good, row, value)
