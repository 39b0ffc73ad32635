"""Where the lanes of a diagram start: which parts of the state are theirs, which are shared by all."""

import itertools
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import PyTree

from .._validation import check_finite, leaves_of, refusal, shape_refusal
from ..hybrid import AbstractHybridSystem
from ..hybrid.components import components_of, own_axes
from ._accuracy import ACCURACY


class Starts(NamedTuple):
    """Initial states of a grid of lanes."""

    y0: PyTree  # one state for all; or with the axes of the grid in front of every leaf
    per_lane: bool
    first: PyTree  # that of the first lane

    def flat(self, shape: tuple[int, ...]) -> PyTree:
        """State every lane starts from, flat over the grid."""
        lanes = math.prod(shape)

        def rows(leaf: Any) -> np.ndarray:
            tail = np.shape(leaf)[len(shape) :] if self.per_lane else np.shape(leaf)
            return np.broadcast_to(leaf, (*shape, *tail)).reshape(lanes, *tail)

        return jax.tree.map(rows, self.y0)


def starts_of(
    y0: PyTree,
    coords: Mapping[str, np.ndarray],
    takes: Callable[[PyTree], Any],
    reads: Callable[[PyTree], Any],
) -> Starts:
    """Initial states over the grid.

    A leaf whose shape begins with that of the grid has a value for each lane, any other is shared.
    `takes(state)` raises the system's error for a state that does not fit it, `reads(state)` that of
    the observables and sections. Where both ways of reading a leaf pass, this raises, unless
    the dimensions of a DataArray decide.
    """
    grid = tuple(v.size for v in coords.values())
    found = leaves_of("y0", y0)
    if not found:
        raise refusal("y0", y0, "a state with at least one component")
    said = [_by_dimensions(name, leaf, coords) for name, leaf in found]
    leaves = [np.asarray(check_finite(name, a), np.float64) for (name, _), (a, _) in zip(
        found, said, strict=True)]  # fmt: skip
    form = jax.tree.structure(y0)
    # A leaf is open where its shape alone says that it may have a value for each lane.
    may = [a.ndim >= len(grid) and a.shape[: len(grid)] == grid for a in leaves]
    rule = [m if own is None else own for m, (_, own) in zip(may, said, strict=True)]
    open_ = [i for i, (m, (_, own)) in enumerate(zip(may, said, strict=True)) if m and own is None]

    def of_first(lanes: list[bool]) -> PyTree:
        picked = [a[(0,) * len(grid)] if own else a for a, own in zip(leaves, lanes, strict=True)]
        # A number of Python where it is one, as most states are given.
        return jax.tree.unflatten(form, [a if np.ndim(a) else float(a) for a in picked])

    chosen = rule
    if any(np.shape(a) for a in leaves):
        ways = _readings(rule, open_)
        fits, trouble = _possible_readings(takes, ways, [of_first(lanes) for lanes in ways])
        if len(fits) > 1:
            fits = _possible_readings(reads, fits, [of_first(lanes) for lanes in fits])[0] or fits
        if not fits:
            shapes = sorted({a.shape for a in leaves})
            allowed = f"of the system's own shapes, the grid's shape {grid} in front for one per lane"
            some = f"with components of shapes {shapes} ({_short(trouble)})"
            raise refusal("y0", y0, allowed, but=some) from trouble
        chosen = fits[0]
        for other in fits[1:]:
            # More axes than the grid has say enough where the rule can be followed.
            doubt = [i for i in open_ if other[i] != chosen[i]]
            doubt = [i for i in doubt if chosen != rule or leaves[i].ndim == len(grid)]
            if doubt and len(doubt) == sum(a != b for a, b in zip(other, chosen, strict=True)):
                raise _two_ways(*found[doubt[0]], coords)
    per_lane = any(chosen)
    if per_lane:
        spread = [
            a if own else np.broadcast_to(a, (*grid, *a.shape))
            for a, own in zip(leaves, chosen, strict=True)
        ]
        whole = jax.tree.unflatten(form, spread)
    else:
        whole = of_first(chosen)
    return Starts(whole, per_lane, of_first(chosen))


