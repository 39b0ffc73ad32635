"""Evaluation of one block of a sweep: side by side, or carried from point to point."""

from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from ._programs import Identity, identify
from .grid import Block, blocks
from .lanes import map_lanes

CARRY = "carry"


def output_names(tree: PyTree) -> dict[str, Any]:
    """Leaves of a result by name: keys and fields of their path, joined by `_`."""
    names = {}
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        name = jax.tree_util.keystr(path, simple=True, separator="_") or "value"
        if name in names:
            raise ValueError(f"function returned two results that are both called {name!r}.")
        names[name] = leaf
    if not names:
        raise ValueError("function returned no array: each lane must have at least one result.")
    return names


class prepared:
    """A lane function of this package that is used more than once, with what was traced of it.

    For functions whose surroundings are known not to change in between. A caller's function is traced
    at every call: it may read what was bound anew or altered since, and nothing would show it.
    """

    def __init__(self, function: Callable):
        self.function = function
        self._lanes: dict = {}

    def __call__(self, **point: Any) -> PyTree:
        return self.function(**point)

    def lanes(self, executor: str, workers: int | None) -> map_lanes:
        """`map_lanes` of the function, the same object each time."""
        key = executor, workers
        if key not in self._lanes:
            self._lanes[key] = _side_by_side(self, executor, workers)
        return self._lanes[key]

    def __getstate__(self) -> dict:
        # Compiled programs stay where they were compiled.
        return {"function": self.function, "_lanes": {}}


def lanes_of(function: Callable, executor: str, workers: int | None) -> map_lanes:
    """`map_lanes` over dictionaries of arguments."""
    if isinstance(function, prepared):
        return function.lanes(executor, workers)
    return _side_by_side(function, executor, workers)


def _side_by_side(function, executor, workers):
    def side_by_side(arguments):
        return function(**arguments)

    return map_lanes(side_by_side, executor=executor, workers=workers)


def lanes_for(function: Callable, carried: bool, executor: str, workers: int | None) -> map_lanes:
    """`map_lanes` over the points of a block or, where they are carried, over its rows."""
    if not carried:
        return lanes_of(function, executor, workers)

    def row(arguments):
        def step(carry, point):
            carry, results = function(carry, **point)
            return carry, {**_as_dict(results), CARRY: carry}

        start, points = arguments
        return jax.lax.scan(step, start, points)[1]

    # One lane of a carried sweep is a whole row, of which there are few.
    return map_lanes(row, executor=executor, workers=workers)


def results_by_name(lanes: map_lanes, arguments: PyTree) -> dict[str, np.ndarray]:
    """Results of the lanes of a block, in their order."""
    return {name: np.asarray(value) for name, value in output_names(lanes(arguments)).items()}


def identity_of(lanes: map_lanes, shapes: PyTree) -> Identity:
    """Digest of the program of one lane, with every constant that it holds.

    It distinguishes what no list of settings could: another formula, another parameter in a closure.
    """
    traced = jax.jit(lanes.function).trace(shapes)
    return identify(traced, traced.lower())


