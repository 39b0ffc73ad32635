"""Sweeps over grids, block by block, that go on where they were interrupted."""

import time
from collections.abc import Callable, Mapping
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import PyTree

from .._types import Given, Named, NamedRows, Path
from .._validation import (
    check_callable,
    check_flag,
    check_mapping,
    leaves_of,
    misshaped,
    numbers,
    refusal,
)
from ._describe import Described, describe
from ._duty import Duty, duty_at, end_duty
from ._layout import Variable
from ._manifest import code_revision
from ._options import Options, checked_options
from ._read import finished_dataset
from ._store import Store
from ._units import values_of
from .grid import block_shape, check_grid, shard_shape
from .progress import Progress


def run_sweep(
    function: Given[Callable[..., Any]],
    grid: NamedRows,
    *,
    carry: PyTree = None,
    along: Given[str | None] = None,
    backward: Given[bool] = False,
    inputs: Named | None = None,
    store: Path | None = None,
    variables: Given[Mapping[str, Variable] | None] = None,
    settings: Named | None = None,
    attrs: Named | None = None,
    chunk: Given[int | None] = None,
    shard: Given[int | None] = None,
    resume: Given[bool] = True,
    progress: bool | None = None,
    name: str = "sweep",
    executor: Given[Literal["auto", "fused", "portable"]] = "auto",
    workers: Given[int | None] = None,
    hosts: Given[Literal["alike", "any"]] = "alike",
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
      what its neighbour before it in the direction `along` (default: the first coordinate) handed on.
      That is sequential by nature: only the other coordinates are computed side by side. `backward`
      runs from the last value to the first.
    - `inputs`: further arguments that differ from lane to lane, pytrees of arrays whose leading axes
      are those of the grid.
    - `store`: directory of results, made if absent. A later call with the same arguments goes on where
      this one stopped; a block whose file is lost or altered is computed again, headers and coordinates
      are written again. Files are compared by size and by the time of their last change, and where
      that is later than their record, by checksum; `verify_store` computes all checksums. Another
      sweep in it raises an error, and so does one whose function calls the host (`jax.pure_callback`
      and its like): what the host computes cannot be compared. `name`, `attrs` and `variables` may
      differ; they are written into the store. Without a store, results are kept in memory.
    - `variables`: labels of results and coordinates by name, see `Variable`.
    - `settings`: parameters, seeds and whatever else describes the sweep, for its manifest; they must
      match when it is resumed, as must the compiled program itself.
    - `attrs`: attributes of the dataset.
    - `chunk`: lanes per block (default 4096; 65,536 off the CPU). Memory grows with it, not with the
      number of lanes.
    - `shard`: lanes per file of a store, one block by default. A shard is computed block by block and
      written as a whole, so that an interruption loses what is computed of it. A sweep of a million
      lanes with `shard=2**18` is some ten files a variable instead of 245. Not with a `carry`.
    - `resume`: with `False` the sweep in the store is removed first, and no other file in it.
    - `progress`: a line on stderr with rate and time left; by default where stderr is a terminal.
    - `executor`, `workers`: as for `map_lanes`.
    - `hosts`: which hosts may compute for a store. With `"alike"` a host that uses another executor,
      backend, jax or jaxlib is refused by name; with `"any"` the record of each block says what
      computed it. Another program, also one that another jax makes of the same function, is always
      refused.

    **Returns** an `xarray.Dataset` with the grid's dimensions first; from a store it is read when used.

    **Errors** `ValueError`/`TypeError` naming a wrong argument, before anything is compiled;
    `SweepMismatchError` (a `ValueError`) if the store holds another sweep or is of an older format;
    `SweepWriteError` (an `OSError`) if results cannot be written, e.g. on a full disk: finished blocks
    are kept. `KeyboardInterrupt` says how many, and the same call goes on; without a store, that
    nothing is kept.
    """
    coords = check_grid(grid)
    options = checked_options(
        name=name, variables=variables, settings=settings, attrs=attrs, store=store, chunk=chunk,
        shard=shard, resume=resume, progress=progress, executor=executor, workers=workers, hosts=hosts,
    )  # fmt: skip
    inputs = check_mapping("inputs", inputs)
    check_flag("backward", backward)
    carry = _check_carry(carry)
    axis = _carried_axis(coords, carry, along, backward)
    if shard is not None and axis is not None:
        raise refusal("shard", shard, "unset with a carry, which needs each block before the next")
    inputs = _check_inputs(inputs, coords)
    call = f"f({'' if carry is None else 'carry, '}{', '.join([*coords, *inputs])})"
    check_callable("function", function, call, *[carry][: carry is not None], **coords, **inputs)
    duty = duty_at(options.path)
    sweep = described_grid(
        function, coords, options, duty, inputs=inputs, carry=carry, axis=axis, backward=backward
    )
    if options.path is None:
        return in_memory(sweep, progress, name)
    if duty is not None:
        held = Store(options.path, sweep.layout, sweep.manifest, duty.mark)
        end_duty(duty.do(held, sweep.evaluate, sweep.units))
    held = Store(options.path, sweep.layout, sweep.manifest)
    with held:
        on_disk(sweep, held, resume, progress, name)
    return finished_dataset(options.path, held.manifest)


def described_grid(
    function, coords, options: Options, duty: Duty | None, *, axis=None, **more
) -> Described:
    """A sweep over all combinations of the coordinates' values."""
    shape = tuple(values.size for values in coords.values())
    sides = block_shape(shape, options.chunk, axis)
    shards = sides if options.shard is None else shard_shape(shape, sides, options.shard)
    return describe(
        function, coords, options, sides=sides, shards=shards, axis=axis,
        workers=threads_of(options, duty), **more,
    )  # fmt: skip


def threads_of(options: Options, duty: Duty | None) -> int | None:
    """With how many threads a block is computed."""
    return options.workers if duty is None or duty.threads is None else duty.threads


def on_disk(sweep: Described, store: Store, resume: bool, progress: bool | None, name: str) -> None:
    """Compute what is left, with the store's lock held."""
    evaluate, units = sweep.evaluate, sweep.units
    store.open(resume=resume)
    todo = []
    for unit in units:
        # A carried block is computed from the one before it, so all after a damaged one count.
        if (todo and evaluate.axis is not None) or not store.is_finished(unit):
            todo.append(unit)
    total = sum(unit.lanes for unit in units)
    missing = sum(unit.lanes for unit in todo)
    meter = Progress(total, total - missing, name=name, shown=progress)
    if not todo:
        meter.show(f"all {total:,} lanes were finished before")
        meter.close()
        return
    begin = time.monotonic()
    store.log(
        event="begin", blocks_to_do=len(todo), blocks=len(units),
        code_revision=code_revision(), workers=evaluate.workers,
    )  # fmt: skip
    try:
        meter.show("compiling")
        for unit in todo:
            store.write(unit, values_of(unit, evaluate, store, meter.advance))
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"interrupted: {store.finished()} of {len(units)} blocks are kept in store "
            f"{str(store.path)!r}, and the same call goes on from there"
        ) from None
    finally:
        meter.close()
    store.log(event="end", seconds=round(time.monotonic() - begin, 3), lanes=missing)


