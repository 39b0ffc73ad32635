"""Computes the rest of a sweep: here by all cores, or by the workers of a Dask client."""

import time

from ..progress import Progress
from ._describe import Described
from ._manifest import code_revision
from ._memory import Memory, results_of_unit
from ._store import Store
from .evaluate import Evaluate
from .grid import Block, blocks_inside, chains
from .settings import Settings


def compute_rest(sweep: Described, kept: Memory | Store, settings: Settings, name: str) -> None:
    """Compute what is not finished of a sweep, or of the part of it that is asked for.

    Units that follow from each other are one piece of work. Its first unit that is not finished is
    computed with all after it, because each is computed from the one before.
    """
    evaluate, compute = sweep.evaluate, settings.compute
    units = chains(sweep.units, evaluate.axis)
    if settings.part is not None:
        units = units[settings.part[0] :: settings.part[1]]
    left = [rest for chain in units if (rest := _rest_of_chain(chain, kept))]
    total, missing = (sum(unit.lanes for chain in found for unit in chain) for found in (units, left))
    if not left:
        return
    meter = Progress(name, total, total - missing, shown=compute.progress)
    begin = time.monotonic()
    kept.log(
        event="begin", blocks_to_do=sum(map(len, left)), blocks=len(sweep.units),
        code_revision=code_revision(), workers=compute.workers,
    )  # fmt: skip
    try:
        with meter:
            if compute.client is None:
                _compute_here(evaluate, left, kept, meter)
            else:
                from ._dask import compute_by_client

                compute_by_client(compute.client, sweep, left, kept, meter)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(kept.interruption(meter)) from None
    kept.log(event="end", seconds=round(time.monotonic() - begin, 3), lanes=missing)


def _rest_of_chain(chain: list[Block], kept: Memory | Store) -> list[Block]:
    for i, unit in enumerate(chain):
        if not kept.is_finished(unit):
            return chain[i:]
    return []


def _compute_here(evaluate: Evaluate, left: list[list[Block]], kept: Memory | Store, meter) -> None:
    for unit in (unit for chain in left for unit in chain):
        inside = blocks_inside(unit, kept.layout.shape, kept.layout.sides)
        results = (evaluate(block, kept.read) for block in inside)
        kept.write(unit, results_of_unit(unit, inside, results, meter.advance))
