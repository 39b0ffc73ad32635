"""Results of a sweep that has no store, and results of a unit from those of its blocks."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..progress import Progress
from ._layout import Layout
from .grid import Block


class Memory:
    """Results that are kept in memory, as `Store` keeps them on disk."""

    def __init__(self, layout: Layout):
        self.layout = layout
        self.arrays = {
            name: np.zeros((*layout.shape, *tail), dtype)
            for name, (tail, dtype, _) in layout.outputs.items()
        }

    def is_finished(self, unit: Block) -> bool:
        """Nothing is, at the beginning."""
        return False

    def read(self, name: str, region: tuple[Any, ...]) -> np.ndarray:
        """Part of a variable."""
        return self.arrays[name][region]

    def write(self, unit: Block, values: dict[str, np.ndarray], by: Any = None) -> None:
        """Results of a unit."""
        for name, value in values.items():
            self.arrays[name][unit.region] = value

    def log(self, **entry: Any) -> None:
        """No diary is kept of what ends with the process."""

    def interruption(self, meter: Progress) -> str:
        """Words for what an interruption leaves."""
        return (
            f"interrupted after {meter.done:,} of {meter.total:,} lanes: nothing is kept, because the "
            "sweep has no store; with store='some/directory' the same call goes on where it stopped"
        )


def results_of_unit(
    unit: Block,
    inside: list[Block],
    results: Iterable[dict[str, np.ndarray]],
    advance: Callable[[int], None],
) -> dict[str, np.ndarray]:
    """Results of a unit by name, of those of its blocks; `advance` is told the lanes of each."""
    whole: dict[str, np.ndarray] = {}
    for block, found in zip(inside, results, strict=True):
        advance(block.lanes)
        if block.region == unit.region:
            return found
        part = tuple(
            slice(inner.start - outer.start, inner.stop - outer.start)
            for inner, outer in zip(block.region, unit.region, strict=True)
        )
        for name, value in found.items():
            if name not in whole:
                whole[name] = np.empty((*unit.shape, *value.shape[len(part) :]), value.dtype)
            whole[name][part] = value
    return whole
