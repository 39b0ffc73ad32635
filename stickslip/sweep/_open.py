"""The results in a store, also where further points follow from them."""

import os
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from .._paths import the_directory
from .._validation import check_flag, refusal
from ._cells import Cells
from ._children import child, is_begun
from ._layout import REFINE
from ._manifest import digest
from ._read import open_store
from ._refined import Part, Refined, all_points, walk


def open_dataset(path: str | os.PathLike, *, verify: bool = True) -> xr.Dataset:
    """The results in a store, read from disk when they are used.

    **Arguments**

    - `path`: the store of a `run_sweep` or a `refine_sweep`.
    - `verify`: compare every file with its checksum first. `False` reads what is there, also from a
      damaged store or one of an older format, as far as that goes.

    **Returns** an `xarray.Dataset`. Its attribute `sweep_state` is `"finished"` or, e.g.,
    `"unfinished: 3 of 8 blocks"`, where the others hold NaN, -1, 0 or `False`, and a code that has one
    of these among its `flag_values` the next number beyond them; `sweep_verified` is `"yes"` or `"no"`.
    (`run_sweep` returns the same with `"by size and age"`, see there.) A sweep that is refined is read
    into memory: all points that are known, as `refine_sweep` returns them.

    **Errors** `TypeError` if `path` is not a path, `ValueError` if it is not a store, or a file in
    it is not as it was written: the message names the file. `run_sweep` with the same arguments repairs
    most damage.
    """
    check_flag("verify", verify)
    path = the_directory("path", path)
    if not path.is_dir():
        raise refusal("path", str(path), "the directory of a sweep's store")
    first, manifest = open_store(path, verify)
    if manifest is None or REFINE not in manifest["attributes"]:
        return first
    found = refined_in(path, manifest, verify, first)
    about = {"sweep_verified": first.attrs["sweep_verified"]}
    return all_points(found, list(manifest["coordinates"]), about)


def refined_in(
    path: pathlib.Path, manifest: Mapping[str, Any], verify: bool, first: xr.Dataset | None = None
) -> Refined:
    """The steps of a refinement, as far as they are there; `ValueError` naming what is damaged."""
    about = manifest["attributes"][REFINE]
    names = list(manifest["coordinates"])
    first = open_store(path, verify)[0] if first is None else first

    def get(number, step, points):
        if step is None:
            return Part(first, first.attrs["sweep_state"])
        place = child(path, number)
        if not is_begun(place):
            return None
        dataset, known = open_store(place, verify)
        inputs = {name: digest(values) for name, values in zip(names, points, strict=True)}
        if known is not None and known["inputs"] != inputs:
            raise ValueError(
                f"path = {str(path)!r} holds points in {place.relative_to(path)} that do not follow "
                "from its results: it must be as refine_sweep left it; remove that folder and those "
                "after it, and the same sweep makes them again."
            )
        return Part(dataset, dataset.attrs["sweep_state"])

    axes = [np.asarray(first[name].values) for name in names]
    return walk(Cells(axes, about["levels"], about["by"]), get, about["max_points"])
