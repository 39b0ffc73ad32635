"""Basins in closed form: left and right of a line, a strip between, over two coordinates."""

import numpy as np
import xarray as xr

X, V = np.linspace(-0.9, 0.9, 10), np.linspace(-1.5, 1.5, 4)
WORDS = {0: "orbit_1", 1: "fixed_point_1", -1: "not_settled"}


def map_of():
    """`code[x, v]`: of the side of x, -1 beside zero; `entry` is 10 x + v."""
    code = np.where(np.abs(X) < 0.2, -1, X > 0)[:, None] * np.ones_like(V, int)
    words = {"flag_values": list(WORDS), "flag_meanings": " ".join(WORDS.values())}
    return xr.Dataset(
        {
            "code": (("x", "v"), code, {"long_name": "attractor", **words}),
            "entry": (("x", "v"), 10 * X[:, None] + V, {"long_name": "time of entry", "units": "s"}),
        },
        {"x": ("x", X, {"units": "m"}), "v": ("v", V, {"units": "m/s"})},
        {"title": "A made-up map"},
    )


def orbit(x, v):
    """A circle from the start on."""
    if v > 1.0:
        raise ArithmeticError(f"no motion from v = {v} <here>")
    time = np.linspace(0.0, 2 * np.pi, 101)
    return xr.Dataset(
        {
            "x": ("time", x * np.cos(time) + v * np.sin(time)),
            "v": ("time", v * np.cos(time) - x * np.sin(time)),
        },
        {"time": ("time", time, {"units": "s"})},
    )
