"""Fits as files, written whole or not at all."""

import json
import os
import pathlib
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from .._netcdf import write_netcdf
from .._types import Given
from .._validation import check_known
from .._version import __version__

if TYPE_CHECKING:
    import xarray as xr

FORMAT = "stickslip fit 2"
STATIC = ("names", "bounds", "units", "stated")  # of the space of the unknowns
VALUE, SCALE = "value of ", "scale of "


def save_fit(fit: Any, codes: tuple[str, ...], path: Given[str | os.PathLike]) -> pathlib.Path:
    """Write a fit, or a batch of them, to a netCDF file: `Fit.save`. `codes`: names of its outcomes."""
    check_known("fit", fit)
    space, sensitivity = fit.space, fit.sensitivity
    columns = {
        "residual": (("row",), fit.residual), "steps": ((), fit.steps), "code": ((), fit.code),
        "matrix": (("row", "unknown"), sensitivity.matrix),
        "singular_values": (("direction",), sensitivity.singular_values),
        "directions": (("direction", "unknown"), sensitivity.directions),
    }  # fmt: skip
    if fit.instants is not None:
        columns["instants"] = ("datum",), fit.instants
    columns |= {VALUE + name: ((), value) for name, value in fit.values.items()}
    columns |= {
        SCALE + n: ((), a) for n, a in zip(space.names, space.scales, strict=True) if a is not None
    }
    attributes = {name: json.dumps(getattr(space, name)) for name in STATIC}
    priors = [None if p is None else [float(p.mean), float(p.sd)] for p in space.priors]
    attributes |= {
        "priors": json.dumps(priors), "digest": fit.digest, "codes": json.dumps(codes),
        "grid": json.dumps(fit.grid),
        "versions": json.dumps({"stickslip": __version__, "jax": jax.__version__}),
    }  # fmt: skip
    return write_netcdf(_dataset(columns, fit.units, attributes), path, FORMAT)


def _dataset(columns: dict, units: dict[str, str], attributes: dict[str, str]) -> "xr.Dataset":
    """Columns whose own axes are named, with axes of a batch before them."""
    import xarray as xr

    found = {}
    for name, (axes, array) in columns.items():
        array = np.asarray(array)
        batch = [f"batch_{k}" for k in range(array.ndim - len(axes))]
        unit = units.get(name.removeprefix(VALUE))
        found[name] = (*batch, *axes), array, {} if unit is None else {"units": unit}
    return xr.Dataset(found, attrs=attributes)
