"""What a sweep needs, from what of it is finished: cores, hours, bytes and files."""

import contextlib
import itertools
import json
import math
from typing import Any

from .._paths import the_directory
from .._types import Given, Path
from .._validation import check_count
from ._children import family
from ._layout import Files
from ._records import recorded
from ._status import size_of
from ._verify import the_manifest
from .grid import MAX_LANES, blocks
from .progress import clock

CORES = (1, 16, 64, 1024)


def needs(store: Path, lanes: Given[int]) -> dict[str, Any]:
    """Time of processors, bytes and files of a sweep of `lanes` lanes like the one in the store.

    Taken from the workers that came to their end there: seconds per lane of one thread, bytes per lane
    of what is finished. `ValueError` if none did.
    """
    check_count("lanes", lanes, 1, MAX_LANES)
    path = the_directory("store", store)
    manifest = the_manifest(path)
    files, there = Files(manifest), recorded(path)
    finished = [unit for unit in blocks(files.shape, files.sides) if unit.number in there]
    seconds, counted = 0.0, 0
    for run in itertools.chain.from_iterable(map(_diary, family(path))):
        spent, n = run.get("core_seconds"), run.get("lanes")
        if isinstance(spent, int | float) and isinstance(n, int) and n > 0:
            seconds, counted = seconds + spent, counted + n
    if not counted or not finished:
        raise ValueError(
            f"store = {str(path)!r} shows no finished worker to reckon from: it must have some units "
            "computed, as `python -m stickslip work STORE --until 60s` does."
        )
    per_lane = seconds / counted
    size = size_of(path, manifest, there) / sum(unit.lanes for unit in finished)
    unit = max(unit.lanes for unit in finished)
    units = math.ceil(lanes / unit)
    return {
        "lanes": lanes,
        "core_seconds_per_lane": per_lane,
        "core_hours": lanes * per_lane / 3600,
        # No more workers than units, and all wait for the last one.
        "hours": {str(cores): math.ceil(units / cores) * unit * per_lane / 3600 for cores in CORES},
        "bytes": round(lanes * size),
        "units": units,
        "files": units * (len(files.tails) + 1),
        "seconds_per_unit": unit * per_lane,
    }


def needs_lines(found: dict[str, Any]) -> list[str]:
    """The same for people."""
    hours = ", ".join(f"{clock(3600 * hours)} on {cores}" for cores, hours in found["hours"].items())
    return [
        f"{found['lanes']:,} lanes need {found['core_hours']:,.3g} core hours "
        f"({1e3 * found['core_seconds_per_lane']:.3g} core ms a lane): {hours} cores",
        f"{found['bytes'] / 1e9:,.3g} GB in {found['files']:,} files; "
        f"{found['units']:,} units of {clock(found['seconds_per_unit'])} each",
    ]


def _diary(path):
    with contextlib.suppress(OSError), open(path / "runs.jsonl", encoding="utf-8") as lines:
        for line in lines:
            with contextlib.suppress(ValueError):
                entry = json.loads(line)
                if isinstance(entry, dict):
                    yield entry
