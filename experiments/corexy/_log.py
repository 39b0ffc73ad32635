"""A log of a user's own machine: columns and their units, and a template that shows both."""

import dataclasses
import json
import math
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import pandas as pd

import corexy_jax as cx
import stickslip as ss
from stickslip.identification import read_table

ANGLES = ("theta_1", "theta_2")
SPEEDS = ("omega_1", "omega_2")
PLACES = ("x", "y")
PARAMETERS = tuple(field.name for field in dataclasses.fields(cx.CoreXYParameters))
MEASURED = (*ANGLES, *SPEEDS, *PLACES)
NEEDED = ("time", "v1", "v2")
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "volt": {"V": 1.0, "mV": 1e-3},
    "place": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "turn": 2.0 * math.pi, "count": math.nan},
    "speed": {
        "rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0, "count/s": math.nan,
    },
}  # fmt: skip
KIND = {"time": "time", "v1": "volt", "v2": "volt"} | dict.fromkeys(PLACES, "place")
KIND |= dict.fromkeys(ANGLES, "angle") | dict.fromkeys(SPEEDS, "speed")


class Log(NamedTuple):
    """Samples at `times` [s] from 0 on: what was measured in SI units by name, places and angles from
    where they were at rest; the voltages; and what is to be said about missing rows."""

    times: np.ndarray
    measured: dict[str, np.ndarray]
    voltage: cx.PiecewiseStep
    missing: str = ""


def pairs(key: str, text: str, allowed: tuple[str, ...]) -> dict[str, str]:
    """`a=b,c=d` as a mapping. Errors: `ValueError` naming the parameter `key`."""
    found = {}
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        name, sign, value = (piece.strip() for piece in part.partition("="))
        if not sign or not value or name not in allowed:
            raise ValueError(
                f"--set {key}={text}: it must be NAME=VALUE,... with names among {', '.join(allowed)}."
            )
        found[name] = value
    return found


def read_columns(
    path: pathlib.Path, needed: tuple[str, ...], columns: str | None, units: str = "",
    counts_per_turn: float = 0.0, said: str = "--data ",
) -> dict[str, np.ndarray]:  # fmt: skip
    """Columns of the file at `path` by name, in SI units, those of `needed` among them.

    `columns`: names of others, None where the command has no key for them.

    Errors: `ValueError` naming the file, as the command line has `said` it, the column or the unit.
    """
    names = dict(zip(KIND, KIND, strict=True)) | (named := pairs("columns", columns or "", tuple(KIND)))
    given = pairs("units", units, tuple(KIND))
    try:
        table = read_table(path)
    except (OSError, ValueError) as error:
        raise ValueError(f"{said}{path}: it must be a table of numbers; {error}") from None
    lost = [names[key] for key in needed if names[key] not in table]
    asked = [key for key in named if names[key] not in table]
    if lost or asked:
        wanted = ", ".join(lost or [names[key] for key in asked])
        raise ValueError(
            f"{said}{path}: it must have the columns {wanted}; it has {', '.join(map(str, table))}."
            + (" Name others by --set columns=time=t,v1=u_1,..." if columns is not None else "")
        )
    found = {}
    for key, kind in KIND.items():
        if names[key] in table:
            row = _column(f"{said}{path}", table, names[key])
            found[key] = row * _unit(key, kind, given, counts_per_turn)
    return found


def read_log(path: pathlib.Path, columns: str, units: str, counts_per_turn: float) -> Log:
    """The log in `path`. Errors: `ValueError` naming the file, column or unit."""
    found = read_columns(path, NEEDED, columns, units, counts_per_turn)
    rows = {key: found[key] for key in MEASURED if key in found}
    if not rows:
        raise ValueError(f"--data {path}: it must have one of the columns {', '.join(MEASURED)}.")
    times = times_of(path, found)
    moved = np.flatnonzero((found["v1"] != 0.0) | (found["v2"] != 0.0))
    if not moved.size:
        raise ValueError(f"--data {path}: v1 and v2 are zero everywhere, so nothing can be learnt.")
    still = max(int(moved[0]), 1)
    for key in (*ANGLES, *PLACES):
        if key in rows:
            rows[key] = rows[key] - np.mean(rows[key][:still])
    return Log(times, rows, _held(times, found["v1"], found["v2"]), gaps(times, found))


def times_of(path: pathlib.Path, found: dict[str, np.ndarray]) -> np.ndarray:
    """The times of a log from 0 on [s]. Errors: `ValueError` where they do not increase."""
    times = found["time"] - found["time"][0]
    if times.size < 10 or not np.all(np.diff(times) > 0.0):
        at = int(np.argmin(np.diff(times))) + 1 if times.size > 1 else 0
        raise ValueError(
            f"--data {path}: the time must increase over at least 10 rows; it does not at row {at + 1}."
        )
    return times


def _column(where: str, table: dict[str, np.ndarray], name: str) -> np.ndarray:
    numbers: Any = pd.to_numeric(table[name], errors="coerce")
    row = np.asarray(numbers, np.float64)
    bad = np.flatnonzero(~np.isfinite(row))
    if bad.size:
        raise ValueError(
            f"{where}: column {name} must hold numbers; row {int(bad[0]) + 1} holds "
            f"{np.asarray(table[name]).tolist()[int(bad[0])]!r}."
        )
    return row


