"""One run as plain arrays, with the words the statements need."""

import numpy as np
import xarray as xr

from .._statement import Untold
from .._thresholds import CoreXY

ROUNDING = 1e-9  # of times [s]

# What the statements read of a run.
READ = (
    "x", "y", "vx", "vy", "ax", "ay", "dmn", "tau_x", "dead_x", "omega", "omega_v", "tau_motor",
    "tau_belt", "dead_motor", "v", "v_high", "v_low", "kinetic_belt",
)  # fmt: skip


class View:
    """Arrays of one way of one scenario; motors are columns 0 and 1."""

    x: np.ndarray
    y: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    ax: np.ndarray
    ay: np.ndarray
    dmn: np.ndarray
    tau_x: np.ndarray
    dead_x: np.ndarray

    def __init__(self, data: xr.Dataset):
        self.t = np.asarray(data.time)
        self.dt = float(self.t[1] - self.t[0])
        for name in ("x", "y", "vx", "vy", "ax", "ay", "dmn", "tau_x", "dead_x"):
            setattr(self, name, np.asarray(data[name]))
        self.omega, self.turn = np.asarray(data.omega), np.asarray(data.omega_v)
        self.torque, self.belt = np.asarray(data.tau_motor), np.asarray(data.tau_belt)
        self.static, self.v = np.asarray(data.dead_motor), np.asarray(data.v)
        # The dead zone of the motor torque as a voltage, R tau/K_t, as the statements take it.
        self.bound = 0.5 * (np.asarray(data.v_high) - np.asarray(data.v_low))
        self.kinetic = np.asarray(data.kinetic_belt)
        self.slips = np.stack([np.isin(self.dmn, (2, 4)), np.isin(self.dmn, (3, 4))], axis=1)
        self.moving = np.hypot(self.vx, self.vy) > CoreXY.MOVING
        self.inside = np.abs(self.v) < self.bound

    def runs(self, mask) -> list[tuple[int, int]]:
        """First and one past the last row of every run of `mask`."""
        edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, int), [0]])))
        return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]

    def long_runs(self, mask, least: float = CoreXY.LASTS) -> list[tuple[int, int]]:
        """Runs of at least `least` seconds. Raises `Untold` where the rows are farther apart."""
        self.resolves(least)
        return [(a, b) for a, b in self.runs(mask) if (b - a) * self.dt >= least]

    def resolves(self, interval: float) -> None:
        """Raises `Untold` where the rows are farther apart than `interval` [s]."""
        if self.dt > interval * (1 + 1e-6):
            raise Untold(f"rows every {self.dt:.3g} s do not show {interval:.3g} s")

    def reaches(self, end: float) -> None:
        """Raises `Untold` where the record ends before `end` [s]."""
        if self.t[-1] < end - ROUNDING:
            raise Untold(f"the record ends at {self.t[-1]:.4g} s, before {end:.4g} s")

    def after(self, start: float):
        """Rows later than `start` [s]; raises `Untold` if there are none."""
        self.reaches(start + self.dt)
        return self.t > start

    def between(self, start: float, end: float):
        """Rows with `start <= t <= end`. Raises `Untold` where the record ends before."""
        self.reaches(end)
        return (self.t >= start - ROUNDING) & (self.t <= end + ROUNDING)

    def first(self, mask) -> float:
        """Time of the first row of `mask`; infinite if there is none."""
        return float(self.t[np.argmax(mask)]) if np.any(mask) else np.inf

    def share(self, mask, within=None) -> float:
        """Part of the rows (of `within`) in `mask`; 0 of no rows."""
        chosen = mask if within is None else mask[within]
        return float(np.mean(chosen)) if np.size(chosen) else 0.0

    def greatest(self, values, mask) -> float:
        """Largest magnitude over `mask`, 0 if it is empty."""
        return float(np.max(np.abs(values[mask]), initial=0.0))

    def at_kinetic(self):
        """Rows in which each belt torque is its kinetic friction."""
        return np.isclose(np.abs(self.belt), self.kinetic[None], rtol=CoreXY.KINETIC)


def what_is_wrong(data: xr.Dataset) -> str:
    """Why a run says nothing at all: too few rows, or not finite; empty if it does."""
    if data.sizes.get("time", 0) < CoreXY.FEWEST:
        return f"the run has {data.sizes.get('time', 0)} rows"
    for name in READ:
        values = data[name]
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            return f"{name} of the run is not finite"
    return ""
