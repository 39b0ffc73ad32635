"""An attractor of a system with other parameters that is the same one."""

from ._attractor import Attractor, Search, fixed_point_at, orbit_of, with_radius
from ._lanes import flat
from ._rests import rests_at
from ._wandering import wanderings_at


def successor_of(search: Search, before: Attractor) -> Attractor | None:
    """The attractor of a system with other parameters that is the same one, if there is."""
    if before.kind == "rest":
        return before if rests_at(search.lanes, before.mode, flat(before.motion)) else None
    if before.kind == "orbit":
        found = orbit_of(search, before.motion)
    elif before.kind == "fixed point":
        found = fixed_point_at(search, 0.0, flat(before.motion.y), before.mode)
    else:
        found = next(wanderings_at(search, 0.0, flat(before.motion.y1), before.mode), None)
    if found is None or not found.rate < 0.0 or found.attractor.kind != before.kind:
        return None
    new = with_radius(search, 0.0, found)
    return None if new is None else new._replace(name=before.name)
