"""A diagram in closed form: points `a`, `2 a`, ... per lane, one lane empty, two not settled."""

import numpy as np
import xarray as xr

A = np.linspace(1.0, 2.0, 11)
SEEDS = [10, 20]
MOST = 6


def diagram_of(a=A, seeds=SEEDS):
    """Point `n` of lane `(seed, a)` is `seed * a * (-0.5)**n`; lane `i` has `i % 5 + 1` points."""
    n = np.arange(MOST)
    x = np.array(seeds)[:, None, None] * a[:, None] * (-0.5) ** n
    count = np.broadcast_to(np.arange(a.size) % 5 + 1, (len(seeds), a.size)).copy()
    if a.size == A.size:
        count[0, 7] = 0
    x[n >= count[..., None]] = np.nan
    status = np.zeros(count.shape, np.int32)
    if a.size == A.size:
        status[0, 7], status[1, 3:5] = 2, 1
    period = np.where(status == 0, 3, -1).astype(np.int32)
    period[0, 2] = 0
    why = np.where(period < 0, 1, 0).astype(np.int32)
    grid = ("seed", "a")
    return xr.Dataset(
        {
            "t": ((*grid, "point"), np.where(np.isnan(x), np.nan, n * 1.0)),
            "x": ((*grid, "point"), x, {"units": "m", "long_name": "place <x>"}),
            "status": (grid, status, {"flag_meanings": "ok not_settled no_crossing"}),
            "period": (grid, period, {"max_period": 16}),
            "period_status": (grid, why, {"flag_meanings": "repeats too_few_points"}),
        },
        {"a": ("a", a, {"units": "N", "long_name": "load $a$"}), "seed": seeds},
        {"title": "A made-up diagram"},
    )


def sections_of(a=A):
    """Two sections as `orbit_diagram` has them: `top` is that of seed 10, `low` of seed 20."""
    both = diagram_of(a).rename(seed="section").assign_coords(section=["top", "low"])
    both["status"] = both.status.isel(section=0, drop=True)  # a run has one
    grid = both.transpose("a", "section", "point")
    return grid.assign_attrs(sections=["top", "low"])


def orbit(a, seed):
    """A circle of radius `a` around `seed`."""
    if a > 1.85:
        raise ArithmeticError(f"no orbit at a = {a:.2f} <here>")
    time = np.linspace(0.0, 2 * np.pi, 101)
    return xr.Dataset(
        {"v": ("time", a * np.sin(time)), "x": ("time", seed + a * np.cos(time))},
        {"time": ("time", time, {"units": "s"})},
    )


def diagram(a, seed):
    """Five lanes of the region."""
    low, high = a
    return diagram_of(np.linspace(low, high, 5), [seed]).isel(seed=0)