def in_memory(sweep: Described, progress: bool | None, name: str) -> xr.Dataset:
    """Compute it all, and keep it in memory."""
    evaluate, layout = sweep.evaluate, sweep.layout
    pieces = sweep.pieces(layout.sides)
    arrays = {
        key: np.zeros((*layout.shape, *tail), dtype) for key, (tail, dtype, _) in layout.outputs.items()
    }
    meter = Progress(sum(block.lanes for block in pieces), name=name, shown=progress)
    try:
        meter.show("compiling")
        for block in pieces:
            for key, value in evaluate(block, lambda key, region: arrays[key][region]).items():
                arrays[key][block.region] = value
            meter.advance(block.lanes)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"interrupted after {meter.done:,} of {meter.total:,} lanes: nothing is kept, because the "
            "sweep has no store; with store='some/directory' the same call goes on where it stopped"
        ) from None
    finally:
        meter.close()
    return xr.Dataset(
        {
            key: (layout.dims(key), arrays[key], label.attributes())
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


def _carried_axis(coords, carry, along, backward) -> int | None:
    if carry is None:
        if along is not None or backward:
            name, value = ("along", along) if along is not None else ("backward", backward)
            raise refusal(name, value, "unset without a carry")
        return None
    if along is None:
        return 0
    if not isinstance(along, str) or along not in coords:
        raise refusal("along", along, f"one of {', '.join(map(repr, coords))}")
    return list(coords).index(along)


def _check_inputs(inputs, coords):
    shape = tuple(values.size for values in coords.values())
    checked = {}
    for key, tree in inputs.items():
        if key in coords:
            raise refusal(f"inputs[{key!r}]", tree, "given a name that no coordinate has")
        for where, leaf in leaves_of(f"inputs[{key!r}]", tree):
            _check_numbers(where, leaf)
            if np.shape(leaf)[: len(shape)] != shape:
                raise misshaped(where, leaf, f"an array with the leading axes of the grid, {shape}")
        checked[key] = jax.tree.map(np.asarray, tree)
    return checked
