"""Fits from files, read back to the last digit."""

import json
import os
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._netcdf import read_netcdf
from .._types import Given
from .._validation import refusal
from ._fit import CODES, Fit
from ._sensitivity import Sensitivity
from ._unknown import Normal
from ._unknowns import Space
from ._write_fit import FORMAT, SCALE, STATIC, VALUE

if TYPE_CHECKING:
    import xarray as xr


def load_fit(path: Given[str | os.PathLike]) -> Fit:
    """Read a fit that `Fit.save` wrote: all its numbers to the last digit, units, bounds and priors.

    The system of the unknowns is not in the file: a `Problem` with the same unknowns predicts with
    the fit (`Problem.predict`), also with other records. The file is plain netCDF, for
    `xarray.open_dataset` too.

    **Returns** the `Fit`. **Raises** `ValueError` for a file that is not such a fit, or is damaged;
    `TypeError` for a path that is none.
    """
    data = read_netcdf(path, FORMAT, "Fit.save")
    try:
        return _fit_of(data)
    except (KeyError, ValueError, TypeError) as error:
        raise refusal("path", str(path), "a file of Fit.save", but="damaged") from error


def _fit_of(data: "xr.Dataset") -> Fit:
    def array(name: str) -> Any:
        return jnp.asarray(np.asarray(data[name]))

    names, bounds, units, stated = (_tuples(json.loads(data.attrs[name])) for name in STATIC)
    priors = [None if p is None else Normal(*p) for p in json.loads(data.attrs["priors"])]
    scales = [array(SCALE + name) if SCALE + name in data else None for name in names]
    sensitivity = eqx.tree_at(
        lambda s: (s.singular_values, s.directions),
        Sensitivity(names, array("matrix")),
        (array("singular_values"), array("directions")),
    )
    code = np.asarray(data["code"])
    if json.loads(data.attrs["codes"]) != list(CODES) or not np.all((code >= 0) & (code < len(CODES))):
        raise ValueError("codes of another version")
    return Fit(
        {name: array(VALUE + name) for name in names}, array("residual"), sensitivity, array("steps"),
        Space(names, bounds, units, stated, tuple(scales), tuple(priors)), jnp.asarray(code),
        digest=str(data.attrs["digest"]),
        instants=array("instants") if "instants" in data else None,
        grid=_tuples(json.loads(data.attrs["grid"])),
    )  # fmt: skip


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
