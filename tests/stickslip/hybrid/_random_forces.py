"""Random forces in pieces on two coupled masses, and their motion by SciPy, cut at every border.

A force is a sum of pieces: a gain times a shape of one argument, such as a speed or a distance. A
shape is given twice: as a user writes it in JAX, and as its borders with a smooth function between.
"""

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

import stickslip as ss
from stickslip.mechanism import AbstractMechanism

LENGTH = 6.0  # s
KEPT = ("x", "y", "v_x", "v_y")


class Shape(NamedTuple):
    """`force(z, a, b)` in JAX; `borders(a, b)`, and `parts(a, b)` below, between and above them.

    `declared`: by a helper or by `switches`; else a user wrote it in JAX. `jumps`: whether it jumps.
    """

    declared: bool
    jumps: bool
    force: Callable
    borders: Callable
    parts: Callable


def _one(below: Callable, above: Callable) -> tuple[Callable, Callable]:
    """Borders and parts of a shape with one border, at `a`."""
    return (
        lambda a, b: [a],
        lambda a, b: [lambda z: below(z - a, b), lambda z: above(z - a, b)],
    )


def _flanks(a: float, b: float) -> list:
    return [lambda z: z + b, lambda z: 0.0, lambda z: z - b]


def _limits(a: float, b: float) -> list:
    return [lambda z: -b, lambda z: z, lambda z: b]


def _pair(a: float, b: float) -> list[float]:
    return [-b, b]


NODES, VALUES = np.array([-1.0, -0.4, 0.0, 0.5, 1.0]), np.array([-1.2, -0.3, 0.0, 0.7, 0.9])


def _table(z, a, b):
    return jnp.interp(z, a + b * jnp.asarray(NODES), jnp.asarray(VALUES))


def _lines(a: float, b: float) -> list:
    x = a + b * NODES
    inner = [
        lambda z, i=i: VALUES[i] + (VALUES[i + 1] - VALUES[i]) * (z - x[i]) / (x[i + 1] - x[i])
        for i in range(len(x) - 1)
    ]
    return [lambda z: VALUES[0], *inner, lambda z: VALUES[-1]]


SPRINGS = 12


def _row_of_springs(z, a, b):
    def add(i, force):
        return force + jnp.maximum(z - a - 0.3 * b * i, 0.0)

    return jax.lax.fori_loop(0, SPRINGS, add, jnp.zeros(()))


def _springs(a: float, b: float) -> list[float]:
    return [a + 0.3 * b * i for i in range(SPRINGS)]


def _pressed(a: float, b: float) -> list:
    at = _springs(a, b)
    return [lambda z, n=n: n * z - sum(at[:n]) for n in range(SPRINGS + 1)]


def _regimes(z, a, b):
    return jnp.select([z < -b, z < b], [-1.0 - z, z * z - 1.0], b * b - 1.0 - jnp.sin(z - b))


def _of_regimes(a: float, b: float) -> list:
    return [lambda z: -1.0 - z, lambda z: z * z - 1.0, lambda z: b * b - 1.0 - np.sin(z - b)]


def _branch(z, a, b):
    return jax.lax.cond(z > a, lambda z: b * (z - a), lambda z: -jnp.tanh(z - a), z)


def _closed(z, a, b):
    return jnp.where(z > a, b * (z - a) ** 2, 0.0)


def _zero(z: float, b: float) -> float:
    return 0.0


def _down(z: float, b: float) -> float:
    return -z


def _up(z: float, b: float) -> float:
    return z


def _first(z: float, b: float) -> float:
    return b * z


def _declared(force: Callable, borders: Callable, parts: Callable) -> Shape:
    return Shape(True, False, force, borders, parts)


def _written(force: Callable, borders: Callable, parts: Callable) -> Shape:
    return Shape(False, False, force, borders, parts)


def _leaping(force: Callable, borders: Callable, parts: Callable) -> Shape:
    return Shape(False, True, force, borders, parts)


