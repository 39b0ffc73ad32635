"""Files of one dataset: written whole or not at all, read with a word on what is wrong with them."""

import os
import pathlib
from typing import TYPE_CHECKING, Any

from ._validation import refusal

if TYPE_CHECKING:
    import xarray as xr


def path_of(path: Any) -> pathlib.Path:
    """A path. Raises `TypeError` for anything else."""
    if not isinstance(path, str | os.PathLike) or not os.fspath(path):
        raise refusal("path", path, "the path of a file", TypeError)
    return pathlib.Path(path)


def write_netcdf(dataset: "xr.Dataset", path: Any, form: str) -> pathlib.Path:
    """Write a dataset of the format `form`; whoever interrupts this finds the old file, or none."""
    path = path_of(path)
    temporary = path.with_name(path.name + ".part")
    try:
        dataset.assign_attrs(stickslip=form).to_netcdf(temporary, engine="h5netcdf")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def read_netcdf(path: Any, form: str, writer: str) -> "xr.Dataset":
    """Read what `write_netcdf` wrote on behalf of `writer`.

    Raises `ValueError` naming `path` for a file that is missing, damaged or of another format.
    """
    import xarray as xr

    path, allowed = path_of(path), f"a file of {writer}"
    if not path.is_file():
        raise refusal("path", str(path), allowed, but="no file")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            data = opened.load()
    except Exception as error:  # whatever the reader meets in a file that nobody has verified
        raise refusal("path", str(path), allowed) from error
    found = str(data.attrs.get("stickslip", ""))
    if found != form:
        but = f"of the format {found!r}" if found else ""
        raise refusal("path", str(path), f"{allowed} of the format {form!r}", but=but)
    return data
