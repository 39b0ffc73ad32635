"""How far a sweep is, while others work on it."""

import os
import pathlib
from typing import Any

import numpy as np
import zarr

from .._paths import the_directory
from .._types import Path
from ._children import children
from ._layout import DATA, REFINE, Files
from ._manifest import identity
from ._open import refined_in
from ._records import Looked, recorded_units
from ._verify import the_manifest
from .grid import Block, blocks


def sweep_status(store: Path) -> dict[str, Any]:
    """How far a sweep is: what is done, missing and damaged, also while others work on it.

    **Returns** what JSON can say, by name:

    - `lanes`, `lanes_finished`, `units`, `units_finished`, `units_missing`: a unit, a block or a shard,
      is finished if its files are there as its record says, by size and age as in `run_sweep`; it is
      missing if it has no record;
    - `damaged`: the others, as `"unit 3"`; the next `run_sweep` computes them again;
    - `codes`: for each result with `flag_meanings`, and each of True and False, how many of each there
      are in what is finished;
    - `refined`, of a sweep that is refined, whose other numbers count all points that are known so far:
      its `state`, as `sweep_state` of `refine_sweep`, `levels_wanted`, and for each of the `levels` its
      number, `lanes` and `lanes_finished`;
    - `bytes`: size of the results so far; `computed_with`.

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
        for name in ("lanes", "lanes_finished", "units", "units_finished", "units_missing", "bytes"):
            found[name] += step[name]
        for name, counts in step["codes"].items():
            total = found["codes"].setdefault(name, {})
            for word, n in counts.items():
                total[word] = total.get(word, 0) + n
        found["damaged"] += [f"step {number}, {unit}" for unit in step["damaged"]]
    return {**found, "refined": _levels_of_refinement(path, refine, below)}


def _levels_of_refinement(path, refine, below) -> dict[str, Any]:
    """All that is known of the levels of a refinement."""
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
    files, there = Files(manifest), recorded_units(path)
    looked = Looked(path, identity(manifest), manifest["format"], folders=False)
    names = dict(files.blocks())
    units = [unit for unit in blocks(files.shape, files.sides) if unit.number in there]
    sound = [unit for unit in units if looked.is_finished(unit.number, names[unit.number])]
    damaged = sorted({unit.number for unit in units} - {unit.number for unit in sound})
    return {
        "lanes": int(np.prod(files.shape)),
        "lanes_finished": sum(unit.lanes for unit in sound),
        "units": files.total,
        "units_finished": len(sound),
        "units_missing": files.total - len(units),
        "damaged": [f"unit {number}" for number in damaged],
        "codes": _codes(path, manifest, sound),
        "bytes": sum(os.stat(path / name).st_size for unit in sound for name in names[unit.number]),
        "computed_with": manifest["computed_with"],
    }


def status_lines(found: dict[str, Any]) -> list[str]:
    """The same for people."""
    share = found["lanes_finished"] / found["lanes"]
    lines = [
        f"{found['lanes_finished']:,} of {found['lanes']:,} lanes ({share:.1%}), "
        f"{found['units_finished']:,} of {found['units']:,} units, {found['bytes'] / 1e6:,.1f} MB"
    ]
    if found["units_missing"]:
        lines.append(f"{found['units_missing']:,} units missing")
    if found["damaged"]:
        lines.append(f"{len(found['damaged']):,} units damaged: {'; '.join(found['damaged'][:9])}")
    if "refined" in found:
        refined = found["refined"]
        of = "" if refined["levels_wanted"] is None else f" of {refined['levels_wanted']}"
        for level in refined["levels"]:
            share = f"{level['lanes_finished']:,} of {level['lanes']:,} lanes"
            lines.append(f"level {level['level']}{of}: {share}")
        lines.append(f"refinement {refined['state']}")
    for name, counts in found["codes"].items():
        lines.append(f"{name}: " + ", ".join(f"{n:,} {word}" for word, n in counts.items()))
    return lines


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