SHAPES = {
    "positive part": _declared(lambda z, a, b: ss.positive_part(z - a), *_one(_zero, _up)),
    "absolute": _declared(lambda z, a, b: ss.absolute(z - a), *_one(_down, _up)),
    "quadratic drag": _declared(
        lambda z, a, b: ss.absolute(z - a) * (z - a), *_one(lambda z, b: -z * z, lambda z, b: z * z)
    ),
    "saturate": _declared(lambda z, a, b: ss.saturate(z, -b, b), _pair, _limits),
    "backlash": _declared(lambda z, a, b: ss.backlash(z, 2.0 * b), _pair, _flanks),
    "dead band": _declared(lambda z, a, b: ss.dead_band(z, 2.0 * b), _pair, _flanks),
    "row, declared": _declared(_row_of_springs, _springs, _pressed),
    "maximum": _written(lambda z, a, b: jnp.maximum(z, a) - a, *_one(_zero, _up)),
    "minimum": _written(lambda z, a, b: jnp.minimum(z - a, 0.0), *_one(_up, _zero)),
    "relu": _written(lambda z, a, b: jax.nn.relu(z - a), *_one(_zero, _up)),
    "abs": _written(lambda z, a, b: jnp.abs(z - a), *_one(_down, _up)),
    "clip": _written(lambda z, a, b: jnp.clip(z, -b, b), _pair, _limits),
    "where": _written(lambda z, a, b: jnp.where(z > a, b * (z - a), 0.0), *_one(_zero, _first)),
    "square": _written(_closed, *_one(_zero, lambda z, b: b * z * z)),
    "power": _written(
        lambda z, a, b: jnp.maximum(z - a, 0.0) ** 1.5, *_one(_zero, lambda z, b: max(z, 0.0) ** 1.5)
    ),
    "cond": _written(_branch, *_one(lambda z, b: -np.tanh(z), _first)),
    "interp": _written(_table, lambda a, b: list(a + b * NODES), _lines),
    "row": _written(_row_of_springs, _springs, _pressed),
    "select": _leaping(_regimes, _pair, _of_regimes),
    "sign": _leaping(lambda z, a, b: b * jnp.sign(z - a), *_one(lambda z, b: -b, lambda z, b: b)),
    "step": _leaping(
        lambda z, a, b: jnp.where(z >= a, b, -0.5), *_one(lambda z, b: -0.5, lambda z, b: b)
    ),
}

ARGUMENTS = {
    "x": lambda t, x, y, v, w: x,
    "y": lambda t, x, y, v, w: y,
    "stretch": lambda t, x, y, v, w: x - y,
    "v": lambda t, x, y, v, w: v,
    "w": lambda t, x, y, v, w: w,
    "slip": lambda t, x, y, v, w: v - w,
    "mixed": lambda t, x, y, v, w: x + 0.4 * v,
    "ratio": lambda t, x, y, v, w: x / (1.0 + y * y),
    "moved": lambda t, x, y, v, w: x - 0.3 * (1.0 - 0.5 * t) * t,
}
SPEEDS = ("v", "w", "slip", "mixed")
ON = {"x": (1.0, 0.0), "y": (0.0, 1.0), "both": (1.0, -1.0)}


class Piece(NamedTuple):
    """Names of a shape, its argument and the masses that it acts on."""

    shape: str
    argument: str
    on: str


class Data(NamedTuple):
    """Numbers of a draw: `spring, damping, coupling, load, rate`; `gain, a, b` by piece; a start."""

    chain: Any
    pieces: Any
    start: Any


class Force:
    """The pieces of a structure."""

    def __init__(self, pieces: tuple[Piece, ...]):
        self.pieces = pieces

    def of(self, data: Data, t: Any, x: Any, y: Any, v: Any, w: Any) -> tuple[Any, Any]:
        """Forces on both masses in JAX."""
        k, c, coupling, load, rate = (data.chain[i] for i in range(5))
        middle = coupling * (x - y)
        on_x, on_y = load * jnp.cos(rate * t) - k * x - c * v - middle, middle - k * y - c * w
        for i, piece in enumerate(self.pieces):
            gain, a, b = (data.pieces[i, j] for j in range(3))
            z = ARGUMENTS[piece.argument](t, x, y, v, w)
            force = gain * SHAPES[piece.shape].force(z, a, b)
            on_x, on_y = on_x + ON[piece.on][0] * force, on_y + ON[piece.on][1] * force
        return on_x, on_y

    def switches(self, data: Data, t: Any, x: Any, y: Any, v: Any, w: Any) -> tuple:
        """What only a declaration shows."""
        found = []
        for i, piece in enumerate(self.pieces):
            if piece.shape == "row, declared":
                z = ARGUMENTS[piece.argument](t, x, y, v, w)
                found += [z - c for c in _springs(data.pieces[i, 1], data.pieces[i, 2])]
        return tuple(found)


