r"""The fastest motion along a curve with both motors rolling, as a sequence of linear programs.

With $x = \dot s^2$ and $u = \ddot s$ the collar has the acceleration $a = r'u + r''x$. While both
motors roll, the forces in the belts are linear in $u$, $x$ and the static friction of a line that
stands still, and so are the voltages, but for what the motors induce, $\propto\sqrt x$. With $u$
constant in each piece, $2\,\Delta s\,u$ is the difference of $x$ at its ends: limits are rows in the
values of $x$ at the nodes. The time is least where $x$ is greatest; $\sqrt x$ and the time are made
linear about the last solution until it stays.
"""

from typing import Any, NamedTuple

import numpy as np

from ._contacts import static_limits
from ._curve_grid import Grid
from ._leg import CARRIES, LINES, Plain, acceleration_change
from ._parameters import CoreXYParameters

ROUNDS = 60
GENTLER = 0.9  # least part of the acceleration of the start: curvature and speed leave a little less
SETTLED = 1e-10  # relative change of x after which it is taken as settled


class Limits(NamedTuple):
    """Margins of the machines, the nominal one first, and the voltage [V]."""

    margins: list[float]
    volts: float


class Motion(NamedTuple):
    """Squares of ds/dt at the nodes, and the hold [N] in each piece."""

    x: np.ndarray
    holds: np.ndarray


class Forces(NamedTuple):
    """What a piece needs at one of its ends, rows by (u, x, hold, 1), and volts by ds/dt."""

    belts: np.ndarray
    volts: np.ndarray
    emf: np.ndarray


def motor_volts(p: CoreXYParameters) -> tuple[float, float]:
    """Volts [V] by the pull of a motor [N], and by its line speed [m/s]."""
    r, R, K_t, K_e = (float(a) for a in (p.r, p.R, p.K_t, p.K_e))
    return R * r / K_t, K_e / r


def tied_line(senses: np.ndarray) -> np.ndarray | None:
    """The line that stands still, or `None`."""
    still = np.flatnonzero(senses == 0.0)
    return LINES[int(still[0])] if still.size else None


def forces(p: CoreXYParameters, here: Plain, senses: Any, first: Any, second: Any) -> Forces:
    """At a place with these derivatives of the curve."""
    line = tied_line(senses)
    normal = np.zeros(2) if line is None else line
    friction = LINES.T @ (here.kinetic * senses)
    load = np.stack([here.carriage * first, here.carriage * second, normal, friction], axis=1)
    belts = CARRIES @ load
    none = np.zeros(2)
    turns = LINES[2:]
    pull = belts + np.stack(
        [here.motors * (turns @ first), here.motors * (turns @ second), none,
         here.kinetic_motors * senses[2:]], axis=1,
    )  # fmt: skip
    by_pull, by_speed = motor_volts(p)
    return Forces(belts, by_pull * pull, by_speed * (turns @ first))


def fastest(
    p: CoreXYParameters, machines: list[Plain], grid: Grid, limits: Limits, start: tuple[float, float]
) -> Motion | str:
    """The greatest x at every node; or what is in the way. `start`: acceleration [m/s²] and hold [N]
    of the first piece."""
    import scipy.optimize

    count = grid.lengths.size
    rows, low, high = _Rows(count), np.zeros(count + 1), np.full(count + 1, np.inf)
    holds = np.zeros((count, 2))
    low[0] = high[0] = high[-1] = 0.0
    lengths = grid.lengths
    for node in map(int, grid.parts[1:-1]):
        need = _least(p, machines[0], grid, node, limits.margins[0])
        if isinstance(need, str):
            return need
        low[node] = need
    size = float(np.linalg.norm(grid.first[0, 0]))
    high[1] = 2.0 * lengths[0] * start[0] / size
    low[1] = GENTLER * high[1]
    for i in range(count):
        line = tied_line(grid.senses[i])
        if line is not None:
            holds[i] = _hold(machines[0], grid, i, limits.margins[0])
        for end in (0, 1):
            senses, first, second = grid.senses[i], grid.first[i, end], grid.second[i, end]
            own = forces(p, machines[0], senses, first, second)
            bounds = _belt_bounds(machines, limits.margins, own.belts, senses, first, line)
            for row, (least, most) in zip(own.belts, bounds, strict=True):
                rows.add(i, end, lengths[i], row, 0.0, least, most)
            for row, emf in zip(own.volts, own.emf, strict=True):
                rows.add(i, end, lengths[i], row, emf, -limits.volts, limits.volts)
    holds[0] = start[1]
    between = np.concatenate([np.stack([low, high], axis=1), holds])
    weights, last = np.ones(count + 1), None
    for _ in range(ROUNDS):
        matrix, bound = rows.linear(last)
        found = scipy.optimize.linprog(
            -np.append(weights / weights.max(), np.zeros(count)), A_ub=matrix, b_ub=bound,
            bounds=between, method="highs",
        )  # fmt: skip
        if found.x is None or not found.success:
            return "no motion is within all limits"
        x, hold = found.x[: count + 1], found.x[count + 1 :]
        if np.any(x[1:-1] <= 0.0):
            at = float(grid.s[1 + int(np.argmin(x[1:-1]))])
            return f"the collar would come to rest at s = {at:g}"
        settled = last is not None and np.max(np.abs(x - last)) < SETTLED * np.max(x)
        last = x
        if settled:
            break
        roots = np.sqrt(x)
        pace = lengths / (roots[:-1] + roots[1:]) ** 2
        weights = np.zeros(count + 1)
        weights[:-1] += pace
        weights[1:] += pace
        weights[1:-1] /= roots[1:-1]
        weights[[0, -1]] = 0.0
    assert last is not None
    return Motion(last, hold)


