"""A map as the viewer sees it: a code with words over two coordinates, as basins of attraction."""

import pathlib

import numpy as np
import xarray as xr

from .._validation import check_in, refusal
from ._diagram import POINT, axis_label, meanings

ABSENT = "not computed"


def has_map(dataset: xr.Dataset) -> bool:
    """Whether a dataset has words of a code over two coordinates, and no points of a section."""
    return POINT not in dataset.dims and bool(_codes(dataset))


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

    - `parameters`: the coordinates, that across first; `x`, `y`: their values, increasing.
    - `words`, `number[y, x]`: of each cell, the place of its word; `beside`: further
      numbers by name, `(label, values[y, x])`.

    Errors: `ValueError` naming the path and the coordinate or code that is not as it must be.
    """

    def __init__(self, dataset: xr.Dataset, name: str, code: str | None = None):
        found = _codes(dataset)
        self.code = found[0] if code is None else check_in("observable", code, found)
        self.parameters = [str(dim) for dim in dataset[self.code].dims]
        self.title = str(dataset.attrs.get("title", dataset.attrs.get("name", pathlib.Path(name).name)))
        self.labels = [axis_label(key, dataset[key].attrs) for key in self.parameters]
        self.units = [str(dataset[key].attrs.get("units", "")) for key in self.parameters]
        across, up = self.parameters
        dataset = dataset.sortby([across, up])
        self.x, self.y = (np.asarray(dataset[key].values, np.float64) for key in (across, up))
        for key, values in ((across, self.x), (up, self.y)):
            if values.size < 2 or not np.all(np.diff(values) > 0.0) or not np.isfinite(values).all():
                what = f"a map whose coordinate {key} has two finite values or more, all different"
                raise refusal("path", name, what)
        words = [word.replace("_", " ") for word in meanings(dataset, self.code)]
        codes = dataset[self.code].transpose(up, across).values
        known = np.asarray(dataset[self.code].attrs.get("flag_values", range(len(words))))
        if known.shape != (len(words),):
            raise refusal(
                "path", name, f"a map with as many flag_values as flag_meanings of {self.code}"
            )
        at = np.argmax(codes[..., None] == known, axis=-1)
        lost = known[at] != codes
        if lost.any() and dataset.attrs.get("sweep_state", "finished") == "finished":
            raise refusal("path", name, f"a map with a word for each of its codes of {self.code}")
        self.words = [*words, ABSENT] if lost.any() else words
        self.number = np.where(lost, len(words), at)
        self.beside = {
            str(key): (axis_label(str(key), variable.attrs), variable.transpose(up, across).values)
            for key, variable in dataset.data_vars.items()
            if key != self.code and set(variable.dims) == {across, up} and variable.dtype.kind in "iuf"
        }

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
        more = [
            f"{label} {values[cell]:.5g}"
            for label, values in self.beside.values()
            if np.isfinite(values[cell])
        ]
        return ", ".join([f"{place}: {self.words[self.number[cell]]}", *more])

    def columns(self, most: int) -> dict[str, np.ndarray]:
        """Edges, middle, word and further numbers of each cell, evenly thinned to about so many."""
        each = most**0.5 if self.number.size > most else self.number.size
        rows, columns = (slice(None, None, int(np.ceil(n / each))) for n in self.number.shape)
        x, y, here = self.x[columns], self.y[rows], (rows, columns)
        left, right, bottom, top = *_edges(x), *_edges(y)
        found = {"left": left, "right": right, "x": x}
        found = {key: np.broadcast_to(row, (y.size, x.size)) for key, row in found.items()}
        for key, column in {"bottom": bottom, "top": top, "y": y}.items():
            found[key] = np.broadcast_to(column[:, None], (y.size, x.size))
        found["word"] = np.array(self.words)[self.number[here]]
        # By their number: a name may be that of another column.
        found |= {f"beside {k}": values[here] for k, (_, values) in enumerate(self.beside.values())}
        return {key: values.ravel() for key, values in found.items()}


def _edges(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper edges of cells around values: halfway to the next ones."""
    half = 0.5 * np.diff(values)
    return values - np.append(half[0], half), values + np.append(half, half[-1])
