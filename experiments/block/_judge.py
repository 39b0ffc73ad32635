"""The paper's claims against the diagrams; B2 against branches of orbits."""

from typing import Any

import numpy as np
import xarray as xr

from stickslip.analysis import STATUS

from .._statement import Statement, Untold, Verdict, statement
from .._thresholds import Block

SIMPLE = "simplified"
READINGS = {"full, sign as printed": "printed sign", "full, consistent sign": "consistent sign"}
# Lanes whose points are those of the motion. `not_settled` ones are counted, and said, apart.
GOOD = [STATUS.index(word) for word in ("ok", "buffer_full")]
RAN = [*GOOD, *(STATUS.index(word) for word in ("not_settled", "too_few_points", "at_rest"))]


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

    Points more than `Block.APART` of the span of all points apart are in two clusters.
    """
    x = np.sort(np.asarray(_settled(dataset, model).x.transpose("k3", "point")), axis=1)
    told = told_lanes(dataset, model)
    if not told.any():
        return np.zeros(told.shape, int)
    span = np.nanmax(x[told]) - np.nanmin(x[told])
    gap = np.diff(x, axis=1) > Block.APART * span
    return np.where(told, gap.sum(axis=1) + 1, 0)


def is_chaos(exponent: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each exponent counts as chaos, and whether that can be said.

    It does above `Block.CHAOTIC` and its own spread. One above the former and within its spread may be
    either; so may one that is not a number.
    """
    exponent, spread = np.asarray(exponent, float), np.asarray(spread, float)
    finite = np.isfinite(exponent) & np.isfinite(spread)
    exponent, spread = np.where(finite, exponent, 0.0), np.where(finite, spread, np.inf)
    wild = exponent > np.maximum(Block.CHAOTIC, spread)
    return wild, finite & (wild | (exponent <= Block.CHAOTIC))


