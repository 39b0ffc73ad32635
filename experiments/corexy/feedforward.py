"""The outlook of the paper: the fastest voltages with which no belt slips, and under wrong tensions."""

from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import corexy_jax as cx
import stickslip as ss
from stickslip.derived import WithIntegrals

from .._experiment import Context, Experiment
from .._statement import Untold, Verdict, judge_all, statement
from .._thresholds import Designs

PATH = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.25, 0.05))  # [m]
MACHINE = {"P1": 20.0, "P2": 30.0, "mu_1s_b": 3.0, "mu_2s_b": 3.0}
SLIPS = 1e-9  # [m]; less is rounding
ERROR = 0.3  # of the tensions, that the careful plan knows of
COLOURS = ("#1f4e9c", "#c0392b")


def _slip_rates(machine: Any, t: Any, y: Any, mode: Any, args: Any) -> Any:
    return machine.slips(t, y, mode, args)


def _lane(p: Any, voltage: Any, end: Any, goal: Any, one: Any, two: Any) -> dict[str, Any]:
    """Slip distances and end error [m] of a machine with its tensions multiplied."""
    machine = cx.with_values(p, {"P1": p.P1 * one, "P2": p.P2 * two})
    system = cx.CoreXY(machine, voltage)
    ledger = WithIntegrals(system, _slip_rates, units={"slip_1": "m", "slip_2": "m"})
    found = ss.simulate(
        ledger, 0.0, 2.0 * end, ledger.start(system.state()), saveat=ss.SaveAt(max_events=None),
        throw=False,
    )  # fmt: skip
    y, slip = found.y1.y, found.y1.integrals
    good = jnp.where(found.successful, 1.0, jnp.nan)
    off = jnp.hypot(y.x - goal[0], y.y - goal[1])
    return {"slip_1": good * slip["slip_1"], "slip_2": good * slip["slip_2"], "off": good * off}


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    machine = cx.CoreXYParameters(**MACHINE)
    errors = np.array([0.0, parameters["error"]])
    plans = [
        cx.feedforward(
            machine, PATH, volts=parameters["volts"], margin=parameters["margin"], tension_error=error
        )
        for error in errors
    ]
    factors = np.linspace(1.0 - parameters["range"], 1.0 + parameters["range"], parameters["points"])
    which, one, two = (
        a.ravel() for a in np.meshgrid(np.arange(len(plans)), factors, factors, indexing="ij")
    )
    # All plans in one program: a lane picks its voltages by number.
    voltages, ends = _stacked([plan.voltage for plan in plans]), jnp.stack([p.end for p in plans])
    lanes = ss.map_lanes(
        lambda k, a, b: _lane(
            plans[0].parameters, jax.tree.map(lambda rows: rows[k], voltages), ends[k],
            plans[0].points[-1], a, b,
        ),
        executor=parameters["executor"],
    )(which, one, two)  # fmt: skip
    shape = (len(plans), factors.size, factors.size)
    found = {name: np.asarray(a).reshape(shape) for name, a in lanes.items()}
    columns: dict[str, list] = {}
    limits = 2.0 * np.array([MACHINE["mu_1s_b"] * MACHINE["P1"], MACHINE["mu_2s_b"] * MACHINE["P2"]])
    for number, plan in enumerate(plans):
        told = cx.check_rolling(plan)
        print(f"{float(plan.end):.4f} s: {told}")
        shown = np.linspace(0.0, 1.0, 1001) * float(plan.end)
        piece = np.clip(np.searchsorted(plan.times, shown, side="right") - 1, 0, plan.times.size - 2)
        row = {
            "end": float(plan.end), "deviation": float(told.deviation),
            "time": shown, "volts": np.stack(jax.vmap(plan.voltage)(jnp.asarray(shown)), axis=-1),
            "place": np.asarray(plan.at(shown)), "use": np.abs(plan.belt_force[piece]) / limits,
            **{name: a[number] for name, a in found.items()},
        }  # fmt: skip
        for name, value in row.items():
            columns.setdefault(name, []).append(value)
    dims = {
        "end": (), "deviation": (), "time": ("row",), "volts": ("row", "motor"),
        "place": ("row", "axis"), "use": ("row", "motor"),
        **dict.fromkeys(("slip_1", "slip_2", "off"), ("factor_1", "factor_2")),
    }  # fmt: skip
    units = {"end": "s", "time": "s", "volts": "V", "use": "1"}
    return xr.Dataset(
        {
            name: (("plan", *dims[name]), np.array(rows), {"units": units.get(name, "m")})
            for name, rows in columns.items()
        },
        {
            "plan": ["nominal", "careful"], "motor": [1, 2], "axis": ["x", "y"],
            "factor_1": factors, "factor_2": factors, "error": ("plan", errors),
        },
        {"volts_limit": parameters["volts"], "margin": parameters["margin"]},
    )  # fmt: skip


def _stacked(voltages: list[cx.Ramps]) -> cx.Ramps:
    """Tables of the same length, one after the other; behind its end a table goes on at 0 V."""
    most = max(voltage.times.size for voltage in voltages)

    def longer(voltage: cx.Ramps) -> cx.Ramps:
        more = most - voltage.times.size
        times = jnp.append(voltage.times, voltage.times[-1] + 1.0 + jnp.arange(more))
        rows = (voltage.v1, voltage.v2, voltage.slope_1, voltage.slope_2)
        return cx.Ramps(times, *(jnp.pad(row, (0, more)) for row in rows))

    return jax.tree.map(lambda *rows: jnp.stack(rows), *(longer(voltage) for voltage in voltages))


