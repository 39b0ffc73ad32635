"""A map as the viewer sees it: a code with words over two coordinates, as basins of attraction."""

import pathlib

import numpy as np
import xarray as xr

from .._validation import check_in, refusal
from ._diagram import axis_label, meanings


def has_map(dataset: xr.Dataset) -> bool:
    """Whether a dataset has words of a code over two coordinates, and no points of a section."""
    return bool(_codes(dataset)) and "point" not in dataset.dims


def _codes(dataset: xr.Dataset) -> list[str]:
    return [
        str(key)
        for key, variable in dataset.data_vars.items()
        if len(variable.dims) == 2
        and meanings(dataset, str(key))
        and all(dim in dataset.coords and dataset[dim].dtype.kind in "iuf" for dim in variable.dims)
    ]


class Map:
    """A code over two coordinates, the first if none is named, and what else is stored of its cells.

    - `parameters`: the coordinates, that across first; `x`, `y`: middles of the cells.
    - `words`, `number[y, x]`: of each cell, the place of its word; `beside`: further numbers by name.
    """

    def __init__(self, dataset: xr.Dataset, name: str, code: str | None = None):
        found = _codes(dataset)
        self.code = found[0] if code is None else check_in("observable", code, found)
        self.parameters = [str(dim) for dim in dataset[self.code].dims]
        self.title = str(dataset.attrs.get("title", dataset.attrs.get("name", pathlib.Path(name).name)))
        across, up = self.parameters
        self.x, self.y = (np.asarray(dataset[key].values, np.float64) for key in (across, up))
        for key, values in ((across, self.x), (up, self.y)):
            gaps = np.diff(values)
            if gaps.size == 0 or not np.all(gaps > 0) or np.ptp(gaps) > 1e-6 * gaps.mean():
                what = f"a map whose coordinate {key} grows evenly, over two values at least"
                raise refusal("path", name, what)
        self.labels = [axis_label(key, dataset[key].attrs) for key in self.parameters]
        self.units = [str(dataset[key].attrs.get("units", "")) for key in self.parameters]
        self.words = [word.replace("_", " ") for word in meanings(dataset, self.code)]
        codes = dataset[self.code].transpose(up, across).values
        known = np.asarray(dataset[self.code].attrs.get("flag_values", range(len(self.words))))
        at = np.argmax(codes[..., None] == known, axis=-1)
        if known.shape != (len(self.words),) or not np.all(known[at] == codes):
            raise refusal("path", name, f"a map with a word for each of its codes of {self.code}")
        self.number = at
        self.beside = {
            str(key): np.asarray(dataset[key].transpose(up, across).values, np.float64)
            for key, variable in dataset.data_vars.items()
            if key != self.code and set(variable.dims) == {across, up} and variable.dtype.kind in "iuf"
        }
        self.beside_labels = {key: axis_label(key, dataset[key].attrs) for key in self.beside}

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Row and column of the cell nearest to a place."""
        return int(np.argmin(np.abs(self.y - y))), int(np.argmin(np.abs(self.x - x)))

    def point(self, cell: tuple[int, int]) -> dict[str, float]:
        """The coordinates of a cell by name, as the user's function is given them."""
        values = float(self.x[cell[1]]), float(self.y[cell[0]])
        return dict(zip(self.parameters, values, strict=True))

    def in_words(self, cell: tuple[int, int]) -> str:
        """Coordinates and word of a cell, and what else is stored of it."""
        told = zip(self.point(cell).items(), self.units, strict=True)
        place = ", ".join(f"{key} = {value:.7g} {unit}".rstrip() for (key, value), unit in told)
        more = [f"{self.beside_labels[key]} {values[cell]:.5g}" for key, values in self.beside.items()]
        return ", ".join([f"{place}: {self.words[self.number[cell]]}", *more])
