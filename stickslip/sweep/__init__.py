"""Many lanes at once, on all cores, in pieces that survive an interruption."""

from ._lanes import map_lanes as map_lanes
