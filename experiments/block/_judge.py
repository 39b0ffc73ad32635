"""The paper's claims B1 to B6 against the diagrams."""

import numpy as np
import xarray as xr

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
SHORT = {"full, sign as printed": "printed sign", "full, consistent sign": "consistent sign"}


def _settled(dataset: xr.Dataset, model: str) -> xr.Dataset:
    name = "converged" if "converged" in dataset.protocol.values else "paper"
    return dataset.sel(model=model, protocol=name)


def branches(dataset: xr.Dataset, model: str) -> np.ndarray:
    """Number of clusters of the points of each lane: 5 % of the span of all points apart are two."""
    x = np.sort(np.asarray(_settled(dataset, model).x.transpose("k3", "point")), axis=1)
    span = np.nanmax(x) - np.nanmin(x)
    gap = np.diff(x, axis=1) > 0.02 * span
    return np.where(np.isfinite(x).any(axis=1), gap.sum(axis=1) + 1, 0)


def first_doubling(dataset: xr.Dataset, model: str) -> float | None:
    """Least k3 from which on, for 1 % of the window, there is more than one branch; None if none."""
    number, k3 = branches(dataset, model), np.asarray(dataset.k3)
    more = number > 1
    run = max(3, number.size // 100)
    for i in range(number.size - run):
        if more[i : i + run].all():
            return float(k3[i])
    return None


def chaos(dataset: xr.Dataset, model: str) -> tuple[np.ndarray, np.ndarray]:
    """k3 of the exponents, and whether each counts as chaos: above `CHAOTIC` and its own spread."""
    part = dataset.sel(model=model)
    return np.asarray(part.k3_exponent), np.asarray(part.exponent > np.maximum(CHAOTIC, part.spread))


def judge_change(dataset: xr.Dataset) -> list[Statement]:
    """B1 for every model in the dataset."""
    found = []
    for model in map(str, dataset.model.values):
        numbers = np.unique(branches(dataset, model))
        part = _settled(dataset, model)
        failed = int((np.asarray(part.status) != 0).sum())
        slow = float(np.asarray(part.slow_transient).mean())
        text = (
            f"lanes with {numbers.min()} to {numbers.max()} branches; {slow:.0%} of the lanes still "
            f"approach their attractor; {failed} lanes failed"
        )
        found.append(_statement("B1", model, bool(numbers.size > 2), text))
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
        found.append(_statement("B2", model, holds, text))
        if "exponent" not in dataset or dataset.k3_exponent.diff("k3_exponent").max() > 1.001 * FINE:
            text = f"no exponents at a spacing of {FINE:g} N/m or less"
            found += [_statement(i, model, None, text) for i in ("B3", "B4", "B6")]
            continue
        k3, a = chaos(dataset, simple)
        _, b = chaos(dataset, model)
        step = float(k3[1] - k3[0]) if k3.size > 1 else 0.0
        text = f"chaos over {a.sum() * step:.2f} N/m (simplified), {b.sum() * step:.2f} N/m (full)"
        found.append(_statement("B3", model, bool(b.sum() > a.sum()), text))
        ends = [float(k3[c].max()) if c.any() else np.nan for c in (a, b)]
        near = bool(abs(ends[0] - ends[1]) < 0.5 and abs(ends[0] - 95.1) < 0.5)
        text = f"chaos ends at k3 = {_number(ends[0])} (simplified), {_number(ends[1])} (full)"
        found.append(_statement("B4", model, near, text))
        inside = a | b
        differ = float((a != b)[inside].mean()) if inside.any() else 0.0
        text = f"of the k3 where either is chaotic, {differ:.0%} are periodic in the other"
        found.append(_statement("B6", model, differ > 0.2 if inside.any() else None, text))
    return found


def _number(value: float | None) -> str:
    return "none" if value is None or np.isnan(value) else f"{value:.2f}"
