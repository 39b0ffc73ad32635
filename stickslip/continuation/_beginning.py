"""Where an orbit begins: not at a break of its load, where rounding decides in which mode it ends."""

from typing import Any

from jaxtyping import PyTree

from ..hybrid import (
    AbstractHybridSystem,
    AbstractSystemWrapper,
    Integrator,
    SaveAt,
    WithPeriodicBreaks,
    simulate,
)
from ..hybrid.periodic_breaks import beside_break


def beside_breaks(
    system: AbstractHybridSystem, args: PyTree, integrator: Integrator, t0: Any, y0: PyTree, mode0: Any
) -> tuple[Any, PyTree, Any]:
    """Time, state and mode of a guess; those of its motion a little later if its load breaks there."""
    found = system
    while not isinstance(found, WithPeriodicBreaks):
        if not isinstance(found, AbstractSystemWrapper):
            return t0, y0, mode0
        found = found.system
    # Not before the break: there the load is that of the piece which ends.
    later = beside_break(found, t0)
    run = simulate(
        system, t0, later, y0, mode0, args, integrator=integrator, saveat=SaveAt(max_events=None),
        throw=False,
    )  # fmt: skip
    return later, run.y1, run.mode1
