"""Records of full runs that lie in the repository: numbers as JSON, pictures as small PNG."""

import dataclasses
import json
import pathlib
from collections.abc import Mapping
from typing import Any

import xarray as xr
from PIL import Image

from ._experiment import Experiment, natural
from ._output import changed, summary, write_record
from ._scoreboard import is_full, statements_of

FOLDER = pathlib.Path(__file__).parent / "records"
WIDTH = 960  # pixels, for screens of twice the resolution
COLOURS = 48
KEPT = (
    "name", "title", "parameters", "versions", "code_revision", "device", "cpu_count", "date", "load",
    "wall_time_s",
)  # fmt: skip


def read(folder: pathlib.Path = FOLDER) -> dict[str, dict[str, Any]]:
    """Records by name. Errors: `ValueError` naming a file that is not the record of a full run."""
    records = {}
    for path in sorted(folder.glob("*.json"), key=lambda path: natural(path.stem)):
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            statements_of(record)
            good = is_full(record) and record["name"] == path.stem
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"{path.name}: it must be the record of a full run; {error}.") from error
        if not good:
            raise ValueError(f"{path.name}: it must be the record of a full run of that name.")
        records[path.stem] = record
    return records


def keep(
    out: pathlib.Path, experiments: Mapping[str, Experiment], folder: pathlib.Path = FOLDER
) -> tuple[list[str], list[str]]:
    """Take over the full runs in `out`; names taken, and those left out with the reason.

    The statements are judged anew from the data, so that records of runs before a change of the
    judgement say what it says now.
    """
    folder.mkdir(exist_ok=True)
    taken, left = [], []
    for name, experiment in experiments.items():
        try:
            record = json.loads((out / f"{name}.json").read_text(encoding="utf-8"))
        except FileNotFoundError:
            continue
        record["changed"] = changed(experiment, record["parameters"])
        if record["quick"] or record["changed"]:
            left.append(f"{name}: not a full run")
            continue
        if record["parameters"].get("set", "A") != "A":
            left.append(f"{name}: with the parameter set {record['parameters']['set']!r}")
            continue
        with xr.open_dataset(out / f"{name}.nc", engine="h5netcdf") as data:
            data.load()
        for key, value in data.attrs.items():
            data.attrs[key] = _as_written(value)
        kept: dict[str, Any] = {key: record[key] for key in KEPT if key in record}
        kept |= {"quick": False, "changed": {}, "results": summary(data)}
        kept["statements"] = [dataclasses.asdict(s) for s in experiment.judge(data)]
        write_record(kept, folder / f"{name}.json")
        shrink(out / f"{name}.png", folder / f"{name}.png")
        taken.append(name)
    return taken, left


def _as_written(value: Any) -> Any:
    """An attribute as the experiment set it: anything but numbers and texts is kept as JSON."""
    if isinstance(value, str) and value[:1] in "[{":
        try:
            return json.loads(value)
        except ValueError:
            return value
    return value


def shrink(
    source: pathlib.Path, target: pathlib.Path, width: int = WIDTH, colours: int = COLOURS
) -> None:
    """The picture `width` pixels wide, in no more than `colours` colours."""
    with Image.open(source) as picture:
        flat = Image.new("RGB", picture.size, "white")
        flat.paste(picture, mask=picture.convert("RGBA").getchannel("A"))
    size = (width, round(flat.height * width / flat.width))
    small = flat.resize(size, Image.Resampling.LANCZOS)
    small.quantize(colours, dither=Image.Dither.NONE).save(target, optimize=True)
