"""Sweeps that are refined where neighbours differ."""

import contextlib
import dataclasses
import pathlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from .._types import Given, NamedRows, Path
from .._validation import check_callable, check_count, one_static, refusal
from ..progress import Progress
from ._cells import Cells, Step, most_levels
from ._children import child, children
from ._compute import compute_rest
from ._describe import Described, describe
from ._files import read_json
from ._fit import VECTOR
from ._labels import Labels
from ._layout import Layout
from ._manifest import differences, identity
from ._read import dataset_so_far
from ._refined import LANE, OWN, Part, all_points, walk
from ._run import described_grid, in_memory
from ._store import Store, SweepMismatchError
from .evaluate import output_names, prepared
from .grid import check_grid, shard_shape
from .settings import Compute, Settings, Storage, settings_of


def refine_sweep(
    function: Given[Callable[..., Any]],
    grid: NamedRows,
    by: Given[Mapping[str, float]],
    *,
    levels: Given[int] = 4,
    max_points: Given[int] = 1_000_000,
    store: Path | Storage | None = None,
    labels: Given[Labels | None] = None,
    compute: Given[Compute | None] = None,
    part: Given[tuple[int, int] | None] = None,
) -> xr.Dataset:
    """Evaluate `function` on a grid, then between its points, again and again, where neighbours differ.

    ```python
    grid = {"speed": np.linspace(0.1, 1.0, 20), "load": np.linspace(1.0, 2.0, 10)}
    found = ss.sweep.refine_sweep(lane, grid, {"period": 0, "code": 0}, levels=5)
    ```

    A cell lies between two neighbouring values of one parameter, or four points of two. Where results
    at two points on it differ, it is halved along every axis, `levels` times. A boundary at which a
    result jumps is so enclosed in cells of the grid's width / 2**levels, and the number of points grows
    with its length, not with the area. When the sweep is finished, no cell is wider than that unless
    all points at its corners and on its edges are alike, or no number lies between its ends.

    Anything inside a cell whose points are all alike is not found: an island, or a pair of jumps,
    between neighbouring points of the grid. So take a grid that no feature of interest slips through.

    **Arguments**

    - `function(**point) -> pytree of arrays`: one lane, as for `run_sweep`. Parameters are real
      numbers: midpoints are taken of any.
    - `grid`: one or two parameters, each with two values or more that increase or decrease.
    - `by`: which results are compared, and by how much neighbours may differ: `0` for periods, modes,
      result codes and the like, `{"exponent": 0.05}` for a real number. An array differs if one of its
      elements does. NaN is like NaN and unlike every number, and an infinity is like itself: the border
      between lanes that fail and lanes that do not is refined too.
    - `levels`: how often a cell may be halved. A store may be gone on with more of them.
    - `max_points`: no step is begun that would lead to more points. Then the result is what there is,
      with a `RuntimeWarning` and its attribute `sweep_state` saying so.
    - `store`: as for `run_sweep`. It is that of the sweep over the grid, also if `run_sweep` made it,
      with a store for each step in its folder `refined`. Other tolerances or results in `by` need
      another store. Blocks of a step are no larger than they must be; workers share its blocks, so
      that many of them need a small `chunk`.
    - `labels`, `compute`: as for `run_sweep`.
    - `part`: as for `run_sweep`, of each step. The points of a step follow from all results before it,
      so that a call with a part ends where results of others are wanted: run the array of jobs again.

    **Returns** an `xarray.Dataset` in memory. With one parameter that is its dimension, in ascending
    order. With two the points lie along the dimension `lane`, both parameters beside it. `level` says
    which halving asked for a point, 0 for the grid: `found.isel(lane=found.level <= 2)` is what
    `levels=2` gives. The attribute `sweep_state` is `"finished"`, or says what is missing.

    **Errors** as `run_sweep`; `ValueError` for a grid of three parameters, results in `by` that the
    function does not have or that are not real, `max_points` below the points of the grid;
    `SweepMismatchError` if the store was refined by something else.
    """
    coords = _check_axes(grid)
    tolerances = _check_by(by)
    sizes = [axis.size for axis in coords.values()]
    check_count("levels", levels, 0, most_levels(sizes))
    check_count("max_points", max_points, int(np.prod(sizes)))
    settings = settings_of(store, labels, compute, part)
    check_callable("function", function, f"f({', '.join(coords)})", **coords)
    about = {"by": tolerances, "levels": levels, "max_points": max_points}
    with contextlib.ExitStack() as stack:
        stack.enter_context(Progress(settings.name, shown=settings.compute.progress))
        steps = _Steps(function, coords, settings, about, stack)
        found = walk(Cells(list(coords.values()), levels, tolerances), steps, max_points)
    if found.is_stopped:
        said = f"{settings.name}: {found.state}; what there is is kept."
        warnings.warn(said, RuntimeWarning, stacklevel=2)
    first = found.parts[0].attrs
    kept = {name: first[name] for name in ("sweep_verified",) if name in first}
    return all_points(found, list(coords), kept)


class _Listed(NamedTuple):
    """The lane function over a list of points, which are among its results."""

    function: Callable[..., Any]

    def __call__(self, lane: Any, **point: Any) -> dict[str, Any]:
        return {**point, **output_names(self.function(**point))}


