"""Belts of a printer from its accelerometer: stiffness by a sweep, tension by plucks."""

import math
import pathlib
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import scipy.signal
import xarray as xr
from matplotlib.figure import Figure

from corexy_jax.elastic import BeltFit, HeadRecord, Pluck, fit_belts, pluck_tone, span_tension
from stickslip.identification import ljung_box

from .._data import listed
from .._experiment import Context, Experiment
from .._starts import Start, starts_told
from ._advice import GOOD, SURE, looser
from ._printer import Machine, read_printer
from ._printer_log import COLUMNS, machine_of, path_of, read_columns, read_pluck, write_example

NAMES = ("EA_1", "EA_2", "retardation", "mu")
SAME = 0.3  # part of the motion that a model of another machine leaves
PARAMETERS: dict[str, Any] = {
    "along": "1,1", "f0": 30.0, "f1": 110.0, "rate": 40.0, "per_hz": 60.0, "x": 0.0, "y": 0.0,
    "machine": "", "plucks": "", "span": 0.15, "span_error": 5e-4, "belt_mass": 0.0084, "lowest": 20.0,
    "highest": 400.0,
}  # fmt: skip


def _tensions(
    parameters: dict[str, Any], printer: Machine, log: pathlib.Path
) -> tuple[list[float], list[str]]:
    """Tensions of both belts [N], by plucks where there are any, and what is to be said about them."""
    names = listed("plucks", parameters["plucks"])
    if not names:
        given = [float(printer.parameters.P1), float(printer.parameters.P2)]
        return given, [
            f"Tensions were not measured: {given[0]:g} N and {given[1]:g} N are taken for the loads of "
            "the pulleys. No sweep tells them; --set plucks=ONE.csv,TWO.csv does."
        ]
    if len(names) != 2:
        raise ValueError(f"--set plucks={parameters['plucks']}: it must be two files, belt 1 and 2.")
    rho, length = parameters["belt_mass"], parameters["span"]
    tones: list[Pluck] = [
        pluck_tone(*read_pluck(name, log), parameters["lowest"], parameters["highest"])
        for name in names
    ]
    found = [float(span_tension(tone.frequency, rho, length)) for tone in tones]
    errors = [2.0 * T * tone.error / tone.frequency for T, tone in zip(found, tones, strict=True)]
    shared = 2.0 * SURE * parameters["span_error"] / length
    said = [
        f"Belt {k + 1} sounds at {tone.frequency:.2f} +- {SURE * tone.error:.2g} Hz: {T:.2f} N "
        f"+- {np.hypot(SURE * error, shared * T):.2g} N (95%), of which +- {SURE * error:.2g} N are "
        "the tone and the rest the length of the span."
        + ("" if tone.explained > 0.5 else f" Only {tone.explained:.0%} of the record are this tone.")
        for k, (tone, T, error) in enumerate(zip(tones, found, errors, strict=True))
    ]
    half = SURE * math.hypot(*errors) + shared * abs(found[0] - found[1])
    loose, tight = (0, 1) if found[0] < found[1] else (1, 0)
    said.append(looser(found[0], found[1], half))
    if found[tight] - found[loose] > half:
        said.append(f"It is done when belt {loose + 1} sounds at {tones[tight].frequency:.1f} Hz too.")
    return found, said


def _verdict(found: BeltFit) -> str:
    """How far the numbers can be trusted."""
    chi = float(found.fit.reduced_chi_squared)
    p = min(
        float(ljung_box(a - b, 20).p_value)
        for own, seen in zip(found.computed, found.measured, strict=True)
        for a, b in zip(own.T, seen.T, strict=True)
    )
    left = f"{found.unexplained:.1%} of the motion, {chi**0.5:.2g} times the noise"
    white = "white" if p > 0.01 else f"NOT white (p = {p:.1g})"
    if not found.unexplained < SAME:
        return (
            f"VOID: the residuals are {left}, and {white}: the machine computed is not the one "
            "measured, or was not commanded so. Check along, f0, f1, rate, per_hz, the place x, y and "
            "the masses."
        )
    if chi > GOOD or not bool(found.fit.successful):
        word = "USABLE WITH CARE" if found.unexplained < 0.3 * SAME else "DOUBTFUL"
        return (
            f"{word}: the residuals are {left}, and {white}: the model is not quite this machine. "
            "Intervals take the residuals as large and as long together as they are; they do not see "
            "an error of the masses, of the frame or of the place."
        )
    return f"GOOD: the residuals are {left}, and {white}. The intervals stand, for masses as told."


