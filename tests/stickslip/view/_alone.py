"""A module for the viewer that knows the parameter and nothing of sections."""

import numpy as np
import xarray as xr

from tests.stickslip.view._made_up import sections_of

ASKED: list[float] = []


def orbit(a):
    """A line of slope `a`."""
    ASKED.append(a)
    time = np.linspace(0.0, 1.0, 11)
    return xr.Dataset({"x": ("time", a * time)}, {"time": time})


def diagram(a):
    """Five lanes of the region, the sections in another order."""
    low, high = a
    return sections_of(np.linspace(low, high, 5)).isel(section=[1, 0])
