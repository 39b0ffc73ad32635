"""Where the energy of a motion comes from and goes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type, refusal
from . import _axes

NEEDED = ("energy", "loss_at_events", "imbalance")


def energy_account(
    dataset: Given[xr.Dataset],
    *,
    ax: Given[Axes | Sequence[Axes] | None] = None,
    **options: Any,
) -> np.ndarray:
    """The energy of a motion, the works that changed it, and what the account leaves over.

    **Arguments**

    - `dataset`: of `stickslip.analysis.energy_ledger`.
    - `ax`: two axes to draw into; `options`: properties of the lines, as matplotlib calls them.

    **Returns** an array of two axes. Above: the gain of energy, the work of each power so far, and the
    sum of what events take, where they take some. Below: the imbalance, the error of the account.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("dataset", dataset, xr.Dataset, "a Dataset of analysis.energy_ledger")
    if not {*NEEDED} <= set(map(str, dataset.data_vars)) or dataset["energy"].dims != ("time",):
        allowed = f"of analysis.energy_ledger: with {', '.join(NEEDED)} over time"
        raise refusal("dataset", "a Dataset", allowed)
    axes, options = _axes.begin(ax, options, 2, [2.0, 1.0], linewidth=1.0)
    above, below = axes
    time, energy = np.asarray(dataset.time), np.asarray(dataset["energy"])
    above.plot(time, energy - energy[0], **{"color": "k", "label": "gain of energy", **options})
    for name in map(str, dataset.data_vars):
        if name.startswith("work_"):
            label = f"work of {name.removeprefix('work_')}"
            above.plot(time, np.asarray(dataset[name]), **{"label": label, **options})
    lost = np.asarray(dataset["loss_at_events"])
    if np.any(lost != 0.0):
        above.plot(time, lost, **{"label": "at events", "linestyle": "--", **options})
    below.plot(time, np.asarray(dataset["imbalance"]), **{"color": _axes.RED, **options})
    unit = dataset["energy"].attrs.get("units")
    above.set_ylabel(_axes.axis_label("energy", unit))
    below.set_ylabel(_axes.axis_label("left over", unit))
    below.set_xlabel(_axes.axis_label("t", dataset.time.attrs.get("units", "s")))
    if ax is None:
        _axes.legend(above)
    return axes