class _Steps:
    """Computes one step after another: in memory, or in a store."""

    def __init__(self, function, coords, settings: Settings, about, stack: contextlib.ExitStack):
        self.function, self.coords, self.settings, self.about = function, coords, settings, about
        self._stack = stack
        self._program: Any = None
        self._grid = ""
        self._listed = prepared(_Listed(function))

    def __call__(self, number: int, step: Step | None, points: list[np.ndarray]) -> Part:
        settings, top = self.settings, self.settings.storage.directory
        title = settings.name if step is None else f"{settings.name}, level {step.level}"
        sweep = self._first() if step is None else self._next(number, step, points, title)
        if top is None:
            return Part(in_memory(sweep, settings, title), "finished")
        store = Store(
            child(top, number), sweep.layout, sweep.manifest, shared=settings.part is not None
        )
        # Who refines keeps others from the grid's store until the end.
        with contextlib.nullcontext() if step is None else store:
            if step is None:
                self._stack.enter_context(store)
            store.open(resume=settings.storage.resume or step is not None)
            compute_rest(sweep, store, settings, title)
        if step is None:
            self._grid = identity(store.manifest)
        dataset = dataset_so_far(store.path, store.manifest)
        return Part(dataset, dataset.attrs["sweep_state"])

    def _first(self) -> Described:
        sweep = described_grid(self.function, self.coords, self.settings, inputs={}, refine=self.about)
        _check_results(sweep.layout, self.about["by"])
        place = self.settings.storage.directory
        if place is not None and self.settings.storage.resume:
            _check_refined(place, self.about["by"])
        return sweep

    def _next(self, number: int, step: Step, points: list[np.ndarray], title: str) -> Described:
        storage, labels = self.settings.storage, self.settings.labels
        count = len(step.places)
        side = block_side(count, storage.lanes)
        shards = (side,) if storage.shard is None else shard_shape((count,), (side,), storage.shard)
        variables = {
            key: dataclasses.replace(label, dims=()) if key in self.coords else label
            for key, label in (labels.variables or {}).items()
        }
        settings = self.settings._replace(
            labels=dataclasses.replace(labels, variables=variables), name=title
        )
        about = {"of": self._grid, "number": number, "level": step.level, "by": self.about["by"]}
        sweep = describe(
            self._listed, {LANE: np.arange(count)}, settings, sides=(side,), shards=shards,
            inputs=dict(zip(self.coords, points, strict=True)), step=about, program=self._program,
        )  # fmt: skip
        self._program = sweep.program
        return sweep


def block_side(count: int, chunk: int) -> int:
    """Lanes of a block of `count` points: of few sizes, so that not each step is compiled anew."""
    side = VECTOR
    while side < min(count, chunk):
        side *= 2
    return min(side, chunk)


def _check_axes(grid: Any) -> dict[str, np.ndarray]:
    """The one or two parameters of the grid."""
    coords = check_grid(grid)
    if len(coords) > 2:
        raise refusal("grid", list(coords), "of one or two parameters")
    for name, values in coords.items():
        if name in OWN:
            raise refusal("grid", name, f"of parameters that are not called {' or '.join(OWN)}")
        steps = np.diff(values)
        if values.size < 2 or not (np.all(steps > 0) or np.all(steps < 0)):
            allowed = "two or more numbers that increase, each above the one before it, or decrease"
            raise refusal(f"grid[{name!r}]", grid[name], allowed)
    return coords


def _check_by(by: Any) -> dict[str, float]:
    """Tolerances by result."""
    such = "such as {'period': 0}"
    allowed = f"a mapping, not empty, from names of results to tolerances, {such}"
    if not isinstance(by, Mapping) or not by or not all(isinstance(name, str) for name in by):
        raise refusal("by", by, allowed, TypeError)
    return {
        name: float(one_static(f"by[{name!r}]", tolerance, "not negative"))
        for name, tolerance in by.items()
    }


def _check_results(layout: Layout, tolerances: Mapping[str, float]) -> None:
    """Raise unless all that is compared is there and real, and no name is one of ours."""
    for name, tolerance in tolerances.items():
        if name not in layout.outputs:
            known = ", ".join(map(repr, layout.outputs))
            raise refusal("by", name, f"of results of the function, which are {known}")
        kind = layout.outputs[name][1].kind
        if kind not in "fiub":
            raise refusal(f"by[{name!r}]", tolerance, "of a real result, not a complex one")
        if kind == "b" and tolerance >= 1:
            raise refusal(f"by[{name!r}]", tolerance, "below 1 for a result that is True or False")
    allowed = f"one without results or axes called {' or '.join(OWN)}"
    for name, (_, _, label) in layout.outputs.items():
        for word in (name, *label.dims):
            if word in OWN:
                raise refusal("function", word, allowed)


def _check_refined(path: pathlib.Path, tolerances: Mapping[str, float]) -> None:
    """Raise if steps in the store came from other results or tolerances, before anything changes."""
    for step in children(path):
        try:
            stored = read_json(step / "manifest.json")
        except (OSError, ValueError):
            continue  # what is wrong there is said once it is opened
        kept = stored.get("refine") if isinstance(stored, dict) else None
        found = differences(kept.get("by") if isinstance(kept, dict) else None, dict(tolerances), "by")
        if found:
            raise SweepMismatchError(
                f"store = {str(path)!r} was refined by something else: " + "; ".join(found)
                + ". Use another store, or replace this one with resume=False."
            )  # fmt: skip
