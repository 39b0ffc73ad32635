"""Coordinates of the search: what may vary, from where, within which bounds."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from stickslip.systems import JointedBeam

from ._model import CONTACT_PERIOD

NAMES = ("frequency", "ratio", "k2", "mu_s", "gamma", "z_A", "x0", "damping")
# The constructed set in these coordinates; frequency is that of the mass on its joint.
FIRST = np.array([0.2516, 3.0, 7.6, 0.30, 10.0, 0.4, 9.2e-4, 0.0])
LEAST = np.array([0.1, 0.3, 0.5, 0.02, 0.0, 0.1, 1e-4, 0.0])
MOST = np.array([1.0, 20.0, 100.0, 1.0, 60.0, 0.5, 1e-2, 0.2])
START = NAMES.index("x0")


def physical(coordinates: Any) -> dict[str, Any]:
    """Parameters of the beam from the coordinates of the search; the contact period is given."""
    frequency, ratio, k2, mu_s, gamma, z_A, _, damping = (coordinates[i] for i in range(len(NAMES)))
    k3 = ratio * k2
    m = (CONTACT_PERIOD / np.pi) ** 2 / (1 / jnp.sqrt(k2 + k3) + 1 / jnp.sqrt(k2)) ** 2
    k1 = m * (2 * np.pi * frequency) ** 2
    values = {"m": m, "k1": k1, "k2": k2, "k3": k3, "mu_s": mu_s, "gamma": gamma, "z_A": z_A}
    return {**values, "damping": damping}


def system_and_start(coordinates: Any, v: Any, modes: int) -> tuple[JointedBeam, Any]:
    """The beam with these coordinates at belt speed `v`, and where its motion begins."""
    system = JointedBeam(**physical(coordinates), v=v, modes=modes)
    return system, system.start(coordinates[START])


def draw_sets(rng: np.random.Generator, centre: np.ndarray, width: float, count: int) -> np.ndarray:
    """Sets around `centre`: factors exp(width * normal).

    No factor leads to or from zero: half of the sets get a damping, and a quarter a weakening of the
    friction, drawn anew, present in half of these.
    """
    sets = centre * np.exp(width * rng.standard_normal((count, centre.size)))
    for name, share, low, high in (("damping", 0.5, -4.0, -0.7), ("gamma", 0.25, -1.0, 1.8)):
        drawn = 10 ** rng.uniform(low, high, count) * (rng.random(count) < 0.5)
        column = NAMES.index(name)
        sets[:, column] = np.where(rng.random(count) < share, drawn, sets[:, column])
    return np.clip(sets, LEAST, MOST)
