"""The results of one unit of work: of a block, or of a shard block by block."""

from collections.abc import Callable

import numpy as np

from ._store import Store
from .evaluate import Evaluate
from .grid import Block, blocks_inside


def values_of(
    unit: Block, evaluate: Evaluate, store: Store, counted: Callable[[int], None]
) -> dict[str, np.ndarray]:
    """Results of a unit by name; `counted` is told the lanes of each block that is finished."""
    layout = store.layout
    whole: dict[str, np.ndarray] = {}
    for block in blocks_inside(unit, layout.shape, layout.sides):
        found = evaluate(block, store.read)
        counted(block.lanes)
        if block.region == unit.region:
            return found
        part = tuple(
            slice(inner.start - outer.start, inner.stop - outer.start)
            for inner, outer in zip(block.region, unit.region, strict=True)
        )
        for name, value in found.items():
            if name not in whole:
                tail = value.shape[len(part) :]
                whole[name] = np.empty((*unit.shape, *tail), value.dtype)
            whole[name][part] = value
    return whole