class _Rows:
    """Rows `(u, x, hold, 1)` of pieces with bounds, as a sparse matrix over x and holds."""

    def __init__(self, count: int):
        self.count = count
        self.rows: list[tuple[int, int, float, Any, float, float, float]] = []

    def add(self, piece, end, length, row, emf, least, most) -> None:
        self.rows.append((piece, end, length, row, emf, least, most))

    def linear(self, x: np.ndarray | None) -> tuple[Any, np.ndarray]:
        """The matrix and the upper bounds, with the square root made linear about `x`."""
        import scipy.sparse

        piece, end, length = (np.array([r[k] for r in self.rows]) for k in range(3))
        by = np.array([r[3] for r in self.rows])
        emf, least, most = (np.array([r[k] for r in self.rows]) for k in (4, 5, 6))
        near = np.zeros(piece.size) if x is None else np.sqrt(x[piece + end])
        known = near > 0.0
        slope = np.where(known, 0.5 * emf / np.where(known, near, 1.0), 0.0)
        constant = by[:, 3] + 0.5 * emf * near
        here = by[:, 1] + slope
        first = -by[:, 0] / (2.0 * length) + np.where(end == 0, here, 0.0)
        second = by[:, 0] / (2.0 * length) + np.where(end == 1, here, 0.0)
        number = np.arange(piece.size)
        columns = np.concatenate([piece, piece + 1, self.count + 1 + piece])
        values = np.concatenate([first, second, by[:, 2]])
        matrix = scipy.sparse.csr_matrix(
            (values, (np.tile(number, 3), columns)), (piece.size, 2 * self.count + 1)
        )
        return (
            scipy.sparse.vstack([matrix, -matrix]),
            np.concatenate([most - constant, constant - least]),
        )


def _belt_bounds(machines, margins, belts, senses, first, line) -> list[tuple[float, float]]:
    """Of what the nominal machine's belts carry apart from the constant, so that all machines hold."""
    here, unit = machines[0], first / np.linalg.norm(first)
    bounds = []
    for other, margin in zip(machines, margins, strict=True):
        change = acceleration_change(here, other, senses, unit, line)
        more = (here.kinetic_motors - other.kinetic_motors) * senses[2:]
        more = more - other.motors * (LINES[2:] @ change)
        bounds.append((-margin * other.belts - more, margin * other.belts - more))
    least = np.max([b[0] for b in bounds], axis=0)
    most = np.min([b[1] for b in bounds], axis=0)
    return list(zip(least, most, strict=True))


def _hold(here: Plain, grid: Grid, piece: int, margin: float) -> tuple[float, float]:
    """Bounds of the friction of a line that stands still [N]. Where the line came in moving it is kept
    below what the sliding line would have, so that a little speed that is left dies out."""
    j = int(np.flatnonzero(grid.senses[piece] == 0.0)[0])
    moved = np.any(grid.senses[:piece, j] != 0.0)
    most = margin * (here.kinetic[j] if moved else here.static[j])
    return -most, most


def _least(p: CoreXYParameters, here: Plain, grid: Grid, node: int, margin: float) -> float | str:
    """The least x at a node at which a line passes through rest, or leaves it, without being held."""
    before, after = grid.senses[node - 1], grid.senses[node]
    static = np.array([float(a) for a in static_limits(p)])
    mass = np.diag(here.carriage) + LINES[2:].T @ (here.motors[:, None] * LINES[2:])
    need = 0.0
    for j in np.flatnonzero((before != after) & (after != 0.0)):
        kinetic, most = here.kinetic[j], static[j]
        if j >= 2:
            kinetic, most = kinetic + here.kinetic_motors[j - 2], most + static[2 + j]
        # What would have to hold the line is its friction in motion and what accelerates it.
        weight = 1.0 / float(LINES[j] @ np.linalg.solve(mass, LINES[j]))
        pull = weight * float(LINES[j] @ grid.second[node, 0]) * after[j]
        missing = most / margin - kinetic
        if missing > 0.0:
            if pull <= 1e-9 * weight * float(np.linalg.norm(grid.first[node, 0])) ** 2:
                return (
                    f"at s = {float(grid.s[node]):g} the curve is too straight for friction at rest "
                    "to break where x, y or one of the belts' directions begins to move"
                )
            need = max(need, missing / pull)
    return need
