"""Blocks computed by the workers of a Dask client, and written by the process that has the client.

Dask schedules the tasks, starts those of a lost worker again, and gives up on one that kills several.
A task carries its function and the numbers of its lanes, so that a worker needs the packages that the
function comes from, and no part of the store.
"""

import collections
import functools
from typing import Any, NamedTuple

import cloudpickle
import distributed
import jax
import numpy as np

from ..progress import Progress
from ._describe import Described, computed_with
from ._manifest import differences
from ._memory import Memory, results_of_unit
from ._store import Store, SweepMismatchError
from .evaluate import identity_of, lanes_for, results_by_name
from .grid import Block, blocks_inside

IN_HAND = 2  # tasks in the hands of Dask for each thread of its workers, so that none of them waits


class _Task(NamedTuple):
    """All that makes a worker's program, and that the program is compared with."""

    function: Any
    carried: bool
    executor: str
    threads: int | None
    program: str
    computed_with: dict[str, Any] | None  # None: any


def compute_by_client(
    client: Any, sweep: Described, left: list[list[Block]], kept: Memory | Store, meter: Progress
) -> None:
    """Compute and write the units of each chain in their order, the chains side by side."""
    evaluate, layout = sweep.evaluate, kept.layout
    by_host = sweep.manifest.get("hosts") == "any"
    task = cloudpickle.dumps(_Task(
        evaluate.function, evaluate.axis is not None, evaluate.executor, evaluate.workers,
        sweep.program.digest, None if by_host else sweep.manifest["computed_with"],
    ))  # fmt: skip
    waiting, running = collections.deque(map(collections.deque, left)), {}

    def begin(chain: collections.deque) -> Any:
        unit = chain.popleft()
        inside = blocks_inside(unit, layout.shape, layout.sides)
        lanes = [evaluate.arguments(block, kept.read) for block in inside]
        future = client.submit(_compute_blocks, task, lanes, pure=False)
        running[future.key] = future, unit, inside, chain
        return future

    def room_in_hand() -> int:
        threads = sum(client.nthreads().values())  # workers come and go
        return max(min(IN_HAND * threads - len(running), len(waiting)), not running and bool(waiting))

    try:
        done = distributed.as_completed([begin(waiting.popleft()) for _ in range(room_in_hand())])
        for future in done:
            results, by = future.result()
            _, unit, inside, chain = running.pop(future.key)
            shaped = map(evaluate.in_shape_of, inside, results)
            values = results_of_unit(unit, inside, shaped, meter.advance)
            kept.write(unit, values, by if by_host else None)
            if chain:
                done.add(begin(chain))
            for _ in range(room_in_hand()):
                done.add(begin(waiting.popleft()))
    finally:
        client.cancel([future for future, *_ in running.values()])


def _compute_blocks(
    task: bytes, blocks: list[Any]
) -> tuple[list[dict[str, np.ndarray]], dict[str, Any]]:
    """On a worker: results of blocks, and what computed them."""
    with Progress("worker", shown=False):  # the process that has the client counts
        lanes, by = _program(task, jax.tree.structure(blocks[0]), *_shapes(blocks[0]))
        return [results_by_name(lanes, arguments) for arguments in blocks], by


@functools.lru_cache(maxsize=4)
def _program(task: bytes, structure: Any, *shapes: Any) -> tuple[Any, dict[str, Any]]:
    """The program of a task, if it is that of the sweep; `SweepMismatchError` naming what differs."""
    wanted = cloudpickle.loads(task)
    lanes = lanes_for(wanted.function, wanted.carried, wanted.executor, wanted.threads)
    one = jax.tree.unflatten(structure, [jax.ShapeDtypeStruct(*shape) for shape in shapes])
    by = computed_with(lanes)
    # Traced in this order by the process that asks too: what is traced once has names in the program.
    with lanes.tracing():
        jax.eval_shape(lanes.function, one)
    there = {"program": wanted.program, "computed_with": wanted.computed_with or by}
    here = {"program": identity_of(lanes, one).digest, "computed_with": by}
    found = differences(there, here)
    if found:
        raise SweepMismatchError(
            "a worker of the client computes another sweep than the process that asks: "
            + "; ".join(found).replace("in the store", "there").replace(" now", " on the worker")
        )
    return lanes, by


def _shapes(arguments: Any) -> list[Any]:
    """Shape and type of one lane's arguments."""
    dtype = jax.dtypes.canonicalize_dtype
    return [(np.shape(a)[1:], dtype(np.asarray(a).dtype)) for a in jax.tree.leaves(arguments)]
