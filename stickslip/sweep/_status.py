"""How far a sweep is, while others work on it."""

import contextlib
import os
import pathlib
from typing import Any

import numpy as np
import zarr

from .._paths import the_directory
from .._types import Path
from ._children import children
from ._claims import Claims
from ._layout import DATA, REFINE, Files, record_file
from ._open import refined_in
from ._records import recorded
from ._verify import the_manifest
from .grid import Block, blocks
from .progress import clock

LATEST = 256  # records from which the rate is taken


def sweep_status(store: Path) -> dict[str, Any]:
    """How far a sweep is: read from its store, also while others work on it.

    **Returns** what JSON can say, by name:

    - `lanes`, `lanes_finished`, `units`, `units_finished`; a unit counts if it has a record;
    - `lanes_per_second`: of all workers together, between the latest records, and `seconds_left` at
      this rate; None where nobody works or too little is finished;
    - `codes`: for each result with `flag_meanings`, and each of True and False, how many of each there
      are in what is finished;
    - `claims`: what is being computed: `unit`, `who`, `age` in seconds, `alive`;
    - `refined`, of a sweep that is refined, whose other numbers count all points that are known so far:
      its `state`, as `sweep_state` of `refine_sweep`, `levels_wanted`, and for each of the `levels` its
      number, `lanes` and `lanes_finished`; a claim says in which `step`;
    - `bytes`: size of the results so far; `computed_with`; `function` that makes the sweep, or None.

    **Errors** `TypeError` or `ValueError` if `store` is not a sweep's.
    """
    path = the_directory("store", store)
    found = _one(path)
    steps = children(path)
    refine = the_manifest(path)["attributes"].get(REFINE)
    if refine is None and not steps:
        return found
    below = [(the_manifest(step)["refine"], _one(step)) for step in steps]
    for number, (_, step) in enumerate(below, 1):
        for name in ("lanes", "lanes_finished", "units", "units_finished", "bytes"):
            found[name] += step[name]
        for name, counts in step["codes"].items():
            total = found["codes"].setdefault(name, {})
            for word, n in counts.items():
                total[word] = total.get(word, 0) + n
        found["claims"] += [{"step": number, **claim} for claim in step["claims"]]
        for name in ("lanes_per_second", "seconds_left"):
            found[name] = step[name]  # work is at the last one
    return {**found, "refined": _refined(path, refine, below)}


def _refined(path, refine, below) -> dict[str, Any]:
    """What is known of the levels of a refinement."""
    levels: dict[int, dict[str, int]] = {}
    for about, step in below:
        level = levels.setdefault(about["level"], {"lanes": 0, "lanes_finished": 0})
        for name in level:
            level[name] += step[name]
    try:
        state = "unknown" if refine is None else refined_in(path, the_manifest(path), False).state
    except (ValueError, OSError):
        state = "unknown"
    return {
        "state": state,
        "levels_wanted": None if refine is None else refine["levels"],
        "levels": [{"level": level, **counts} for level, counts in sorted(levels.items())],
    }


def _one(path: pathlib.Path) -> dict[str, Any]:
    """The same of a store without those inside it."""
    manifest = the_manifest(path)
    files = Files(manifest)
    there = recorded(path)
    units = [unit for unit in blocks(files.shape, files.sides) if unit.number in there]
    lanes, finished = int(np.prod(files.shape)), sum(unit.lanes for unit in units)
    claims: list[dict[str, Any]] = []
    with contextlib.suppress(OSError):  # read only: the time of the file system cannot be asked for
        claims = [
            {"unit": number, "who": s.who, "age": round(s.age, 1), "alive": s.alive}
            for number, s in sorted(Claims(path).standing().items())
            if s.seen[0] > 0  # else given back
        ]
    rate = _rate(path, units)
    works = finished < lanes and any(claim["alive"] for claim in claims)
    return {
        "lanes": lanes,
        "lanes_finished": finished,
        "units": files.total,
        "units_finished": len(units),
        "lanes_per_second": rate,
        "seconds_left": (lanes - finished) / rate if works and rate else None,
        "codes": _codes(path, manifest, units),
        "claims": claims,
        "bytes": size_of(path, manifest, there),
        "computed_with": manifest["computed_with"],
        "function": (manifest.get("reference") or {}).get("function"),
    }


def status_lines(found: dict[str, Any]) -> list[str]:
    """The same for people."""
    share = found["lanes_finished"] / found["lanes"]
    lines = [
        f"{found['lanes_finished']:,} of {found['lanes']:,} lanes ({share:.1%}), "
        f"{found['units_finished']:,} of {found['units']:,} units, {found['bytes'] / 1e6:,.1f} MB"
    ]
    if found["seconds_left"] is not None:
        rate = found["lanes_per_second"]
        lines.append(f"{rate:,.3g} lanes per s, {clock(found['seconds_left'])} left")
    if "refined" in found:
        refined = found["refined"]
        of = "" if refined["levels_wanted"] is None else f" of {refined['levels_wanted']}"
        for level in refined["levels"]:
            share = f"{level['lanes_finished']:,} of {level['lanes']:,} lanes"
            lines.append(f"level {level['level']}{of}: {share}")
        lines.append(f"refinement {refined['state']}")
    for name, counts in found["codes"].items():
        lines.append(f"{name}: " + ", ".join(f"{n:,} {word}" for word, n in counts.items()))
    for claim in found["claims"]:
        state = "" if claim["alive"] else ", dead: free for others"
        where = f"step {claim['step']}, " if "step" in claim else ""
        seen = f"seen {claim['age']:.0f} s ago{state}"
        lines.append(f"{where}unit {claim['unit']}: {claim['who']}, {seen}")
    return lines


def size_of(path: pathlib.Path, manifest: dict[str, Any], there: set[int]) -> int:
    """Bytes of the files of recorded units."""
    total = 0
    for number, names in Files(manifest).blocks():
        if number in there:
            for name in names:
                with contextlib.suppress(OSError):
                    total += os.stat(path / name).st_size
    return total


def _rate(path: pathlib.Path, units: list[Block]) -> float | None:
    """Lanes per second from the times of the latest records."""
    written = []
    for unit in units:
        with contextlib.suppress(OSError):
            written.append((os.stat(path / record_file(unit.number)).st_mtime, unit.lanes))
    written = sorted(written)[-LATEST:]
    if len(written) < 2 or written[-1][0] <= written[0][0]:
        return None
    return sum(lanes for _, lanes in written[1:]) / (written[-1][0] - written[0][0])


def _codes(path: pathlib.Path, manifest: dict[str, Any], units: list[Block]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    try:
        group = zarr.open_group(path / DATA, mode="r")
        for name, output in manifest["outputs"].items():
            attributes = manifest["attributes"][f"array {name}"]
            words = str(attributes.get("flag_meanings", "")).split()
            values = attributes.get("flag_values", list(range(len(words))))
            if output["dtype"] == "bool" and not words:
                words, values = ["True", "False"], [True, False]
            if not words or len(words) != len(values):
                continue
            array: Any = group[name]
            counts = dict.fromkeys(words, 0)
            for unit in units:
                read = np.asarray(array[unit.region])
                for word, value in zip(words, values, strict=True):
                    counts[word] += int(np.count_nonzero(read == value))
            found[name] = {word: n for word, n in counts.items() if n}
    except Exception:  # whatever zarr meets in files that are damaged; `verify_store` names them
        return found
    return found