def _possible_readings(
    judge: Callable[[PyTree], Any], readings: list[list[bool]], states: list[PyTree]
) -> tuple[list[list[bool]], Exception | None]:
    """The ways of reading that raise nothing, and the error of the first of the others."""
    fits, trouble = [], None
    for lanes, state in zip(readings, states, strict=True):
        try:
            judge(state)
        except Exception as error:  # whatever is said to a state of other shapes than expected
            trouble = trouble or error
        else:
            fits.append(lanes)
    return fits, trouble


def _short(error: Exception | None) -> str:
    return " ".join(str(error).split())[:200]


def _two_ways(name: str, leaf: Any, coords: Mapping[str, np.ndarray]) -> Exception:
    dims = ", ".join(map(repr, coords))
    allowed = (
        "told apart, since the system takes it both as a number per lane and as an array for all: "
        f"xarray.DataArray(values, dims=[{dims}]) is per lane, with other dims it is shared"
    )
    return shape_refusal(name, leaf, allowed)


def _readings(rule: list[bool], open_: list[int]) -> list[list[bool]]:
    """Ways of reading the leaves, the rule first; of many leaves all at once and one by one."""
    if len(open_) <= ACCURACY.open_leaves:
        flips = [c for n in range(len(open_) + 1) for c in itertools.combinations(open_, n)]
    else:
        ones = [(i,) for i in open_]
        flips = [(), tuple(open_), *ones, *(tuple(j for j in open_ if (j,) != i) for i in ones)]
    return [[own != (i in flip) for i, own in enumerate(rule)] for flip in flips]


def _by_dimensions(name: str, leaf: Any, coords: Mapping[str, np.ndarray]) -> tuple[Any, bool | None]:
    """The array of a leaf; and whether it has a value per lane, if its dimensions say it."""
    if not isinstance(leaf, xr.DataArray):
        return leaf, None
    of_grid = [dim for dim in leaf.dims if dim in coords]
    if not of_grid:
        return leaf.values, False
    for dim in of_grid:
        if leaf.sizes[dim] != coords[str(dim)].size:
            allowed = f"of size {coords[str(dim)].size} along {dim!r}, as the grid"
            raise refusal(name, leaf, allowed, but=f"of sizes {dict(leaf.sizes)}")
    rest = [dim for dim in leaf.dims if dim not in coords]
    spread = leaf.expand_dims({key: v.size for key, v in coords.items() if key not in of_grid})
    return spread.transpose(*coords, *rest).values, True


def check_shapes(system: AbstractHybridSystem, t0: Any, y0: PyTree, mode0: Any, args: PyTree) -> None:
    """Raise the system's error for a state of other shapes than its own. Nothing is compiled."""

    def shapes(y: PyTree) -> Any:
        t = jnp.asarray(t0, jnp.float64)
        first = system.initial_mode(t, y, args)
        mode = first if mode0 is None else mode0
        return system.vector_field(t, y, mode, args), system.guards(t, y, mode, args), first

    slope, guards, mode = jax.eval_shape(shapes, jax.tree.map(lambda a: np.asarray(a, np.float64), y0))
    for (name, a), b in zip(leaves_of("y0", y0), jax.tree.leaves(slope), strict=True):
        if np.shape(a) != b.shape:
            raise ValueError(f"the slope of {name}, of shape {np.shape(a)}, has the shape {b.shape}")
    for what, one in (("a guard", guards), ("the initial mode", mode)):
        for leaf in jax.tree.leaves(one):
            if leaf.shape:
                raise ValueError(f"{what} has the shape {leaf.shape}")


def labels_of_end(system: AbstractHybridSystem, first: PyTree, prefix: str) -> dict[str, tuple]:
    """Axes and unit of the state that a lane ends with, by the names that a sweep gives its results."""
    found = {}
    paths = jax.tree_util.tree_leaves_with_path({prefix: first})
    for (path, leaf), name in zip(paths, components_of(first), strict=True):
        key = jax.tree_util.keystr(path, simple=True, separator="_")
        found[key] = own_axes(name, np.ndim(leaf)), system.units.get(name)
    return found
