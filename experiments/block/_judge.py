"""The paper's claims B1 to B6 against the diagrams."""

from typing import Any

import numpy as np
import xarray as xr

from stickslip.analysis import STATUS

from .._experiment import Statement

CLAIMS = {
    "B1": "The behaviour changes visibly over k3 in [72, 97].",
    "B2": "In the full model the first period doublings come at lower k3 than in the simplified one.",
    "B3": "In the full model the regions of possible chaos are wider.",
    "B4": "In both models chaos ends at almost the same threshold, about k3 = 95.1.",
    "B5": "At k3 = 87.968 the simplified model is periodic and the full one chaotic.",
    "B6": "Periodic windows of the two models lie in different intervals of k3.",
}
CHAOTIC = 0.02  # [1/s] an exponent above this, and above its own spread, counts as chaos
FINE = 0.1  # [N/m] exponents farther apart than this say nothing on the extent of chaos
APART = 0.02  # part of the span of all points: points farther apart are two branches
ENOUGH = 0.9  # part of the lanes, or of the exponents, that must be told for a statement on all
FEWEST = 10  # lanes, below which nothing is said on a diagram
SHORT = {"full, sign as printed": "printed sign", "full, consistent sign": "consistent sign"}
# Lanes whose points are those of the motion. `not_settled` ones are counted, and said, apart.
GOOD = [STATUS.index(word) for word in ("ok", "buffer_full")]


def _settled(dataset: xr.Dataset, model: str) -> xr.Dataset:
    name = "converged" if "converged" in dataset.protocol.values else "paper"
    return dataset.sel(model=model, protocol=name)


def told_lanes(dataset: xr.Dataset, model: str) -> np.ndarray:
    """Whether each lane ran, has points, and these are of its attractor."""
    part = _settled(dataset, model)
    seen = np.isfinite(np.asarray(part.x.transpose("k3", "point"))).any(axis=1)
    slow = np.asarray(part.slow_transient).astype(bool)
    return np.isin(np.asarray(part.status), GOOD) & seen & ~slow


def branches(dataset: xr.Dataset, model: str) -> np.ndarray:
    """Number of clusters of the points of each lane, 0 where that cannot be told.

    Points more than 2% of the span of all points apart are in two clusters.
    """
    x = np.sort(np.asarray(_settled(dataset, model).x.transpose("k3", "point")), axis=1)
    told = told_lanes(dataset, model)
    if not told.any():
        return np.zeros(told.shape, int)
    span = np.nanmax(x[told]) - np.nanmin(x[told])
    gap = np.diff(x, axis=1) > APART * span
    return np.where(told, gap.sum(axis=1) + 1, 0)


