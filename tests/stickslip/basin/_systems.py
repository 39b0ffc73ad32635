"""Systems with several attractors, and their motion by SciPy."""

from typing import ClassVar

import numpy as np
from matplotlib.path import Path
from scipy.integrate import solve_ivp

from stickslip.friction import Coulomb, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact


class OnBelt(AbstractMechanism):
    """The oscillator of `spec/next.md` 3: steady sliding and stick-slip side by side."""

    belt: float = 1.5
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x - 0.1 * v.x}

    def contacts(self, t, q, v, args):
        return {"belt": Contact(Stribeck(1.0, 0.5, 0.5, exponent=1), 1.0, self.belt)}


BOX = {"x": (-2.0, 2.0), "v_x": (0.0, 2.0)}
SHARES = {1.25: 0.08019692, 1.4: 0.21226526, 1.5: 0.30712613, 1.55: 0.35659639, 1.625: 0.42809797}


def sliding_border(belt: float) -> Path:
    """The unstable cycle of the slip: backwards in time motions come to it."""

    def back(t, y):
        return [-y[1], -(-y[0] - 0.1 * y[1] + 0.5 + 0.5 * np.exp(-2.0 * (belt - y[1])))]

    rest = 0.5 + 0.5 * np.exp(-2.0 * belt)
    near = solve_ivp(back, (0.0, 2000.0), [rest + 0.05, 0.0], rtol=1e-12, atol=1e-12)
    once = solve_ivp(
        back, (0.0, 7.0), near.y[:, -1], rtol=1e-12, atol=1e-12, t_eval=np.linspace(0.0, 7.0, 20_001)
    )
    return Path(once.y.T[: _turn(once.y.T)])


def _turn(points: np.ndarray) -> int:
    """How many points until the first one returns."""
    away = np.linalg.norm(points - points[0], axis=1)
    return 1000 + int(np.argmin(away[1000:]))


class Wells(AbstractMechanism):
    """A mass in two wells at -1 and 1, with damping."""

    damping: float = 0.3
    coordinates: ClassVar = {"x": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": q.x - q.x**3 - self.damping * v.x}


class Critical(AbstractMechanism):
    """A mass on a spring, damped critically."""

    coordinates: ClassVar = {"x": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x - 2.0 * v.x}


class TwoWells(Wells):
    """The same with friction on the ground."""

    friction: float = 0.0
    contact_directions: ClassVar = {"ground": {"x": 1}}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(self.friction, self.friction), 1.0)}


def well(x: float, v: float, damping: float = 0.3) -> int:
    """-1 or 1: in which well the mass comes to rest."""

    def field(t, y):
        return [y[1], y[0] - y[0] ** 3 - damping * y[1]]

    def energy(t, y):
        # Below the saddle a motion stays in its well.
        return 0.5 * y[1] ** 2 - 0.5 * y[0] ** 2 + 0.25 * y[0] ** 4 + 1e-3

    energy.terminal = True
    end = solve_ivp(field, (0.0, 500.0), [x, v], rtol=1e-10, atol=1e-12, events=energy).y[:, -1]
    return int(np.sign(end[0]))