def chaos(dataset: xr.Dataset, model: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """k3 of the exponents, whether each counts as chaos, and whether that is known."""
    part = dataset.sel(model=model)
    return np.asarray(part.k3_exponent), *is_chaos(part.exponent, part.spread)


@statement("B1", f"The behaviour changes visibly over k3 in [{Block.K3_LOW:g}, {Block.K3_HIGH:g}].")
def changes(dataset: xr.Dataset, model: str) -> Verdict:
    """Lanes of more than two kinds, told by their numbers of branches."""
    told, number = told_lanes(dataset, model), branches(dataset, model)
    kinds = np.unique(number[told])
    part = _settled(dataset, model)
    failed = int((~np.isin(np.asarray(part.status), RAN)).sum())
    full = int((np.asarray(part.status) == STATUS.index("buffer_full")).sum())
    slow = float(np.asarray(part.slow_transient).mean())
    text = f"lanes with {kinds.min()} to {kinds.max()} branches" if kinds.size else "no lane is known"
    text += f"; {slow:.0%} of the lanes still approach their attractor; {failed} lanes failed"
    text += f"; {full} of {told.size} have more points than are kept" if full else ""
    # More than two kinds are a fact whatever the others do; that there are no more is not.
    many = told.sum() >= Block.FEWEST
    if many and kinds.size > Block.KINDS:
        return True, text
    return (False if many and told.mean() >= Block.ENOUGH else None), text


def first_doubling(dataset: xr.Dataset, model: str) -> float:
    """Least k3 [N/m] of a period doubling of the basic orbit at which it stops being stable.

    Raises `Untold` where there is none, or where the branch ends before it is known that there is none
    at lower k3.
    """
    at = list(map(str, dataset.model.values)).index(model)
    mine = (np.asarray(dataset.special_model) == at) & (np.asarray(dataset.special_doublings) == 0)
    labels, k3 = np.asarray(dataset.special_label)[mine], np.asarray(dataset.special_k3)[mine]
    if not (labels == "PD").any():
        raise Untold(f"no doubling of the basic orbit is on its branch ({reading(model)})")
    first = float(k3[labels == "PD"].min())
    orbits = (np.asarray(dataset.orbit_model) == at) & (np.asarray(dataset.orbit_doublings) == 0)
    before = np.asarray(dataset.orbit_k3)[orbits] < first
    stable = np.asarray(dataset.orbit_stable)[orbits].astype(bool)
    if not before.any() or not stable[before].all():
        raise Untold(f"the basic orbit is not stable below its first doubling ({reading(model)})")
    return first


@statement(
    "B2", "In the full model the first period doublings come at lower k3 than in the simplified one."
)
def doubles_earlier(dataset: xr.Dataset, model: str) -> Verdict:
    """First doublings of the full `model` and of the simplified one."""
    one, other = first_doubling(dataset, SIMPLE), first_doubling(dataset, model)
    return other < one, f"first doubling at k3 = {one:.6f} (simplified), {other:.6f} (full)"


def _chaos_of_both(dataset: xr.Dataset, model: str):
    """`chaos` of the simplified and the full model, and the words on exponents in doubt.

    Raises `Untold` where they are too few or too far apart.
    """
    if (
        "exponent" not in dataset
        or dataset.sizes["k3_exponent"] < Block.FEWEST
        or dataset.k3_exponent.diff("k3_exponent").max() > 1.001 * Block.FINE
    ):
        raise Untold(f"no exponents at a spacing of {Block.FINE:g} N/m or less")
    both = chaos(dataset, SIMPLE), chaos(dataset, model)
    doubt = [int((~told).sum()) for *_, told in both]
    size = dataset.sizes["k3_exponent"]
    tail = f"; {doubt[0]} and {doubt[1]} of {size} exponents are in doubt" if any(doubt) else ""
    return *both, doubt, tail


@statement("B3", "In the full model the regions of possible chaos are wider.")
def wider(dataset: xr.Dataset, model: str) -> Verdict:
    """Extent of chaos in both; open if the exponents in doubt could turn it."""
    (k3, a, _), (_, b, _), doubt, tail = _chaos_of_both(dataset, model)
    step = float(k3[1] - k3[0])
    text = f"chaos over {a.sum() * step:.2f} N/m (simplified), {b.sum() * step:.2f} N/m (full){tail}"
    return _either(b.sum() > a.sum() + doubt[0], b.sum() + doubt[1] > a.sum()), text


@statement(
    "B4",
    f"In both models chaos ends at almost the same threshold, about k3 = {Block.END_OF_CHAOS:g}.",
)
def ends_alike(dataset: xr.Dataset, model: str) -> Verdict:
    """Ends of chaos; open if the exponents in doubt could turn it."""
    simple, full, _, tail = _chaos_of_both(dataset, model)
    one, other = _ends(*simple), _ends(*full)
    text = f"chaos ends at k3 = {_number(one[0])} (simplified), {_number(other[0])} (full){tail}"
    near = (np.abs(one[:, None] - other) < Block.NEAR_END) & (
        np.abs(one[:, None] - Block.END_OF_CHAOS) < Block.NEAR_END
    )
    return _either(near.all(), near.any()), text


@statement(
    "B5", f"At k3 = {Block.SPECIAL:g} the simplified model is periodic and the full one chaotic."
)
def differ_at_special(dataset: xr.Dataset, model: str) -> Verdict:
    """Largest exponents there; open where one is in doubt."""
    exponents, verdicts = [], []
    for name in (SIMPLE, model):
        value, spread = (float(dataset[a].sel(model=name)) for a in ("exponent", "spread"))
        exponents.append(f"{value:.3f} ± {spread:.3f} 1/s")
        verdicts.append(is_chaos(np.array(value), Block.SPREADS * np.array(spread)))
    (wild, told), (full_wild, full_told) = verdicts
    denied = (told and wild) or (full_told and not full_wild)
    holds = False if denied else True if told and full_told else None
    return holds, f"largest exponent {exponents[0]} (simplified), {exponents[1]} (full)"


@statement("B6", "Periodic windows of the two models lie in different intervals of k3.")
def windows_differ(dataset: xr.Dataset, model: str) -> Verdict:
    """Part of the chaos of either that is periodic in the other."""
    (_, a, a_told), (_, b, b_told), _, tail = _chaos_of_both(dataset, model)
    both = a_told & b_told
    inside = (a | b) & both
    differ = float((a != b)[inside].mean()) if inside.any() else 0.0
    text = f"of the k3 where either is chaotic, {differ:.0%} are periodic in the other{tail}"
    known = inside.any() and both.mean() >= Block.ENOUGH
    return (differ > Block.DIFFERENT if known else None), text


def reading(model: str) -> str:
    """Which reading of the paper a model is."""
    return READINGS.get(model, model)


def is_found(dataset: xr.Dataset) -> bool:
    """Whether the parameters are those of a set that the search found."""
    return dataset.attrs.get("set", "A") != "A"


def _full_models(dataset: xr.Dataset) -> list[str]:
    return [model for model in map(str, dataset.model.values) if model != SIMPLE]


def judge_change(dataset: xr.Dataset) -> list[Statement]:
    """B1 for every model in the dataset."""
    models, found = map(str, dataset.model.values), is_found(dataset)
    return [changes(reading(model), dataset, model, found=found) for model in models]


def judge_models(dataset: xr.Dataset) -> list[Statement]:
    """B1, B3, B4 and B6 for each sign of the full model against the simplified one."""
    each = (wider, ends_alike, windows_differ)
    return judge_change(dataset) + [
        claim(reading(model), dataset, model, found=is_found(dataset))
        for model in _full_models(dataset)
        for claim in each
    ]


def judge_branches(dataset: xr.Dataset) -> list[Statement]:
    """B2 for each sign of the full model, from branches of orbits."""
    return [
        doubles_earlier(reading(model), dataset, model, found=is_found(dataset))
        for model in _full_models(dataset)
    ]


def judge_special(dataset: xr.Dataset) -> list[Statement]:
    """B5 for each sign of the full model."""
    return [
        differ_at_special(reading(model), dataset, model, found=is_found(dataset))
        for model in _full_models(dataset)
    ]


def _either(at_least: Any, at_most: Any) -> bool | None:
    """What holds if it does in the worst and in the best case alike."""
    return bool(at_least) if bool(at_least) == bool(at_most) else None


def _ends(k3: np.ndarray, wild: np.ndarray, told: np.ndarray) -> np.ndarray:
    """Where chaos ends, first, and where else it may if what is in doubt is chaos; NaN for none."""
    end = float(k3[wild].max()) if wild.any() else np.nan
    return np.array([end, *k3[~told & ~(k3 <= end)]])


def _number(value: float | None) -> str:
    return "none" if value is None or np.isnan(value) else f"{value:.2f}"