def first_doubling(dataset: xr.Dataset, model: str) -> float | None:
    """Least k3 from which on, for 1 % of the window, there is more than one branch; None if none.

    Lanes that cannot be told are passed over; None too if they are more than a tenth.
    """
    number, k3 = branches(dataset, model), np.asarray(dataset.k3)
    known = number > 0
    if known.sum() < FEWEST or known.mean() < ENOUGH:
        return None
    more, k3 = number[known] > 1, k3[known]
    run = max(3, more.size // 100)
    for i in range(more.size - run + 1):
        if more[i : i + run].all():
            return float(k3[i])
    return None


def is_chaos(exponent: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each exponent counts as chaos, above `CHAOTIC` and its own spread, and whether it tells.

    One above `CHAOTIC` and within its spread may be either; so may one that is not a number.
    """
    exponent, spread = np.asarray(exponent, float), np.asarray(spread, float)
    finite = np.isfinite(exponent) & np.isfinite(spread)
    exponent, spread = np.where(finite, exponent, 0.0), np.where(finite, spread, np.inf)
    wild = exponent > np.maximum(CHAOTIC, spread)
    return wild, finite & (wild | (exponent <= CHAOTIC))


def chaos(dataset: xr.Dataset, model: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """k3 of the exponents, whether each counts as chaos, and whether it tells."""
    part = dataset.sel(model=model)
    return np.asarray(part.k3_exponent), *is_chaos(part.exponent, part.spread)


def judge_change(dataset: xr.Dataset) -> list[Statement]:
    """B1 for every model in the dataset."""
    found = []
    for model in map(str, dataset.model.values):
        told, number = told_lanes(dataset, model), branches(dataset, model)
        kinds = np.unique(number[told])
        part = _settled(dataset, model)
        failed = int((~np.isin(np.asarray(part.status), [*GOOD, STATUS.index("not_settled")])).sum())
        slow = float(np.asarray(part.slow_transient).mean())
        text = (
            f"lanes with {kinds.min()} to {kinds.max()} branches" if kinds.size else "no lane tells"
        ) + f"; {slow:.0%} of the lanes still approach their attractor; {failed} lanes failed"
        # More than two kinds are a fact whatever the others do; that there are no more is not.
        many = told.sum() >= FEWEST
        holds = None
        if many and kinds.size > 2:
            holds = True
        elif many and told.mean() >= ENOUGH:
            holds = False
        found.append(_statement("B1", model, holds, text))
    return found


def _statement(id: str, model: str, holds: bool | None, measured: str) -> Statement:
    variant = SHORT.get(model, model)
    return Statement(f"{id} ({variant})", CLAIMS[id], holds, measured)


def judge_models(dataset: xr.Dataset) -> list[Statement]:
    """B1 to B4 and B6 for each sign of the full model against the simplified one."""
    found = judge_change(dataset)
    simple = "simplified"
    for model in (str(m) for m in dataset.model.values if m != simple):
        one, other = first_doubling(dataset, simple), first_doubling(dataset, model)
        low = float(dataset.k3[0])
        # Two branches from the start may be a doubling below the window or a second crossing per cycle.
        if one is None or other is None or low in (one, other):
            holds = None
        else:
            holds = bool(other < one)
        text = f"more than one branch from k3 = {_number(one)} (simplified), {_number(other)} (full)"
        if low in (one, other):
            text += ", the window's edge: a doubling below it or a second crossing per cycle"
        for name in (simple, model):
            share = told_lanes(dataset, name).mean()
            if share < ENOUGH:
                text += f"; only {share:.0%} of the lanes tell ({SHORT.get(name, name)})"
        found.append(_statement("B2", model, holds, text))
        if (
            "exponent" not in dataset
            or dataset.sizes["k3_exponent"] < FEWEST
            or dataset.k3_exponent.diff("k3_exponent").max() > 1.001 * FINE
        ):
            text = f"no exponents at a spacing of {FINE:g} N/m or less"
            found += [_statement(i, model, None, text) for i in ("B3", "B4", "B6")]
            continue
        found += _judge_chaos(model, chaos(dataset, simple), chaos(dataset, model))
    return found


def _judge_chaos(model: str, simple, full) -> list[Statement]:
    """B3, B4 and B6 from k3, chaos, and what is told of it; open if that could turn the verdict."""
    (k3, a, a_told), (_, b, b_told) = simple, full
    step = float(k3[1] - k3[0])
    doubt = [int((~told).sum()) for told in (a_told, b_told)]
    tail = f"; {doubt[0]} and {doubt[1]} of {k3.size} exponents do not tell" if any(doubt) else ""
    text = f"chaos over {a.sum() * step:.2f} N/m (simplified), {b.sum() * step:.2f} N/m (full){tail}"
    holds = _either(b.sum() > a.sum() + doubt[0], b.sum() + doubt[1] > a.sum())
    found = [_statement("B3", model, holds, text)]
    one, other = _ends(k3, a, a_told), _ends(k3, b, b_told)
    text = f"chaos ends at k3 = {_number(one[0])} (simplified), {_number(other[0])} (full){tail}"
    near = (np.abs(one[:, None] - other) < 0.5) & (np.abs(one[:, None] - 95.1) < 0.5)
    found.append(_statement("B4", model, _either(near.all(), near.any()), text))
    both = a_told & b_told
    inside = (a | b) & both
    differ = float((a != b)[inside].mean()) if inside.any() else 0.0
    text = f"of the k3 where either is chaotic, {differ:.0%} are periodic in the other{tail}"
    known = inside.any() and both.mean() >= ENOUGH
    found.append(_statement("B6", model, differ > 0.2 if known else None, text))
    return found


def _either(at_least: Any, at_most: Any) -> bool | None:
    """What holds if it does in the worst and in the best case alike."""
    return bool(at_least) if bool(at_least) == bool(at_most) else None


def _ends(k3: np.ndarray, wild: np.ndarray, told: np.ndarray) -> np.ndarray:
    """Where chaos ends, first, and where else it may if what does not tell is chaos; NaN for none."""
    end = float(k3[wild].max()) if wild.any() else np.nan
    return np.array([end, *k3[~told & ~(k3 <= end)]])


def _number(value: float | None) -> str:
    return "none" if value is None or np.isnan(value) else f"{value:.2f}"
