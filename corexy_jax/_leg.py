r"""One straight leg, rest to rest, in the shortest time with both motors rolling.

While the motors roll, path and speed determine the forces: along a unit vector $d$ with the
acceleration $a$, and with the static friction $\lambda$ of the one line ($x$, $y$, $x+y$ or $x-y$)
that may stand still along $d$, the belts carry forces and the motors need voltages that are linear
in $a$, $\lambda$ and the speed. So the most that the limits leave for $a$ is a linear program of
two unknowns, and the shortest time is that of the greatest acceleration followed by the greatest
braking.
"""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ._contacts import BELT_1, kinetic_limits, line_masses, static_limits
from ._parameters import CoreXYParameters

LINES = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])  # x, y, x + y, x - y
STILL = 1e-9  # of a unit vector: a line that stands still
CARRIES = 0.5 * np.array([[1.0, 1.0], [1.0, -1.0]])  # belt forces by the force on the carriage
LEAST_GAIN = 1e-6  # part of the acceleration from rest below which the speed is the last


class Plain(NamedTuple):
    """A machine in numbers: masses, friction of the four lines with what the motors add, of the motor
    pulleys alone, limits of the belts."""

    carriage: np.ndarray
    motors: np.ndarray
    kinetic: np.ndarray
    kinetic_motors: np.ndarray
    static: np.ndarray
    belts: np.ndarray


def plain(p: CoreXYParameters) -> Plain:
    masses, kinetic, static = (
        np.array([float(a) for a in row])
        for row in (line_masses(p), kinetic_limits(p), static_limits(p))
    )
    return Plain(masses[:2], masses[2:], kinetic[:4], kinetic[4:6], static[:4], static[BELT_1:])


class Piece(NamedTuple):
    """`duration` [s] of one acceleration `a` [m/s²] from the speed `speed` [m/s], and the friction
    `hold` [N] of the line that stands still."""

    duration: float
    a: float
    speed: float
    hold: float


BreakAway = Callable[[float, float], tuple[float, float]]


class Leg:
    """Along `direction`, a unit vector; `machines`: the nominal one, then those on which the
    belts must also hold."""

    def __init__(
        self, p: CoreXYParameters, machines: list[Plain], direction: Any, margins: list[float],
        volts: float,
    ):  # fmt: skip
        turns = LINES @ direction
        turns[np.abs(turns) < STILL] = 0.0
        senses = np.sign(turns)
        still = np.flatnonzero(senses == 0.0)
        self.direction, self.senses, self.volts_limit = direction, senses, volts
        self.tied = int(still[0]) if still.size else None
        normal = np.zeros(2) if self.tied is None else LINES[self.tied]
        here = machines[0]
        # Every quantity is a row (by a, by hold, constant).
        friction = LINES.T @ (here.kinetic * senses)
        load = np.stack([here.carriage * direction, normal, friction], axis=1)
        belts = CARRIES @ load
        pull = belts + np.stack(
            [here.motors * turns[2:], np.zeros(2), here.kinetic_motors * senses[2:]], axis=1
        )
        r, R, K_t, K_e = (float(a) for a in (p.r, p.R, p.K_t, p.K_e))
        self.belts, self.volts = belts, R * r / K_t * pull
        self.emf = K_e / r * turns[2:]
        rows: list[Any] = []
        for other, margin in zip(machines, margins, strict=True):
            tied = None if self.tied is None else normal
            change = acceleration_change(here, other, senses, direction, tied)
            # The motors pull as before; what they do not need themselves the belts carry.
            carried = belts.copy()
            carried[:, 2] += (here.kinetic_motors - other.kinetic_motors) * senses[2:]
            carried[:, 2] -= other.motors * (LINES[2:] @ change)
            rows += [(row, margin * limit) for row, limit in zip(carried, other.belts, strict=True)]
        if self.tied is not None:
            rows.append((np.array([0.0, 1.0, 0.0]), margins[0] * here.static[self.tied]))
        self.limits = rows

    def most(self, sign: float, speed: float, step: float) -> tuple[float, float] | None:
        """Greatest `sign * a` with its hold, during `step` [s] that begins (sign +) or ends (sign -)
        with `speed`; `None` if the limits leave none."""
        rows = list(self.limits)
        for row, emf in zip(self.volts, self.emf, strict=True):
            for later in (0.0, sign * step):
                # A step that ends with `speed` began `-a * step` above it.
                whole = row + np.array([emf * later, 0.0, emf * speed])
                rows.append((whole, self.volts_limit))
        bound = [(s * row[:2], limit - s * row[2]) for row, limit in rows for s in (1.0, -1.0)]
        found = _greatest(
            np.array([b[0] for b in bound]), np.array([b[1] for b in bound]), sign, self.tied is None
        )
        return None if found is None or sign * found[0] <= 0.0 else found

    def pieces(self, length: float, steps: int, break_away: BreakAway) -> list[Piece] | None:
        """Pieces that cover `length` [m] from rest to rest; `None` if the limits leave no motion.

        `break_away`: the acceleration and hold of the first piece, from the greatest.
        """
        first, last = self.most(1.0, 0.0, 0.0), self.most(-1.0, 0.0, 0.0)
        if first is None or last is None:
            return None
        up, down = first[0], -last[0]
        free = np.sqrt(2.0 * length * (1.0 / up + 1.0 / down))  # time if the speed cost nothing
        step = free / steps
        first = self.most(1.0, 0.0, step)
        if first is None:
            return None
        gentle = break_away(*first)
        forward = [Piece(0.0, 0.0, 0.0, 0.0)]
        backward = [Piece(0.0, 0.0, 0.0, 0.0)]
        way = 0.0
        while True:
            last = forward[-1]
            speed = last.speed + last.a * last.duration
            left = length - way
            found = self.most(1.0, speed, step) if speed else gentle
            if found is None or found[0] < LEAST_GAIN * up:
                # All of the voltage goes against the speed that there is.
                backward = self._down_to(speed, step, backward)
                if backward is None:
                    return None
                cruise = Piece((left - _stop(backward, speed)) / speed, 0.0, speed, last.hold)
                return _merged([*forward[1:], cruise, *_braking(backward, speed)])
            piece = Piece(step, found[0], speed, found[1])
            backward = self._down_to(speed + piece.a * step, step, backward)
            if backward is None:
                return None
            if _covered(piece, step) + _stop(backward, speed + piece.a * step) < left:
                forward.append(piece)
                way += _covered(piece, step)
                continue
            # The place to turn: the rest of the way is what braking from there takes.
            low, high = 0.0, step
            for _ in range(200):
                middle = 0.5 * (low + high)
                far = _covered(piece, middle) + _stop(backward, speed + piece.a * middle)
                low, high = (middle, high) if far < left else (low, middle)
            forward.append(piece._replace(duration=low))
            return _merged(forward[1:] + _braking(backward, speed + piece.a * low))

    def _down_to(self, speed: float, step: float, pieces: list[Piece]) -> list[Piece] | None:
        """Braking pieces, the last first, that begin at least with `speed`."""
        pieces = list(pieces)
        while pieces[-1].speed < speed:
            end = pieces[-1].speed
            found = self.most(-1.0, end, step)
            if found is None:
                return None
            pieces.append(Piece(step, found[0], end - found[0] * step, found[1]))
        return pieces

    def voltage(self, a: float, hold: float, speed: float) -> np.ndarray:
        """Voltages [V] of both motors."""
        return self.volts @ np.array([a, hold, 1.0]) + self.emf * speed

    def belt_forces(self, a: float, hold: float) -> np.ndarray:
        """What the belts carry [N]."""
        return self.belts @ np.array([a, hold, 1.0])


