"""The user's module: what computes an orbit, and a diagram of a region."""

import importlib
import os
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from .._validation import check_callable, refusal
from ._diagram import axis_label

HAS = "a module with a function `orbit(**point)` or `diagram(**ranges)`"


class Functions(NamedTuple):
    """Those of the two functions that the module has."""

    orbit: Callable[..., Any] | None
    diagram: Callable[..., Any] | None


class Motion(NamedTuple):
    """An orbit as the page draws it."""

    t: np.ndarray
    first: np.ndarray
    second: np.ndarray | None
    labels: tuple[str, str, str]  # of the axes: time, first and second


def import_functions(name: str, names: list[str]) -> Functions:
    """The functions of a module, which must take the parameters of these names.

    Errors: `ValueError` or `TypeError` naming the module or its function.
    """
    # As `python -m` does: a module of the user lies where the command is given.
    here = os.getcwd()
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        module = importlib.import_module(name)
    except Exception as error:  # whatever a module of the user does when it is imported
        text = " ".join(str(error).split())[:200]
        but = f"not imported ({type(error).__name__}: {text})"
        raise refusal("with", name, HAS, but=but) from error
    found = Functions(getattr(module, "orbit", None), getattr(module, "diagram", None))
    if found == (None, None):
        raise refusal("with", name, HAS)
    for key, function in found._asdict().items():
        if function is not None:
            call = f"{key}({', '.join(f'{part}=...' for part in names)})"
            check_callable(f"{name}.{key}", function, call, **dict.fromkeys(names))
    return found


def motion(dataset: Any, observable: str) -> Motion:
    """Observables of an orbit that are drawn: the diagram's or the first, and the next over it.

    Errors: `TypeError` or `ValueError` if `dataset` is not a Dataset over `time`.
    """
    what = "an xarray.Dataset over `time`, as `time_history` returns"
    if not isinstance(dataset, xr.Dataset):
        raise refusal("orbit(...)", dataset, what, TypeError)
    seen = [
        str(key)
        for key, variable in dataset.data_vars.items()
        if variable.dims == ("time",) and variable.dtype.kind == "f"
    ]
    if not seen or "time" not in dataset.coords:
        raise refusal("orbit(...)", sorted(map(str, dataset.variables)), what)
    first = observable if observable in seen else seen[0]
    second = next((key for key in seen if key != first), None)
    labels = (
        axis_label("time", dataset["time"].attrs),
        axis_label(first, dataset[first].attrs),
        "" if second is None else axis_label(second, dataset[second].attrs),
    )
    values = [np.asarray(dataset[key].values, np.float64) for key in ("time", first)]
    other = None if second is None else np.asarray(dataset[second].values, np.float64)
    return Motion(values[0], values[1], other, labels)