class Evaluate:
    """Calls a lane function on whole blocks, all of one shape, so that it is compiled once."""

    def __init__(
        self,
        function: Callable,
        coords: Mapping[str, np.ndarray],
        inputs: Mapping[str, PyTree],
        sides: tuple[int, ...],
        carry: PyTree,
        axis: int | None,
        backward: bool,
        executor: str,
        workers: int | None,
    ):
        self.function, self.executor, self.workers = function, executor, workers
        self.coords, self.inputs, self.sides = coords, inputs, sides
        self.axis: Any = axis  # None where lanes are side by side
        self.backward = backward
        self.carry = jax.tree.map(lambda a: jnp.asarray(a), carry)
        self.lanes = lanes_for(function, axis is not None, executor, workers)

    def arguments(self, block: Block, read: Callable) -> PyTree:
        """Points of a block, filled up to its full shape by repeating the last one along each axis.

        `read(name, region)` gives what was computed before.
        """
        region = block.region
        index = [
            np.minimum(np.arange(s.start, s.start + side), s.stop - 1)
            for s, side in zip(region, self.sides, strict=True)
        ]
        if self.backward:
            # In the order of computation, so that what fills up comes last and hands on nothing.
            s, side = region[self.axis], self.sides[self.axis]
            index[self.axis] = np.maximum(s.stop - 1 - np.arange(side), s.start)
        mesh = np.meshgrid(
            *(v[i] for v, i in zip(self.coords.values(), index, strict=True)), indexing="ij"
        )
        points = dict(zip(self.coords, mesh, strict=True))
        points |= jax.tree.map(lambda a: a[np.ix_(*index)], dict(self.inputs))
        rank = len(self.sides)
        if self.axis is None:
            return jax.tree.map(lambda a: a.reshape(-1, *a.shape[rank:]), points)

        def row(a):
            a = np.moveaxis(a, self.axis, rank - 1)
            return a.reshape(-1, *a.shape[rank - 1 :])

        return self._handed_on(region, index, read), jax.tree.map(row, points)

    def _handed_on(self, region, index, read) -> PyTree:
        """State that the neighbours before the block hand on to it, row by row."""
        rows = int(np.prod([n for i, n in enumerate(self.sides) if i != self.axis]))
        along = region[self.axis]
        before = along.stop if self.backward else along.start - 1
        if not 0 <= before < list(self.coords.values())[self.axis].size:
            return jax.tree.map(lambda a: np.broadcast_to(a, (rows, *np.shape(a))), self.carry)
        # Read what is there, then repeat the last row as the points are repeated.
        place = (*region[: self.axis], slice(before, before + 1), *region[self.axis + 1 :])
        fill = [
            np.zeros(1, int) if i == self.axis else ix - region[i].start for i, ix in enumerate(index)
        ]
        names = output_names({CARRY: self.carry})
        leaves = []
        for name in names:
            a = np.asarray(read(name, place))[np.ix_(*fill)]
            leaves.append(a.reshape(rows, *a.shape[len(self.sides) :]))
        return jax.tree.unflatten(jax.tree.structure(self.carry), leaves)

    def _shapes(self) -> PyTree:
        first = blocks(
            [v.size for v in self.coords.values()], self.sides, self.axis if self.backward else None
        )[0]

        def nothing(*_):
            raise AssertionError("the first block starts from the given carry")

        arguments = self.arguments(first, nothing)
        return jax.tree.map(
            lambda a: jax.ShapeDtypeStruct(a.shape[1:], jax.dtypes.canonicalize_dtype(a.dtype)),
            arguments,
        )

    def output_shapes(self) -> PyTree:
        """Shapes and dtypes of one point's results."""
        # With the executor that will compute them, so that what is traced here is traced once.
        with self.lanes.tracing():
            shapes = jax.eval_shape(self.lanes.function, self._shapes())
        if self.axis is None:
            return shapes
        return jax.tree.map(lambda s: jax.ShapeDtypeStruct(s.shape[1:], s.dtype), shapes)

    def program(self) -> Identity:
        """Identity of the program of one lane."""
        return identity_of(self.lanes, self._shapes())

    def __call__(self, block: Block, read: Callable) -> dict[str, np.ndarray]:
        """Results of a block by name. `read(name, region)` gives what was computed before."""
        return self.in_shape_of(block, results_by_name(self.lanes, self.arguments(block, read)))

    def in_shape_of(self, block: Block, results: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Results of the lanes of a block in the shape of its part of the grid."""
        rank = len(self.sides)
        out = {}
        for name, a in results.items():
            if self.axis is None:
                a = a.reshape(*self.sides, *a.shape[1:])
            else:
                across = [n for i, n in enumerate(self.sides) if i != self.axis]
                a = a.reshape(*across, *a.shape[1:])
                a = np.moveaxis(a, rank - 1, self.axis)
            a = a[tuple(slice(0, n) for n in block.shape)]
            out[name] = np.flip(a, self.axis) if self.backward else a
        return out


def _as_dict(results: PyTree) -> dict[str, Any]:
    return results if isinstance(results, dict) else {"value": results}
