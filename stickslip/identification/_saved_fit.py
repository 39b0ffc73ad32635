"""Fits as files: written whole or not at all, read back to the last digit."""

import json
import os
import pathlib
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._netcdf import read_netcdf, write_netcdf
from .._types import Given
from .._validation import check_known, refusal
from .._version import __version__
from ._fit import CODES, Fit
from ._sensitivity import Sensitivity
from ._unknown import Normal
from ._unknowns import Space

if TYPE_CHECKING:
    import xarray as xr

FORMAT = "stickslip fit 1"
STATIC = ("names", "bounds", "units", "stated")  # of the space of the unknowns
VALUE, SCALE = "value of ", "scale of "


def save_fit(fit: Given[Fit], path: Given[str | os.PathLike]) -> pathlib.Path:
    """Write a fit, or a batch of them, to a netCDF file: `Fit.save`."""
    check_known("fit", fit)
    space, sensitivity = fit.space, fit.sensitivity
    columns = {
        "residual": (("row",), fit.residual), "steps": ((), fit.steps), "code": ((), fit.code),
        "matrix": (("row", "unknown"), sensitivity.matrix),
        "singular_values": (("direction",), sensitivity.singular_values),
        "directions": (("direction", "unknown"), sensitivity.directions),
    }  # fmt: skip
    columns |= {VALUE + name: ((), value) for name, value in fit.values.items()}
    columns |= {
        SCALE + n: ((), a) for n, a in zip(space.names, space.scales, strict=True) if a is not None
    }
    attributes = {name: json.dumps(getattr(space, name)) for name in STATIC}
    priors = [None if p is None else [float(p.mean), float(p.sd)] for p in space.priors]
    attributes |= {
        "priors": json.dumps(priors), "digest": fit.digest, "codes": json.dumps(CODES),
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


def load_fit(path: Given[str | os.PathLike]) -> Fit:
    """Read a fit that `Fit.save` wrote: all its numbers to the last digit, units, bounds and priors.

    What the unknowns belong to is not in the file: a `Problem` with the same unknowns predicts with
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
    )  # fmt: skip


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
