"""The dataset of a file or of a sweep's store."""

import pathlib

import xarray as xr

from .._paths import the_directory
from .._validation import refusal
from ..sweep import open_dataset

ALLOWED = "a netCDF file or the store of a sweep"


def open_stored(path: str) -> xr.Dataset:
    """The dataset stored at `path`. Errors: `ValueError` naming the path."""
    place: pathlib.Path = the_directory("path", path, f"the path of {ALLOWED}")
    if place.is_dir():
        return open_dataset(place)
    if not place.is_file():
        raise refusal("path", path, f"{ALLOWED} that is there")
    try:
        # Times are numbers like any other.
        return xr.open_dataset(place, decode_times=False)
    except Exception as error:  # whatever the readers meet in files of another kind
        text = " ".join(str(error).split())[:80]
        raise refusal(
            "path", path, ALLOWED, but=f"unreadable ({type(error).__name__}: {text})"
        ) from error