def _slips(data: xr.Dataset) -> xr.DataArray:
    """1 where belt 1 slips, 2 belt 2, 3 both; NaN where a run failed."""
    one, two = data.slip_1, data.slip_2
    return xr.where(np.isfinite(one), 1.0 * (one > SLIPS) + 2.0 * (two > SLIPS), np.nan)


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 3, figsize=(12.0, 7.2))
    way, volts, use, *maps, ends = axes.flat
    way.plot(*data.place.sel(plan="nominal").values.T, color=COLOURS[0])
    way.plot(*np.array(PATH).T, "o", ms=3, color="0.3")
    way.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="path, rest to rest at the points")
    for k, name in enumerate(data["plan"].values):
        part = data.sel(plan=name)
        for motor, style in zip((1, 2), ("-", "--"), strict=True):
            row, label = part.sel(motor=motor), f"{name}, motor {motor}"
            volts.plot(row.time, row.volts, style, lw=0.9, color=COLOURS[k], label=label)
            use.plot(row.time, row.use, style, lw=0.9, color=COLOURS[k], label=label)
    use.axhline(data.attrs["margin"], color="0.6", lw=0.7)
    volts.set(xlabel="time [s]", ylabel="voltage [V]", title="voltages")
    use.set(xlabel="time [s]", ylabel="of the static friction", title="what the belts need, nominal")
    volts.legend(frameon=False, fontsize=6)
    kinds = _slips(data)
    for axis, name in zip(maps, data["plan"].values, strict=True):
        picture = axis.pcolormesh(
            data.factor_1, data.factor_2, kinds.sel(plan=name).T, cmap="YlOrRd", vmin=0, vmax=3
        )
        bar = figure.colorbar(picture, ax=axis, ticks=[0, 1, 2, 3])
        bar.ax.set_yticklabels(["none", "1", "2", "both"])
        axis.plot(1.0, 1.0, "k+")
        error, end = (float(data[key].sel(plan=name)) for key in ("error", "end"))
        axis.set(
            xlabel="tension 1 over nominal", ylabel="tension 2 over nominal",
            title=f"belts that slip, plan for {error:.0%} error: {end:.3f} s",
        )  # fmt: skip
    picture = ends.pcolormesh(
        data.factor_1, data.factor_2, 1e3 * data.off.sel(plan="careful").T, vmax=50.0
    )
    figure.colorbar(picture, ax=ends)
    ends.set(
        xlabel="tension 1 over nominal", ylabel="tension 2 over nominal",
        title="end off the last point [mm], careful plan",
    )  # fmt: skip
    for axis in axes.flat:
        axis.title.set_size(9)
    return figure


def _of_known_tensions(data: xr.Dataset) -> np.ndarray:
    """Which belts slip, by plan and by the tensions that the careful plan knows of; NaN: run failed."""
    error = float(data.error.sel(plan="careful")) + 1e-9  # rounding of the grid
    one, two = (np.abs(data[name].values - 1.0) < error for name in ("factor_1", "factor_2"))
    return _slips(data).values[:, one][:, :, two].reshape(2, -1)


@statement("F1", f"The collar follows the path to {Designs.FOLLOWS:g} m with both motors rolling.")
def follows_the_path(data: xr.Dataset) -> Verdict:
    """Greatest deviation from the path, and slips, with the tensions as planned."""
    deviation = data.deviation.values
    slips = _slips(data).sel(factor_1=1.0, factor_2=1.0, method="nearest").values
    return (
        bool(np.all(deviation < Designs.FOLLOWS) and np.all(slips == 0.0)),
        f"greatest deviation {np.max(deviation):.1e} m",
    )


@statement("F2", f"A plan that knows of tensions {ERROR:.0%} off slips with none of them.")
def careful_plan_never_slips(data: xr.Dataset) -> Verdict:
    """Share of the tensions with which a belt slips, by both plans."""
    error = float(data.error.sel(plan="careful"))
    if error != ERROR:
        raise Untold(f"the plan knows of tensions {error:.0%} off")
    within = _of_known_tensions(data)
    failed = int(np.isnan(within).sum())
    shares = [float(np.mean(row[np.isfinite(row)] > 0.0)) for row in within]
    ends = data.end.values
    return (
        shares[1] == 0.0 and failed == 0,
        f"of the tensions within it {shares[0]:.0%} slip by the nominal plan of {ends[0]:.4f} s, "
        f"{shares[1]:.1%} by the careful one of {ends[1]:.4f} s; {failed} runs failed",
    )


judge = judge_all("F")


EXPERIMENT = Experiment(
    name="corexy-feedforward",
    title="CoreXY: the fastest voltages along a path with which no belt slips, and wrong tensions",
    parameters={
        "volts": 24.0, "margin": 0.9, "error": ERROR, "range": 0.4, "points": 41, "executor": "auto",
    },
    quick={"points": 5, "executor": "portable"},
    compute=compute,
    draw=draw,
    judge=judge,
)  # fmt: skip
