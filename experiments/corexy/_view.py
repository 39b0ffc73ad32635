"""One run as plain arrays, with the words the statements need."""

import numpy as np
import xarray as xr

STEP = 1e-4  # the paper's time step [s]: "per step" in the statements


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
        self.moving = np.hypot(self.vx, self.vy) > 1e-9
        self.inside = np.abs(self.v) < self.bound

    def runs(self, mask) -> list[tuple[int, int]]:
        """First and one past the last row of every run of `mask`."""
        edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, int), [0]])))
        return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]

    def long_runs(self, mask, least: float = 1e-3) -> list[tuple[int, int]]:
        """Runs of at least `least` seconds."""
        return [(a, b) for a, b in self.runs(mask) if (b - a) * self.dt >= least]

    def between(self, start: float, end: float):
        """Rows with `start <= t <= end`."""
        return (self.t >= start - 1e-9) & (self.t <= end + 1e-9)

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
        return np.isclose(np.abs(self.belt), self.kinetic[None], rtol=1e-6)
