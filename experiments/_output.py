"""Files of an experiment: picture, data, and a record of how they came about."""

import dataclasses
import json
import os
import pathlib
import time
from collections.abc import Mapping
from typing import Any

import jax
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr

from stickslip.sweep import as_json, code_revision, versions

from ._experiment import Context, Experiment, chosen

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 220,
    "svg.hashsalt": "stickslip",
}


def run(
    experiment: Experiment,
    out: pathlib.Path,
    *,
    quick: bool = False,
    changes: list[str] | None = None,
    fresh: bool = False,
    data: pathlib.Path | None = None,
) -> list[pathlib.Path]:
    """Compute, draw, judge and write; the files written."""
    parameters = chosen(experiment, quick, changes or [])
    begin, spent, load = time.monotonic(), _processor_time(), os.getloadavg()[0]
    dataset = experiment.compute(parameters, Context(out / "stores", fresh, data))
    dataset = dataset.assign_attrs(experiment=experiment.name, title=experiment.title)
    computed = time.monotonic() - begin
    out.mkdir(parents=True, exist_ok=True)
    files = [write_data(dataset, out / f"{experiment.name}.nc")]
    files += draw(experiment, dataset, out)
    if experiment.table is not None:
        files.append(write_table(experiment.table(dataset), out / f"{experiment.name}.csv"))
    record = {
        "name": experiment.name,
        "title": experiment.title,
        "quick": quick,
        "parameters": parameters,
        "changed": changed(experiment, parameters),
        "versions": {**versions(), "matplotlib": matplotlib.__version__},
        "code_revision": code_revision(),
        "device": str(jax.devices()[0]),
        "cpu_count": os.cpu_count(),
        "date": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "wall_time_s": {
            "compute": round(computed, 3),
            "total": round(time.monotonic() - begin, 3),
            "processor": round(_processor_time() - spent, 3),
        },
        "load": load,
        "results": summary(dataset),
        "statements": [dataclasses.asdict(s) for s in experiment.judge(dataset)],
    }
    return [*files, write_record(record, out / f"{experiment.name}.json")]


def write_table(table: pd.DataFrame, path: pathlib.Path) -> pathlib.Path:
    """The columns as CSV, all of it or nothing."""
    temporary = path.with_name(path.name + ".part")
    table.to_csv(temporary, index=False)
    os.replace(temporary, path)
    return path


def write_record(record: dict[str, Any], path: pathlib.Path) -> pathlib.Path:
    """The record as JSON, all of it or nothing."""
    temporary = path.with_suffix(".json.part")
    temporary.write_text(json.dumps(as_json(record), indent=1, ensure_ascii=False) + "\n")
    os.replace(temporary, path)
    return path


def _processor_time() -> float:
    """Seconds of processor time of this process, all its threads, and of those that it started."""
    return sum(os.times()[:4])


def changed(experiment: Experiment, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters that are not those of a full run; those that say how and not what do not count.

    Nor does the parameter set: statements say whether it is one that a search found.
    """
    how = ("executor", "workers", "set")
    full = as_json(dict(experiment.parameters))
    return {k: v for k, v in as_json(dict(parameters)).items() if k not in how and v != full[k]}


def summary(dataset: xr.Dataset) -> dict[str, Any]:
    """Size, unit and range of every variable: what two runs of an experiment can be compared by."""
    found = {}
    for name, variable in dataset.data_vars.items():
        entry: dict[str, Any] = {
            "shape": list(variable.shape),
            "units": variable.attrs.get("units", ""),
        }
        if variable.dtype.kind in "fiu":
            values = np.asarray(variable, float)
            seen = values[np.isfinite(values)]
            # Six digits, so that equal motions of two machines make equal records.
            entry |= {"finite": int(seen.size)}
            if seen.size:
                entry |= {"least": float(f"{seen.min():.6g}"), "greatest": float(f"{seen.max():.6g}")}
        found[str(name)] = entry
    return found


def draw(experiment: Experiment, dataset: xr.Dataset, out: pathlib.Path) -> list[pathlib.Path]:
    """The picture as PNG and SVG; as GIF too, where there is an animation."""
    paths = [out / f"{experiment.name}.{kind}" for kind in ("png", "svg")]
    with matplotlib.rc_context(STYLE):
        figure = experiment.draw(dataset)
        for path in paths:
            kind = path.suffix[1:]
            temporary = path.with_name(path.name + ".part")
            # A date in the file would make two equal pictures differ.
            metadata: dict[str, Any] = {"Date": None} if kind == "svg" else {}
            figure.savefig(temporary, format=kind, metadata=metadata)
            os.replace(temporary, path)
        plt.close(figure)
        if experiment.animate is not None:
            movie = experiment.animate(dataset)
            paths.append(movie.save(out / f"{experiment.name}.gif"))
            plt.close(movie.figure)
    return paths


def write_data(dataset: xr.Dataset, path: pathlib.Path) -> pathlib.Path:
    """The dataset as compressed netCDF 4, all of it or nothing."""
    temporary = path.with_name(path.name + ".part")
    encoding = {
        str(name): {"zlib": True, "complevel": 4, "shuffle": True}
        for name, variable in dataset.variables.items()
        if variable.ndim and variable.dtype.kind in "fiub"
    }
    plain = {
        k: v if isinstance(v, str | int | float) else json.dumps(as_json(v))
        for k, v in dataset.attrs.items()
    }
    dataset.assign_attrs(plain).to_netcdf(temporary, engine="h5netcdf", encoding=encoding)
    os.replace(temporary, path)
    return path


def same_run(path: pathlib.Path, parameters: dict[str, Any]) -> bool:
    """Whether the record at `path` is of a run with these parameters and this code."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        return (
            record["parameters"] == as_json(parameters)
            and record["code_revision"] == code_revision()
            and not str(record["code_revision"]).endswith("+changes")
            and all(path.with_suffix(f".{kind}").exists() for kind in ("nc", "png", "svg"))
        )
    except (OSError, ValueError, KeyError):
        return False
