"""The paper's claim B2 against period doublings that were located on branches of periodic orbits."""

import numpy as np
import xarray as xr

from .._statement import Statement, Untold, Verdict, statement
from ._judge import SIMPLE, is_found, reading


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


def judge_branches(dataset: xr.Dataset) -> list[Statement]:
    """B2 for each sign of the full model."""
    return [
        doubles_earlier(reading(model), dataset, model, found=is_found(dataset))
        for model in map(str, dataset.model.values)
        if model != SIMPLE
    ]