def analysed(log: pathlib.Path, parameters: dict[str, Any]) -> xr.Dataset:
    """The record at `log` and its plucks. Errors: `ValueError` naming the file or key."""
    rows = read_columns(f"--data {log}", log)
    if not set(COLUMNS[:3]) <= set(rows):
        raise ValueError(f"--data {log}: it must have the columns {', '.join(COLUMNS[:3])}.")
    path = path_of(parameters)
    printer = read_printer(parameters["machine"])
    tensions, said = _tensions(parameters, printer, log)
    machine = machine_of(printer, tensions, path)
    record = HeadRecord(path, rows["time"], *(1e-3 * rows[name] for name in COLUMNS[1:3]))
    found = fit_belts(machine, record)
    value = {name: float(found.fit.values[name]) for name in NAMES}
    half = {name: SURE * found.errors[name] for name in NAMES}
    ends = {name: (value[name] - half[name], value[name] + half[name]) for name in NAMES}
    ratio = value["EA_1"] / value["EA_2"] - 1.0
    off = float(np.hypot(half["EA_1"] / value["EA_1"], half["EA_2"] / value["EA_2"]))
    same = abs(ratio) <= off
    stiffer = "as stiff as" if same else f"{abs(ratio):.1%} {'stiffer' if ratio > 0 else 'softer'} than"
    said += [
        f"The sweep begins at {float(found.fit.values['begin[0]']):.4f} s of the record's clock.",
        *(
            f"EA of belt {k}: {value[f'EA_{k}']:.6g} N +- {half[f'EA_{k}']:.2g} N (95%)."
            for k in (1, 2)
        ),
        f"Belt 1 is {stiffer} belt 2, +- {100.0 * off:.2g}%."
        + ("" if same else " Tension does not do that: other belts, wear, or other lengths."),
        f"Damping of the belts: {value['retardation']:.4g} +- {half['retardation']:.2g} s.",
        f"Friction of rails and pulleys: {value['mu']:.4g} +- {half['mu']:.2g} of the load.",
        _verdict(found),
    ]
    print("\n".join(said))
    said.insert(0, starts_told(fitted=Start("rest", "belts are not stretched, motors hold")))
    return xr.Dataset(
        {
            "estimate": ("unknown", [value[name] for name in NAMES]),
            "interval": (("unknown", "side"), [ends[name] for name in NAMES]),
            "tension": ("belt", tensions, {"units": "N"}),
            "measured": (("time", "axis"), found.measured[0], {"units": "m/s2"}),
            "computed": (("time", "axis"), found.computed[0], {"units": "m/s2"}),
        },
        {
            "unknown": list(NAMES), "side": ["lower", "upper"], "belt": [1, 2], "axis": ["x", "y"],
            "time": ("time", found.times[0], {"units": "s"}),
        },
        {
            "report": "\n".join(said), "chi_squared": float(found.fit.reduced_chi_squared),
            "unexplained": found.unexplained, "highest": 1.5 * parameters["f1"],
        },
    )  # fmt: skip


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """An example, written beside the results and analysed as a record of one's own would be."""
    log = context.stores.parent / "identify-printer-log.csv"
    files = write_example(log, parameters)
    return analysed(log, parameters | {"plucks": ",".join(path.name for path in files[1:])})


def compute_own(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    assert context.data is not None
    return analysed(context.data, parameters)


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 6.4), sharex="col")
    step = float(np.median(np.diff(data.time)))
    for (spectrum, rest), axis in zip(axes, data.axis.values, strict=True):
        one = data.sel(axis=axis)
        rows = (one.measured, "0.5", "measured"), (one.computed, "#1f4e9c", "computed")
        off = one.measured - one.computed, "#c0392b", "residual"
        for row, colour, label in (*rows, off):
            f, power = scipy.signal.welch(np.asarray(row), 1.0 / step, nperseg=min(256, row.size))
            shown = f < data.attrs["highest"]
            spectrum.semilogy(f[shown], power[shown], color=colour, label=label, lw=1.2)
        rest.plot(one.time, one.measured, color="0.7", lw=0.6, label="measured")
        rest.plot(one.time, off[0], color=off[1], lw=0.6, label="residual")
        spectrum.set_ylabel(f"along {axis} [(m/s²)²/Hz]")
        rest.set_ylabel(f"along {axis} [m/s²]")
    axes[1, 0].set_xlabel("frequency [Hz]")
    axes[1, 1].set_xlabel("time of the record [s]")
    for axis in axes[0]:
        axis.legend(frameon=False, fontsize=8)
    axes[0, 0].set_title(str(data.attrs["report"]).split("\n")[-1][:90], fontsize=8, loc="left")
    return figure


def template(path: pathlib.Path) -> list[pathlib.Path]:
    """The example of the defaults."""
    return write_example(path, PARAMETERS)


EXPERIMENT = Experiment(
    name="identify-printer",
    title="A printer's belts: stiffness, friction and tensions from its accelerometer, an example",
    parameters=PARAMETERS,
    quick={"f0": 50.0, "f1": 95.0, "rate": 90.0},
    compute=compute,
    draw=draw,
    measured=Experiment(
        name="identify-printer",
        title="A printer's belts: stiffness, friction and tensions from its accelerometer",
        parameters=PARAMETERS,
        quick={},
        compute=compute_own,
        draw=draw,
        template=template,
    ),
)  # fmt: skip
