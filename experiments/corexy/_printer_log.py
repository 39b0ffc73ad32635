"""Files of a printer's own accelerometer: a sweep and two plucks, read and, as an example, made."""

import pathlib
from typing import Any

import jax.numpy as jnp
import numpy as np
import pandas as pd

import corexy_jax as cx
import stickslip as ss
from corexy_jax.elastic import Belts, ElasticCoreXY, resonance_sweep, span_frequency
from stickslip.identification import read_table

from ._printer import Machine, read_printer

COLUMNS = ("time", "accel_x", "accel_y", "accel_z")
# What the example hides.
HIDDEN = {"EA_1": 1.7e4, "EA_2": 2e4, "retardation": 3.5e-4}
FRICTION = {"mu_s": 0.015, "mu_k": 0.015}
TENSIONS = (16.0, 20.0)


def read_columns(said: str, path: pathlib.Path) -> dict[str, np.ndarray]:
    """Numbers by column, in the file's units; a first line that begins with # has the names.

    Errors: `ValueError` naming the file as the command line has `said` it.
    """
    try:
        with path.open(encoding="utf-8") as lines:
            first = lines.readline().strip()
        names = [name.strip() for name in first.lstrip("#").split(",")]
        table = read_table(path, columns=names) if first.startswith("#") else read_table(path)
        rows = {name: np.asarray(row, np.float64) for name, row in table.items()}
    except (OSError, ValueError) as error:
        raise ValueError(f"{said}: it must be a table of numbers; {error}") from None
    if "time" not in rows or len(rows) < 2:
        raise ValueError(f"{said}: it must have the column time and another; it has {', '.join(rows)}.")
    bad = [name for name, row in rows.items() if not np.all(np.isfinite(row))]
    if bad or not np.all(np.diff(rows["time"]) > 0.0):
        raise ValueError(f"{said}: column {(bad or ['time'])[0]} must hold numbers, and time increase.")
    return rows


def read_pluck(name: str, beside: pathlib.Path) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and the column that moves most, from its greatest value on."""
    path = pathlib.Path(name) if pathlib.Path(name).exists() else beside.parent / name
    rows = read_columns(f"--set plucks={name}", path)
    times = rows.pop("time")
    row = max(rows.values(), key=np.std)
    first = min(int(np.argmax(np.abs(row - np.mean(row)))), times.size // 2)
    return times[first:] - times[first], row[first:]


def path_of(parameters: dict[str, Any]) -> Any:
    """The sweep that was commanded. Errors: `ValueError` naming the key."""
    text = parameters["along"]
    try:
        along = np.array([float(part) for part in text.split(",")])
        place = {"x": parameters["x"], "y": parameters["y"]}
        return resonance_sweep(
            along, parameters["f0"], parameters["f1"], parameters["rate"],
            1e-3 * parameters["per_hz"], **place,
        )  # fmt: skip
    except ValueError as error:
        raise ValueError(f"--set along={text}, f0, f1, rate, per_hz: {error}") from None


def machine_of(printer: Machine, tensions: Any, path: Any) -> ElasticCoreXY:
    """The printer as it is told, with tensions [N], along a path."""
    P1, P2 = map(float, tensions)
    p = cx.with_values(printer.parameters, {"P1": P1, "P2": P2})
    return ElasticCoreXY(p, printer.belts, printer.motors(path))


def write_example(path: pathlib.Path, parameters: dict[str, Any]) -> list[pathlib.Path]:
    """A sweep at 3200 Hz, as the firmware Klipper names its columns, and two plucks beside it."""
    motion, rate, rng = path_of(parameters), 3200.0, np.random.default_rng(0)
    told = read_printer(parameters["machine"])
    hidden = told._replace(
        parameters=cx.with_values(told.parameters, FRICTION), belts=Belts(told.belts.frame, **HIDDEN)
    )
    machine = machine_of(hidden, TENSIONS, motion)
    edges = np.arange(int((float(motion.times[-1]) + 0.05) * rate)) / rate
    system = ss.WithBreaks(machine, motion.breaks())
    start = system.start(machine.at(parameters["x"], parameters["y"]))
    integrator = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-8), max_steps=10_000_000)
    saved = ss.SaveAt(ts=jnp.asarray(edges), max_events=None)
    found = ss.simulate(system, 0.0, edges[-1], start, integrator=integrator, saveat=saved)
    assert found.outputs is not None
    y = found.outputs.y.y
    speeds = np.stack([np.asarray(y.v_x), np.asarray(y.v_y), np.zeros(edges.size)], axis=1)
    quiet = np.zeros((320, 3))
    rows = np.concatenate([quiet, np.diff(speeds, axis=0) * rate, quiet])
    rows = 1e3 * (rows + 0.1 * rng.normal(size=rows.shape) + np.array([0.2, -0.1, 9.81]))
    times = 12.0 + np.arange(len(rows)) / rate
    path.parent.mkdir(parents=True, exist_ok=True)
    written = [_write(path, COLUMNS, [times, *rows.T])]
    for k, tension in enumerate(TENSIONS):
        t = np.arange(3200) / 1600.0
        f = float(span_frequency(tension, parameters["belt_mass"], parameters["span"]))
        tone = np.exp(-4.0 * t) * np.cos(2.0 * np.pi * f * t) + 0.1 * rng.normal(size=t.size)
        beside = path.with_name(f"{path.stem}-pluck-{k + 1}.csv")
        written.append(_write(beside, ("time", "sound"), [t, tone]))
    return written


def _write(path: pathlib.Path, names: tuple[str, ...], rows: list) -> pathlib.Path:
    table = pd.DataFrame(np.round(np.stack(rows, axis=1), 6), columns=[f"#{names[0]}", *names[1:]])
    table.to_csv(path, index=False)
    return path