def acceleration_change(
    here: Plain, other: Plain, senses: np.ndarray, direction: np.ndarray, line: np.ndarray | None
) -> np.ndarray:
    """Change of the acceleration [m/s²] of another machine under the same pull of its motors, along the
    unit vector `direction` where a `line` stands still."""
    less = np.zeros(2)
    for one, sign in ((here, 1.0), (other, -1.0)):
        whole = one.kinetic.copy()
        whole[2:] += one.kinetic_motors
        less += sign * (LINES.T @ (whole * senses))
    mass = np.diag(other.carriage) + LINES[2:].T @ (other.motors[:, None] * LINES[2:])
    if line is None:
        return np.linalg.solve(mass, less)
    faster, _ = np.linalg.solve(np.stack([mass @ direction, line], axis=1), less)
    return faster * direction


def _greatest(matrix: Any, bounds: Any, sign: float, one: bool) -> tuple[float, float] | None:
    """`x` with the greatest `sign * x[0]` among `matrix @ x <= bounds`: the best of the corners."""
    scale = 1e-9 * (1.0 + np.abs(bounds))
    if one:
        by = matrix[:, 0]
        if np.any((by == 0.0) & (bounds < 0.0)):
            return None
        low = np.max(bounds[by < 0.0] / by[by < 0.0])
        high = np.min(bounds[by > 0.0] / by[by > 0.0])
        return None if low > high else (float(high if sign > 0.0 else low), 0.0)
    best = None
    pairs = np.array(list(itertools.combinations(range(len(bounds)), 2)))
    square, right = matrix[pairs], bounds[pairs]
    regular = np.abs(np.linalg.det(square)) > 1e-12
    corners = np.linalg.solve(square[regular], right[regular][..., None])[..., 0]
    for a, hold in corners[np.all(corners @ matrix.T <= bounds + scale, axis=1)]:
        key = (sign * a, -abs(hold))
        if best is None or key > best[0]:
            best = key, (float(a), float(hold))
    return None if best is None else best[1]


def _covered(piece: Piece, duration: float) -> float:
    return piece.speed * duration + 0.5 * piece.a * duration**2


def _stop(braking: list[Piece], speed: float) -> float:
    """Way [m] that braking from `speed` takes."""
    return sum(_covered(p, p.duration) for p in _braking(braking, speed))


def _braking(braking: list[Piece], speed: float) -> list[Piece]:
    """The part of the braking pieces, in order, that begins with `speed`."""
    found: list[Piece] = []
    for end, piece in itertools.pairwise(braking):
        if piece.speed <= speed:
            found.append(piece)
        elif end.speed < speed:
            found.append(piece._replace(speed=speed, duration=(end.speed - speed) / piece.a))
    return found[::-1]


def _merged(pieces: list[Piece]) -> list[Piece]:
    """Pieces with one acceleration and hold after each other as one; those of no length left out."""
    found: list[Piece] = []
    for piece in pieces:
        if piece.duration <= 0.0:
            continue
        same = found and np.allclose(
            (piece.a, piece.hold), (found[-1].a, found[-1].hold), rtol=1e-12, atol=1e-12
        )
        if same:
            found[-1] = found[-1]._replace(duration=found[-1].duration + piece.duration)
        else:
            found.append(piece)
    return found
