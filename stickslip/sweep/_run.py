"""Sweeps over grids, block by block, that go on where they were interrupted."""

from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import PyTree

from .._types import Given, Named, NamedRows, Path
from .._validation import (
    check_callable,
    check_mapping,
    check_type,
    leaves_of,
    numbers,
    refusal,
    shape_refusal,
)
from ..progress import Progress
from ._compute import compute_rest
from ._describe import Described, describe
from ._labels import Labels, Variable
from ._memory import Memory
from ._read import dataset_so_far
from ._store import Store
from .grid import block_shape, check_grid, shard_shape
from .settings import Carried, Compute, Settings, Storage, settings_of


def run_sweep(
    function: Given[Callable[..., Any]],
    grid: NamedRows,
    *,
    carry: PyTree = None,
    carried: Given[Carried | None] = None,
    inputs: Named | None = None,
    store: Path | Storage | None = None,
    labels: Given[Labels | None] = None,
    compute: Given[Compute | None] = None,
    part: Given[tuple[int, int] | None] = None,
) -> xr.Dataset:
    """Evaluate `function` at every point of a grid; with a `store`, survive any interruption.

    ```python
    dataset = ss.sweep.run_sweep(lambda k3: {"x": end_of(k3)}, {"k3": values}, store="results/end")
    ```

    **Arguments**

    - `function(**point, **inputs) -> pytree of arrays`: one lane. Each leaf becomes a variable, named
      by its path; shapes must not depend on the point.
    - `grid`: coordinate name to vector of values; several are combined to all pairs, triples, ...
    - `carry`: with it, lanes follow each other: `function(carry, **point) -> (carry, results)` gets
      what its neighbour before it handed on. That is sequential by nature: only the coordinates other
      than the one along which it is carried are computed side by side.
    - `carried`: `Carried(direction, along)` of a carry; by default upwards along the first coordinate.
    - `inputs`: further arguments that differ from lane to lane, pytrees of arrays whose leading axes
      are those of the grid.
    - `store`: directory of results, or a `Storage`, which also says how many lanes are computed and
      written at a time. A later call with the same arguments goes on where this one stopped; a block
      whose file is lost or altered is computed again, headers and coordinates are written again. Files
      are compared by size and by the time of their last change, and where that is later than their
      record, by checksum; `verify_store` computes all checksums. Another sweep in it raises an error,
      and so does one whose function calls the host (`jax.pure_callback` and its like): the digest of a
      program does not say what the host computes. Without a store, results are kept in memory.
    - `labels`: `Labels`: units and names of results, settings, attributes, title.
    - `compute`: `Compute`: executor, threads, a client of Dask, progress.
    - `part`: `(i, n)` computes the i-th of n fixed shares of the blocks, counted from 0, beside other
      processes that compute other shares into the same store: a scheduler's array of jobs needs nothing
      but its index. A later call without it computes what is missing.

    **Returns** an `xarray.Dataset` with the grid's dimensions first; from a store it is read when used.
    Its attribute `sweep_state` is `"finished"`, or says after a part how many blocks there are.

    **Errors** `ValueError`/`TypeError` naming a wrong argument, before anything is compiled;
    `SweepMismatchError` (a `ValueError`) if the store holds another sweep or is of an older format, or
    if a worker of the client computes another one; `SweepWriteError` (an `OSError`) if results cannot
    be written, e.g. on a full disk: finished blocks are kept. `KeyboardInterrupt` says how many, and
    the same call goes on; without a store, that nothing is kept.
    """
    coords = check_grid(grid)
    settings = settings_of(store, labels, compute, part)
    inputs = check_mapping("inputs", inputs)
    carry = _check_carry(carry)
    check_type("carried", carried, Carried | None, "a Carried, or None")
    axis = _carried_axis(coords, carry, carried)
    if settings.storage.shard is not None and axis is not None:
        allowed = "unset with a carry, which needs each block before the next"
        raise refusal("shard", settings.storage.shard, allowed)
    inputs = _check_inputs(inputs, coords)
    call = f"f({'' if carry is None else 'carry, '}{', '.join([*coords, *inputs])})"
    check_callable("function", function, call, *[carry][: carry is not None], **coords, **inputs)
    backward = carried is not None and carried.direction == "downwards"
    path = settings.storage.directory
    with Progress(settings.name, shown=settings.compute.progress):
        sweep = described_grid(
            function, coords, settings, inputs=inputs, carry=carry, axis=axis, backward=backward
        )
        if path is None:
            return in_memory(sweep, settings, settings.name)
        with Store(path, sweep.layout, sweep.manifest, shared=part is not None) as kept:
            kept.open(resume=settings.storage.resume)
            compute_rest(sweep, kept, settings, settings.name)
        return dataset_so_far(path, kept.manifest)


def described_grid(function, coords, settings: Settings, *, axis=None, **more) -> Described:
    """A sweep over all combinations of the coordinates' values."""
    shape = tuple(values.size for values in coords.values())
    sides = block_shape(shape, settings.storage.lanes, axis)
    shard = settings.storage.shard
    shards = sides if shard is None else shard_shape(shape, sides, shard)
    return describe(function, coords, settings, sides=sides, shards=shards, axis=axis, **more)


def in_memory(sweep: Described, settings: Settings, name: str) -> xr.Dataset:
    """Compute it all, and keep it in memory."""
    layout = sweep.layout
    kept = Memory(layout)
    compute_rest(sweep, kept, settings, name)
    return xr.Dataset(
        {
            key: (layout.dims(key), kept.arrays[key], label.attributes())
            for key, (_, _, label) in layout.outputs.items()
        },
        {
            key: ((key,), values, layout.labels.get(key, Variable()).attributes())
            for key, values in layout.coords.items()
        },
        attrs=dict(layout.attrs),
    )


def _check_carry(carry: PyTree) -> PyTree:
    """Raise for leaves that the compiler would not take."""
    found = leaves_of("carry", carry)
    if carry is not None and not found:
        raise refusal("carry", carry, "a pytree with at least one array, or None")
    for name, leaf in found:
        _check_numbers(name, leaf)
    return carry


def _check_numbers(name: str, leaf: Any) -> None:
    # Also booleans and complex numbers, which are nobody's parameters but may be handed on.
    array = isinstance(leaf, np.generic | np.ndarray | jax.Array)
    dtype = leaf.dtype if array and not isinstance(leaf, np.ma.MaskedArray) else type(leaf)
    if not any(jnp.issubdtype(dtype, kind) for kind in (jnp.bool_, jnp.complexfloating)):
        numbers(name, leaf, "a number or an array of numbers")


def _carried_axis(
    coords: Mapping[str, np.ndarray], carry: PyTree, carried: Carried | None
) -> int | None:
    if carry is None:
        if carried is not None:
            raise refusal("carried", carried, "unset without a carry")
        return None
    if carried is None or carried.along is None:
        return 0
    if carried.along not in coords:
        raise refusal("along", carried.along, f"one of {', '.join(map(repr, coords))}")
    return list(coords).index(carried.along)


def _check_inputs(inputs, coords):
    shape = tuple(values.size for values in coords.values())
    checked = {}
    for key, tree in inputs.items():
        if key in coords:
            raise refusal(f"inputs[{key!r}]", tree, "given a name that no coordinate has")
        for where, leaf in leaves_of(f"inputs[{key!r}]", tree):
            _check_numbers(where, leaf)
            if np.shape(leaf)[: len(shape)] != shape:
                raise shape_refusal(where, leaf, f"an array with the leading axes of the grid, {shape}")
        checked[key] = jax.tree.map(np.asarray, tree)
    return checked