class Chain(AbstractMechanism):
    """Two masses of 1 kg under such a force."""

    data: Any
    force: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        on_x, on_y = self.force.of(self.data, t, q.x, q.y, v.x, v.y)
        return {"x": on_x, "y": on_y}

    def switches(self, t, q, v, args):
        return self.force.switches(self.data, t, q.x, q.y, v.x, v.y)


class NoMotion(Exception):
    """A jump of the force attracts from both sides, or the motion is infinite before the end."""


class _March:
    """The motion by SciPy, from border to border."""

    def __init__(self, force: Force, data: Data):
        self.chain = [float(a) for a in data.chain]
        self.pieces = []
        for piece, (gain, a, b) in zip(force.pieces, np.asarray(data.pieces).tolist(), strict=True):
            shape = SHAPES[piece.shape]
            self.pieces.append(
                (ARGUMENTS[piece.argument], shape.borders(a, b), shape.parts(a, b), gain, *ON[piece.on])
            )
        self.jumps = [SHAPES[p.shape].jumps for p in force.pieces]
        self.start = np.asarray(data.start, float)

    def values(self, t: float, y: Any) -> list[float]:
        """Arguments of all pieces."""
        return [argument(t, *y) for argument, *_ in self.pieces]

    def field(self, t: float, state: Any, sides: list[int]) -> np.ndarray:
        k, c, coupling, load, rate = self.chain
        x, y, v, w = state.tolist()
        middle = coupling * (x - y)
        on_x, on_y = load * np.cos(rate * t) - k * x - c * v - middle, middle - k * y - c * w
        for (argument, _, parts, gain, p, q), side in zip(self.pieces, sides, strict=True):
            force = gain * parts[side](argument(t, x, y, v, w))
            on_x, on_y = on_x + p * force, on_y + q * force
        return np.array([v, w, on_x, on_y])

    def rate(self, i: int, t: float, y: np.ndarray, sides: list[int]) -> float:
        """Of the argument of a piece along the motion on these sides; arguments are smooth."""
        h, dy = 1e-5, self.field(t, y, sides)
        argument = self.pieces[i][0]
        return (argument(t + h, *(y + h * dy)) - argument(t - h, *(y - h * dy))) / (2 * h)

    def first_sides(self) -> list[int]:
        """By the arguments; on a border by where they go."""
        y, sides = self.start, []
        for z, (_, borders, *_) in zip(self.values(0.0, y), self.pieces, strict=True):
            sides.append(int(np.searchsorted(borders, z, side="right")))
        for i, (z, (_, borders, *_)) in enumerate(zip(self.values(0.0, y), self.pieces, strict=True)):
            if z in borders and self.rate(i, 0.0, y, sides) < 0.0:
                sides[i] -= 1
        return sides

    def beyond(self, values: list[float], sides: list[int]) -> Any:
        """The first piece that is not on its side, and its border."""
        for i, (z, side) in enumerate(zip(values, sides, strict=True)):
            borders = self.pieces[i][1]
            if side > 0 and z < borders[side - 1]:
                return i, borders[side - 1], -1
            if side < len(borders) and z > borders[side]:
                return i, borders[side], 1
        return None

    def end(self) -> np.ndarray:
        t, y, sides = 0.0, self.start, self.first_sides()
        for _ in range(2000):
            t, y, crossed = self._to_border(t, y, sides)
            if crossed is None:
                return y
            i, way = crossed
            sides = [s + way if k == i else s for k, s in enumerate(sides)]
            if self.jumps[i] and way * self.rate(i, t, y, sides) < 0.0:
                raise NoMotion
        raise RuntimeError("the motion crosses too many borders")

    def _steps(self, t: float, y: np.ndarray, until: float, sides: list[int]) -> Any:
        solver = DOP853(
            lambda t, y: self.field(t, y, sides), t, y, until, rtol=1e-12, atol=1e-13, max_step=0.1
        )
        while solver.status == "running":
            solver.step()
            if solver.status == "failed":  # its steps become shorter than the time can tell
                raise NoMotion
            yield solver

    def _to_border(self, t: float, y: np.ndarray, sides: list[int]) -> Any:
        before = y
        for solver in self._steps(t, y, LENGTH, sides):
            course = None
            for part in (0.2, 0.4, 0.6, 0.8, 1.0):
                at = solver.t_old + part * (solver.t - solver.t_old)
                course = course or solver.dense_output()
                found = self.beyond(self.values(at, course(at)), sides)
                if found is not None:
                    return self._landed(solver.t_old, before, at, course, sides)
            before = solver.y
        return LENGTH, before, None

    def _landed(self, t: float, y: np.ndarray, late: float, course: Any, sides: list[int]) -> Any:
        """On the first border, by the root of the course, then by Newton's steps along the motion."""
        roots = []
        for i, (z, side) in enumerate(zip(self.values(late, course(late)), sides, strict=True)):
            argument, borders = self.pieces[i][:2]
            for way, k in ((-1, side - 1), (1, side)):
                if 0 <= k < len(borders) and way * (z - borders[k]) > 0.0:

                    def off(at, argument=argument, border=borders[k], way=way):
                        return way * (argument(at, *course(at)) - border)

                    # A border that was just left is met again later, or not at all.
                    early = next((a for a in np.linspace(t, late, 9)[:-1] if off(a) < 0.0), None)
                    if early is None:
                        roots.append((t, i, way, borders[k]))
                    else:
                        roots.append((brentq(off, early, late, xtol=1e-15), i, way, borders[k]))
        at, i, way, border = min(roots)
        if at > t:
            for solver in self._steps(t, y, at, sides):
                y = solver.y
        for _ in range(2):
            dt = (border - self.values(at, y)[i]) / self.rate(i, at, y, sides)
            at, y = at + dt, y + dt * self.field(at, y, sides)
        return at, y, (i, way)


