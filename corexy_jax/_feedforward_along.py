"""Voltages that move the collar along a curve in the shortest time with both motors rolling."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from stickslip.checks import (
    Given,
    Numeric,
    check_type,
    refusal,
)

from ._along import Limits, Motion, fastest, forces, motor_volts, tied_line
from ._arguments import the_machine
from ._curve_grid import Grid, cut
from ._feedforward import SHARES, break_away, known_machine, machines_within, plan_limits
from ._leg import LINES, Leg, plain
from ._parameters import CoreXYParameters
from ._path import Path
from ._plan import CUT, PAUSE, ROWS, Feedforward
from ._rolling_check import RollingCheck, check_rolling
from ._voltage import Ramps

FOLLOWS = 1e-6  # part of the size of a path within which the collar must stay of the plan
TRIES = 8  # of limits that are drawn in by what pieces of constant acceleration need more


def feedforward_along(
    parameters: CoreXYParameters,
    path: Given[Path],
    *,
    volts: Numeric,
    margin: Numeric = 0.9,
    tension_error: Numeric = 0.0,
    steps: int = 200,
) -> Feedforward:
    r"""Voltages under which the collar follows a curve, from rest to rest, in the shortest time without
    a belt that slips.

    Along a curve $r(s)$ the acceleration is $r'\ddot s + r''\dot s^2$, and while both motors roll it
    determines the forces. The limits are those of `feedforward`; within them $\dot s^2$ is made as
    great as possible at every node of the curve, by linear programs. Where one of $x$, $y$, $x + y$,
    $x - y$ turns back, friction jumps and so do the voltages. There the collar must be fast enough that
    friction at rest, greater by $1/c$, does not hold the line; and the same where such a line leaves
    rest, as where an arc follows a line along $x$. Between nodes the acceleration is constant in
    either half, so that voltages are linear, every node lies on the curve and is passed along it, and
    the motion is followed exactly. The plan is at last simulated with all its events.

    **Arguments**

    - `parameters`, `volts` [V], `margin` $c$, `tension_error` as for `feedforward`.
    - `path`: a `Path`. It must begin in a direction in which all four of these move, or along one of
      them on a straight line, since friction at rest breaks at no other start.
    - `steps`: pieces of the curve. Between nodes the collar is off it by a distance that falls with the
      third power of their length.

    **Returns** a `Feedforward`, whose `points` are the places at which the plan begins, changes and
    ends. **Raises** `TypeError`, `ValueError` for an argument of another kind, and for a curve that
    cannot be followed like this.

    Source: as `feedforward`; D. Verscheure et al., Time-optimal path tracking for robots: a convex
    optimization approach, IEEE Transactions on Automatic Control 54 (2009),
    doi:10.1109/TAC.2009.2028959.
    """
    known_machine(the_machine(parameters, "parameters"))
    check_type("path", path, Path, "a Path")
    limit, margin, error = plan_limits(volts, margin, tension_error, steps)
    machines = machines_within(parameters, error)
    grid = cut(path, steps)
    why = ""
    for share in SHARES if error else (1.0,):
        plan = _plan(machines, path, grid, limit, margin, share * margin)
        found = check_rolling(plan)
        why = _trouble(found, grid)
        # What other machines do off the path is not of first order: see whether their belts hold.
        if not why and all(jnp.all(check_rolling(plan, p).rolls) for p in machines[1:]):
            return plan
    if why:
        raise _unfollowed(path, why)
    raise refusal(
        "tension_error", error, "so small that a voltage can be found with which the belts hold"
    )


def _plan(
    machines: list[CoreXYParameters], path: Path, grid: Grid, volts: float, margin: float, other: float
) -> Feedforward:
    """For the first of the machines, with the margin `other` for the belts of the others."""
    numbers = [plain(p) for p in machines]
    here, belts, limit = machines[0], 1.0, volts
    start = _start(machines, path, grid, volts, margin, other)
    plan = None
    for _ in range(TRIES):
        margins = [belts * margin] + [belts * other] * (len(machines) - 1)
        motion = fastest(here, numbers, grid, Limits(margins, limit), start)
        if isinstance(motion, str):
            raise _unfollowed(path, motion)
        plan, most_volts, most_belts = _assembled(here, grid, motion)
        # Halves of pieces need a little more than their nodes.
        over = most_belts / margin, most_volts / volts
        if max(over) <= 1.0 + 1e-9:
            return plan
        if over[0] > 1.0:
            belts *= (1.0 - 1e-6) / over[0]
        if over[1] > 1.0:
            limit *= (1.0 - 1e-6) / over[1]
    raise _unfollowed(path, "pieces are too long for its curvature: more steps are needed")


def _start(machines, path, grid, volts, margin, other) -> tuple[float, float]:
    """Acceleration [m/s²] and hold [N] of the first piece."""
    first = grid.first[0, 0]
    direction = first / np.linalg.norm(first)
    margins = [margin] + [other] * (len(machines) - 1)
    leg = Leg(machines[0], [plain(p) for p in machines], direction, margins, volts)
    if np.any((leg.senses == 0.0) != (grid.senses[0] == 0.0)):
        raise _unfollowed(path, "it leaves the direction of its begin, in which a line stands still")
    most = leg.most(1.0, 0.0, 0.0)
    if most is None:
        raise _unfollowed(path, "belts and voltage are too weak against the friction")
    start = break_away(machines, leg, *most, margin)
    if isinstance(start, str):
        raise _unfollowed(path, f"these contacts do not start as they must: {start}")
    return start


def _trouble(found: RollingCheck, grid: Grid) -> str:
    """What keeps a plan from being one, empty if nothing does."""
    size = float(np.max(np.ptp(grid.place, axis=0)))
    if not bool(jnp.all(found.rolls)):
        return f"simulated, {found}"
    if not bool(found.at_rest) or float(found.deviation) > FOLLOWS * size:
        return f"simulated, the collar is {float(found.deviation):.3g} m off the plan; {found}"
    return ""


def _unfollowed(path: Path, why: str) -> Exception:
    return refusal("path", path, "a curve that the collar can follow with both motors rolling", but=why)


def _assembled(p: CoreXYParameters, grid: Grid, motion: Motion) -> tuple[Feedforward, float, float]:
    """The plan, its greatest voltage [V], and the greatest part of their friction that belts need."""
    here, roots = plain(p), np.sqrt(motion.x)
    _, by_speed = motor_volts(p)
    table, times, places, velocities, accelerations, carried = [], [0.0], [], [], [], []
    t, greatest, reached = 0.0, 0.0, [0.0]
    for i in range(grid.lengths.size):
        h = 2.0 * grid.lengths[i] / (roots[i] + roots[i + 1])
        senses, hold = grid.senses[i], motion.holds[i]
        begin, end = (_still(grid, i, e, grid.first[i, e] * roots[i + e]) for e in (0, 1))
        way = grid.place[i + 1] - grid.place[i] - h * begin
        # Of two halves, so that place and velocity are met at the end of the piece.
        both, more = 2.0 * (end - begin) / h, 8.0 * way / (h * h)
        one = _flat(senses, 0.5 * (more - both))
        place, velocity = grid.place[i], begin
        for a in (one, _flat(senses, both) - one):
            volts, belts = _needed(p, senses, a, hold)
            slope = by_speed * (LINES[2:] @ a)
            at_once = volts + by_speed * (LINES[2:] @ velocity)
            greatest = max(greatest, *np.abs(at_once), *np.abs(at_once + 0.5 * h * slope))
            table.append((t, *at_once, *slope))
            places.append(place)
            velocities.append(velocity)
            accelerations.append(a)
            carried.append(belts)
            place = place + 0.5 * h * (velocity + 0.25 * h * a)
            velocity = velocity + 0.5 * h * a
            t += 0.5 * h
            times.append(t)
        if i + 1 in grid.parts:
            reached.append(t)
    share = float(np.max(np.abs(np.array(carried)) / here.belts))
    # As at the end of a straight leg: the voltage is off a moment before the stop and after it.
    slow = CUT * np.max(np.linalg.norm(velocities, axis=1)) / np.linalg.norm(accelerations[-1])
    table.append((t - slow, 0.0, 0.0, 0.0, 0.0))
    places.append(grid.place[-1])
    for rows in (velocities, accelerations, carried):
        rows.append(np.zeros(2))
    t *= 1.0 + PAUSE
    times.append(t)
    table += [(t + i, 0.0, 0.0, 0.0, 0.0) for i in range(-len(table) % ROWS)]
    voltage = Ramps(*(jnp.asarray(column) for column in np.array(table).T))
    rows = (times, places, velocities, accelerations, carried, reached)
    points = jnp.asarray(grid.place[grid.parts])
    plan = Feedforward(p, points, voltage, *(jnp.asarray(np.array(a)) for a in rows))
    return plan, float(greatest), share


def _needed(p: CoreXYParameters, senses: Any, a: Any, hold: float) -> tuple[np.ndarray, np.ndarray]:
    """Voltages at rest [V] and forces of the belts [N] under the acceleration `a` [m/s²]."""
    found = forces(p, plain(p), senses, a, np.zeros(2))
    by = np.array([1.0, 0.0, hold, 1.0])
    return found.volts @ by, found.belts @ by


def _flat(senses: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Without what is along a line that stands still."""
    line = tied_line(senses)
    return a if line is None else a - (a @ line) / (line @ line) * line


def _still(grid: Grid, piece: int, end: int, velocity: np.ndarray) -> np.ndarray:
    """The velocity at a node without what is along the lines that stand there."""
    node = piece + end
    for j in range(len(LINES)):
        around = grid.senses[max(node - 1, 0) : node + 1, j]
        if np.any(around == 0.0) or np.any(around != around[0]):
            velocity = velocity - (velocity @ LINES[j]) / (LINES[j] @ LINES[j]) * LINES[j]
    return velocity