def _unit(key: str, kind: str, given: dict[str, str], counts_per_turn: float) -> float:
    unit = given.get(key, next(iter(UNITS[kind])))
    if unit not in UNITS[kind]:
        raise ValueError(f"--set units={key}={unit}: it must be one of {', '.join(UNITS[kind])}.")
    if not unit.startswith("count"):
        return UNITS[kind][unit]
    if counts_per_turn <= 0.0:
        raise ValueError(
            f"--set units={key}={unit}: it needs --set counts_per_turn=N, the counts of the encoder in "
            "one turn of the pulley."
        )
    return 2.0 * math.pi / counts_per_turn


def _held(times: np.ndarray, v1: np.ndarray, v2: np.ndarray) -> cx.PiecewiseStep:
    """Voltages held until they change: a row for each change, at least two."""
    new = np.flatnonzero(np.concatenate([[True], (np.diff(v1) != 0.0) | (np.diff(v2) != 0.0)]))
    if new.size == 1:
        new = np.array([0, times.size - 1])
    return cx.PiecewiseStep(times[new], v1[new], v2[new])


def gaps(times: np.ndarray, rows: Mapping[str, np.ndarray]) -> str:
    """A sentence on gaps of a log within which a voltage changed, so that it is not known when."""
    steps = np.diff(times)
    lost = steps > 1.5 * np.median(steps)
    lost &= np.any([np.diff(rows[name]) != 0.0 for name in ("v1", "v2")], axis=0)
    if not lost.any():
        return ""
    at = int(np.flatnonzero(lost)[0])
    return (
        f"Rows are missing where a voltage changes, {int(lost.sum())} times, first between "
        f"{times[at]:.6g} s and {times[at + 1]:.6g} s: the old voltage is held to the next row."
    )


def machine_told(text: str, without: str = "Table 1 of the paper") -> str:
    """Which machine is computed: that of the file `text`, or `without` one another."""
    if text:
        return f"The machine is that of {text}."
    return f"The machine is that of {without}; --set machine=FILE names yours."


def read_machine(text: str) -> cx.CoreXYParameters:
    """Parameters of a machine in a JSON file; those of Table 1 where it names none.

    Errors: `ValueError` naming the file or the parameter.
    """
    if not text:
        return cx.CoreXYParameters()
    given = read_numbers(text, PARAMETERS)
    try:
        return cx.CoreXYParameters(**given)
    except (ValueError, TypeError) as error:
        raise ValueError(f"--set machine={text}: {error}") from None


def read_numbers(text: str, names: Iterable[str]) -> dict[str, Any]:
    """What the JSON file at a path maps some of the names to.

    Errors: `ValueError` naming the file, or what it may hold.
    """
    try:
        given = json.loads(pathlib.Path(text).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"--set machine={text}: it must be a JSON file; {error}") from None
    if not isinstance(given, dict) or not set(given) <= set(names):
        raise ValueError(
            f"--set machine={text}: it must map names among {', '.join(names)} to numbers."
        )
    return given


def write_template(path: pathlib.Path) -> list[pathlib.Path]:
    """A log of the machine of scenario 3, one second of steps at 200 Hz, and its parameters beside it,
    but for the tensions, which stand there as 30 N and 20 N. Fitted as it is, it gives 20 N and 30 N.

    Gentle steps under which no belt slips: with four times the voltage both do, and the same fits end
    in minima of their own.
    """
    machine = cx.scenario(3).parameters
    times = np.arange(0, 201) / 200.0
    steps = np.array([0.0, 0.05, 0.3, 0.55, 0.8])
    volts = np.array([[0.0, 4.5, -4.5, 3.0, -1.5], [0.0, 1.5, 3.75, -4.5, 2.25]])
    voltage = cx.PiecewiseStep(steps, *volts)
    system = cx.CoreXY(machine, voltage)
    found = ss.simulate(system, 0.0, times[-1], system.state(), saveat=ss.SaveAt(ts=jnp.asarray(times)))
    assert found.outputs is not None
    y = found.outputs.y
    held = np.searchsorted(steps, times, side="right") - 1
    rng = np.random.default_rng(0)
    table = {"time": times, "v1": volts[0][held], "v2": volts[1][held]}
    for name in (*ANGLES, *PLACES):
        size = 1e-3 if name in ANGLES else 1e-4
        table[name] = np.round(np.asarray(getattr(y, name)) + size * rng.normal(size=times.size), 6)
    beside = path.with_name(f"{path.stem}-machine.json")
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(table).to_csv(path, index=False)
    write_machine(cx.with_values(machine, {"P1": 30.0, "P2": 20.0}), beside)
    return [path, beside]


def write_machine(machine: cx.CoreXYParameters, path: pathlib.Path) -> None:
    """Its parameters by name, as `read_machine` reads them."""
    values = {name: float(getattr(machine, name)) for name in PARAMETERS}
    path.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