def end_of(force: Force, data: Data) -> np.ndarray:
    """State `x, y, v, w` at the end; `NoMotion` where there is none."""
    return _March(force, data).end()


def force_of(rng: np.random.Generator, declared: bool) -> Force:
    """Random pieces, all declared or none."""
    names = [name for name, shape in SHAPES.items() if shape.declared is declared]
    return Force(
        tuple(
            Piece(str(rng.choice(names)), str(rng.choice(list(ARGUMENTS))), str(rng.choice(list(ON))))
            for _ in range(rng.integers(1, 4))
        )
    )


def data_of(force: Force, rng: np.random.Generator) -> Data:
    """Random numbers for a force: soft and stiff pieces, borders at zero too, starts from rest too."""
    chain = rng.uniform([0.5, 0.0, 0.0, 0.5, 0.5], [6.0, 0.4, 5.0, 3.0, 4.0])
    rows = []
    for piece in force.pieces:
        speed, shape = piece.argument in SPEEDS, SHAPES[piece.shape]
        gain = float(np.exp(rng.uniform(np.log(0.3), np.log(8.0 if speed else 200.0))))
        if speed or shape.jumps or "drag" in piece.shape:
            gain = min(gain, 3.0)
        if piece.on == "y" and piece.argument in ("stretch", "slip"):
            gain = -gain
        if rng.random() < 0.85:
            gain = -gain  # most pull back
        a = 0.0 if rng.random() < 0.2 else rng.uniform(-0.4, 0.4)
        rows.append([gain, a, rng.uniform(0.1, 0.6)])
    start = rng.uniform(-0.6, 0.6, 4) * np.array([1.0, 1.0, 2.0, 2.0])
    if rng.random() < 0.2:
        start[2:] = 0.0
    return Data(chain, np.array(rows), start)
