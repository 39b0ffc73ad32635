"""A diagram as the viewer sees it: which variable is drawn over which, and the words of its lanes."""

import pathlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from .._validation import check_in, refusal

POINT, SECTION = "point", "section"
LIKE = "a diagram as `stickslip.analysis.orbit_diagram` returns it"


class Lanes(NamedTuple):
    """The lanes of a diagram at one choice of the other coordinates."""

    x: np.ndarray  # (lane,)
    y: np.ndarray  # (lane, point), NaN where there is no point
    status: np.ndarray  # (lane,), place in `Diagram.words`
    period: np.ndarray  # (lane,)
    why: np.ndarray  # (lane,), place in `Diagram.reasons`

    def counts(self) -> np.ndarray:
        """Points of each lane, up to its last finite one."""
        finite = np.isfinite(self.y)
        last = self.y.shape[1] - np.argmax(finite[:, ::-1], axis=1)
        return np.where(finite.any(axis=1), last, 0)

    def points(self, lane: int) -> np.ndarray:
        """The points of a lane in the order of their times."""
        return self.y[lane, : self.counts()[lane]]

    def part(self, low: float, high: float) -> "Lanes":
        """Those with parameters from `low` to `high`."""
        inside = (self.x >= low) & (self.x <= high)
        return Lanes(*(values[inside] for values in self))

    def every(self, stride: int) -> "Lanes":
        """Every so many of them."""
        return Lanes(*(values[::stride] for values in self))

    def nearest(self, x: float) -> int:
        """The lane whose parameter is nearest."""
        return int(np.argmin(np.abs(self.x - x)))


