"""Systems with several attractors, and their motion by SciPy."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from matplotlib.path import Path
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

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
    """A mass in two wells, at -1 and 1 without a tilt, with damping."""

    damping: float = 0.3
    tilt: float = 0.0
    coordinates: ClassVar = {"x": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": q.x - q.x**3 - self.damping * v.x + self.tilt}


class Hill(AbstractMechanism):
    """A mass in a well at 0 with a hill at 1, beyond which it is pulled away ever more."""

    coordinates: ClassVar = {"x": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x + q.x**2 - 0.1 * v.x}


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


def saddle_border(damping: float = 0.3, tilt: float = 0.0, until: float = 22.0) -> list:
    """The stable manifold of the saddle between the wells, backwards in time: a motion each way."""

    def back(t, y):
        return [-y[1], -(y[0] - y[0] ** 3 - damping * y[1] + tilt)]

    saddle = min(np.roots([-1.0, 0.0, 1.0, tilt]).real, key=abs)
    rate = -0.5 * damping - np.sqrt(0.25 * damping**2 + 1.0 - 3.0 * saddle**2)
    starts = [[saddle, 0.0] + 1e-7 * side * np.array([1.0, rate]) for side in (1.0, -1.0)]
    given = {"rtol": 1e-12, "atol": 1e-14, "dense_output": True}
    return [solve_ivp(back, (0.0, until), start, **given).sol for start in starts]


def share_at_the_right(x, v, box: dict, count: int = 200_000) -> float:
    """Share of a box in x and v on the side of a long curve that is at its right, row by row.

    Whether a row begins on that side is known by how often the curve cuts it beyond the box.
    """
    (left, right), (low, high) = box.values()
    number = (v - low) / (high - low) * count - 0.5
    first = np.floor(number).astype(int)
    cuts = [[] for _ in range(count)]
    for i in np.flatnonzero(first[1:] != first[:-1]):
        for row in range(min(first[i : i + 2]) + 1, max(first[i : i + 2]) + 1):
            if 0 <= row < count:
                part = (row - number[i]) / (number[i + 1] - number[i])
                cuts[row].append(x[i] + part * (x[i + 1] - x[i]))
    widths = 0.0
    for row in cuts:
        cut = np.sort(row)[::-1]
        ends = np.concatenate([[right], cut[(cut > left) & (cut < right)], [left]])
        widths += np.sum((ends[:-1] - ends[1:])[np.sum(cut > right) % 2 :: 2])
    return widths / count / (right - left)


def nearest(curves: list, place: np.ndarray, sizes: np.ndarray) -> float:
    """Least distance of curves from a place, in the sizes of the components."""
    found = []
    for curve in curves:
        t = np.linspace(0.0, 22.0, 20_001)
        away = np.linalg.norm((curve(t).T - place) / sizes, axis=1)
        at = float(t[np.argmin(away)])
        fine = minimize_scalar(
            lambda t, curve=curve: float(np.sum(((curve(t) - place) / sizes) ** 2)),
            bounds=(at - 0.01, at + 0.01), method="bounded", options={"xatol": 1e-10},
        )  # fmt: skip
        found.append(np.sqrt(fine.fun))
    return min(found)


def rest_after(x: float, v: float, damping: float, friction: float) -> float:
    """Where a mass between two wells with friction rests that is pushed at a place: slip by slip."""
    y = [x, v]
    while True:
        sense = np.sign(y[1])

        def field(t, y, sense=sense):
            return [y[1], y[0] - y[0] ** 3 - damping * y[1] - friction * sense]

        def stops(t, y):
            return y[1]

        stops.terminal, stops.direction = True, -sense
        slip = solve_ivp(field, (0.0, 500.0), y, rtol=1e-12, atol=1e-13, events=stops)
        x = float(slip.y[0, -1])
        if abs(x - x**3) <= friction:
            return x
        y = [x, np.sign(x - x**3) * 1e-12]


class MagneticPendulum(AbstractMechanism):
    """A pendulum above three magnets on a circle, one of them on the axis of x."""

    coordinates: ClassVar = {"x": "m", "y": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        pull = [-0.5 * q.x - 0.2 * v.x, -0.5 * q.y - 0.2 * v.y]
        for x, y in MAGNETS:
            away = x - q.x, y - q.y
            cube = (away[0] ** 2 + away[1] ** 2 + 0.09) ** 1.5
            pull = [force + part / cube for force, part in zip(pull, away, strict=True)]
        return {"x": pull[0], "y": pull[1]}


MAGNETS = [(1.0, 0.0), (-0.5, 0.75**0.5), (-0.5, -(0.75**0.5))]


def magnet(x: float, y: float) -> int:
    """Above which magnet a pendulum comes to rest that is let go at a place."""
    places = np.array(MAGNETS)

    def field(t, z):
        away = places - z[:2]
        pull = np.sum(away / (np.sum(away**2, axis=1) + 0.09)[:, None] ** 1.5, axis=0)
        return [*z[2:], *(pull - 0.5 * z[:2] - 0.2 * z[2:])]

    end = solve_ivp(field, (0.0, 200.0), [x, y, 0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-12)
    return int(np.argmin(np.sum((places - end.y[:2, -1]) ** 2, axis=1)))


class Duffing(AbstractMechanism):
    """The mass between two wells, pushed to and fro."""

    damping: float = 0.15
    force: float = 0.3
    frequency: float = 1.0
    coordinates: ClassVar = {"x": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        push = self.force * jnp.cos(self.frequency * t)
        return {"x": q.x - q.x**3 - self.damping * v.x + push}


def strobes(system: Duffing, x, v, periods: int, steps: int = 120) -> tuple[np.ndarray, float]:
    """States after each period by Runge and Kutta's method, `[period, x or v, start]`, and the greatest
    exponent of the first start over the second half, by the deviation that goes with it."""
    w, d, h = system.frequency, system.damping, 2.0 * np.pi / system.frequency / steps

    def field(t, z):
        x, v, a, b = z
        push = system.force * np.cos(w * t)
        return np.stack([v, x - x**3 - d * v + push, b, (1.0 - 3.0 * x**2) * a - d * b])

    z = np.stack([x, v, np.ones_like(x), np.zeros_like(x)])
    rows, grown = [], []
    for _ in range(periods):
        for k in range(steps):
            t = k * h
            k1 = field(t, z)
            k2 = field(t + h / 2, z + h / 2 * k1)
            k3 = field(t + h / 2, z + h / 2 * k2)
            z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + field(t + h, z + h * k3))
        size = np.hypot(z[2], z[3])
        z[2:] /= size
        rows.append(z[:2].copy())
        grown.append(np.log(size[0]))
    return np.array(rows), float(np.mean(grown[periods // 2 :])) * w / (2.0 * np.pi)


class HalfDamped(AbstractMechanism):
    """A hardening oscillator without damping, and one with it that knows nothing of the first."""

    coordinates: ClassVar = {"x": "m", "y": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x - 0.3 * q.x**3, "y": -2.0 * q.y - 0.5 * v.y}


class TwoRotors(AbstractMechanism):
    """Two oscillators of van der Pol's that know nothing of each other."""

    drive: tuple[float, float] = (0.5, 0.3)
    coordinates: ClassVar = {"x": "m", "y": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        a, b = self.drive
        return {
            "x": -q.x + a * (1.0 - q.x**2) * v.x,
            "y": -2.3 * q.y - 0.3 * q.y**3 + b * (1.0 - q.y**2) * v.y,
        }