class Diagram:
    """An observable over a parameter of a dataset, with what else can be chosen."""

    def __init__(
        self, dataset: xr.Dataset, name: str, *, x: str | None = None, observable: str | None = None
    ):
        seen = [
            str(key)
            for key, variable in dataset.data_vars.items()
            if POINT in variable.dims and variable.dtype.kind == "f"
        ]
        if not seen:
            have = ", ".join(f"{dim} ({n})" for dim, n in dataset.sizes.items()) or "none"
            raise refusal(
                "path", name, LIKE, but=f"without a number over `{POINT}`; dimensions: {have}"
            )
        if observable is not None:
            check_in("observable", observable, seen)
        # Time only grows: it is drawn if it was asked for.
        first = [key for key in seen if key != "t"] or seen
        self.observable = observable if observable is not None else first[0]
        self.observables = seen
        grid = [str(dim) for dim in dataset[self.observable].dims if dim != POINT]
        numeric = [key for key in grid if key in dataset.coords and dataset[key].dtype.kind in "iuf"]
        if not numeric:
            over = f"with {self.observable} over {', '.join(grid) or 'nothing'} and `{POINT}`"
            raise refusal("path", name, LIKE, but=f"{over}, no parameter with numbers")
        if x is not None:
            check_in("x", x, numeric)
        self.x = x if x is not None else max(numeric, key=lambda key: dataset.sizes[key])
        self.name = name
        self.dataset = dataset
        self.title = str(dataset.attrs.get("title", dataset.attrs.get("name", pathlib.Path(name).name)))
        self.others = {
            key: dataset[key].values.tolist()
            if key in dataset.coords
            else list(range(dataset.sizes[key]))
            for key in grid
            if key != self.x
        }
        # Arguments of the user's functions: neither a section nor the number of an array's element.
        recorded = SECTION if "sections" in dataset.attrs else None
        self.parameters = [key for key in grid if key in dataset.coords and key != recorded]
        if any(not dataset.sizes[key] for key in grid):
            raise refusal("path", name, f"{LIKE}, with at least one lane")
        values = np.asarray(dataset[self.x].values, np.float64)
        if not np.isfinite(values).all():
            raise refusal("path", name, f"{LIKE}, its parameter {self.x} finite")
        self.words = meanings(dataset, "status") or ("not stored",)
        self.reasons = meanings(dataset, "period_status") or ("not stored",)
        self.longest = int(_attribute(dataset, "period", "max_period", 0))

    @property
    def choices(self) -> int:
        """In how many ways the other coordinates can be chosen."""
        return int(np.prod([len(values) for values in self.others.values()], dtype=int))

    def lanes(self, chosen: Sequence[int]) -> Lanes:
        """The lanes where the other coordinates have their values of these numbers."""
        at = dict(zip(self.others, chosen, strict=True))
        part = self.dataset.isel({key: i for key, i in at.items() if key in self.dataset.dims})
        x = np.asarray(part[self.x].values, np.float64)
        y = np.asarray(part[self.observable].transpose(self.x, POINT).values, np.float64)

        def numbers(key: str, absent: int) -> np.ndarray:
            if key not in part or part[key].dims != (self.x,):
                return np.full(x.size, absent, np.int32)
            found = np.asarray(part[key].values, np.float64)
            # Where pieces of other sizes were joined, NaN stands for no lane.
            return np.where(np.isfinite(found), found, absent).astype(np.int32)

        status = np.clip(numbers("status", 0), 0, len(self.words) - 1)
        why = np.clip(numbers("period_status", 0), 0, len(self.reasons) - 1)
        return Lanes(x, y, status, numbers("period", -1), why)

    def point(self, x: float, chosen: Sequence[int]) -> dict[str, Any]:
        """All parameters of a lane by name, as functions of the user are given them."""
        others = zip(self.others.items(), chosen, strict=True)
        found = {self.x: x, **{key: values[i] for (key, values), i in others}}
        return {key: value for key, value in found.items() if key in self.parameters}

    def matching(self, other: "Diagram", chosen: Sequence[int]) -> list[int]:
        """The choice here that stands for one of another diagram; the first where it is not here."""
        there = zip(other.others.items(), chosen, strict=True)
        values = {key: found[i] for (key, found), i in there}
        return [
            found.index(values[key]) if values.get(key) in found else 0
            for key, found in self.others.items()
        ]

    def label(self, key: str) -> str:
        """Name of a variable for an axis, with its unit."""
        attrs = self.dataset[key].attrs if key in self.dataset else {}
        return axis_label(key, attrs)

    def about(self, x: float) -> str:
        """The parameter with its value and unit."""
        unit = str(self.dataset[self.x].attrs.get("units", ""))
        return f"{self.x} = {x:.7g}{'' if unit in ('', '1') else f' {unit}'}"

    def periods(self) -> dict[str, Any]:
        """Meanings of the numbers of `period`, for the words on the page."""
        most = f" up to {self.longest}" if self.longest else ""
        return {"none": f"no period{most}", "untold": "period unknown", "reasons": list(self.reasons)}

    def in_words(self, lanes: Lanes, lane: int) -> str:
        """Parameter, period and status of a lane in words."""
        period, words = int(lanes.period[lane]), self.periods()
        if period > 0:
            said = f"period {period}"
        elif period == 0:
            said = words["none"]
        else:
            reason = words["reasons"][lanes.why[lane]]
            said = f"{words['untold']} ({reason.replace('_', ' ')})"
        status = self.words[lanes.status[lane]].replace("_", " ")
        return f"{self.about(float(lanes.x[lane]))}: {said}, status {status}"


def axis_label(key: str, attrs: Any) -> str:
    """Name and unit for an axis. A dollar sign would have the page fetch a program for formulas."""
    unit = str(attrs.get("units", ""))
    text = str(attrs.get("long_name", key))
    return f"{text}{'' if unit in ('', '1') else f' [{unit}]'}".replace("$", "")


def meanings(dataset: xr.Dataset, key: str) -> tuple[str, ...]:
    """Words of the numbers of a variable, in the order of the numbers; none if it has none."""
    text = _attribute(dataset, key, "flag_meanings", "")
    return tuple(str(text).split())


def _attribute(dataset: xr.Dataset, key: str, attribute: str, absent: Any) -> Any:
    return dataset[key].attrs.get(attribute, absent) if key in dataset else absent
