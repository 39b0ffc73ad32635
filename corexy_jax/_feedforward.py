"""Voltages that move the collar along a path in the shortest time with both motors rolling."""

import itertools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip import Integrator
from stickslip.checks import (
    Given,
    Numeric,
    check_between,
    check_count,
    check_finite,
    check_type,
    is_concrete,
    looks_at,
    misshaped,
    one_concrete,
    reals,
    refusal,
)

from ._arguments import the_integrator, the_machine
from ._contacts import BELT_1, CONTACT_NAMES
from ._leg import Leg, Piece, plain
from ._modes import MODE_DMN, SIGNS
from ._parameters import CoreXYParameters
from ._simulate import simulate_consistent
from ._solution import CoreXYSolution
from ._system import CoreXY
from ._voltage import AbstractVoltage, Ramps

ROWS = 32  # tables are filled up to a multiple of it, so that plans share compiled programs
TRIALS, HOLDS = 64, 5  # accelerations and holds that are tried for the start
SHARES = tuple(0.95**i for i in range(12))  # of the margin, tried for machines with other tensions
CUT = 1e-7  # part of a leg's greatest speed at which its voltage goes off
PAUSE = 1e-4  # part of a leg's time for which it stays off
AFTER = 0.25  # part of the plan for which a check goes on behind its end


class Feedforward(eqx.Module):
    """What `feedforward` found.

    - `parameters`, `points` [m] as given. `voltage`: a `Ramps`, 0 V from `end` [s] on.
    - `times` [s], where each piece of constant acceleration begins, and the end; for each piece
      `position` [m] and `velocity` [m/s] at its begin, `acceleration` [m/s²], `[piece, 2]`, and
      `belt_force` [N], what each belt carries, `[piece, 2]`.
    - `leg_times` [s]: when each of the `points` is reached.
    """

    parameters: CoreXYParameters
    points: Float[Array, "point 2"]
    voltage: Ramps
    times: Float[Array, " time"]
    position: Float[Array, "piece 2"]
    velocity: Float[Array, "piece 2"]
    acceleration: Float[Array, "piece 2"]
    belt_force: Float[Array, "piece 2"]
    leg_times: Float[Array, " point"]

    @property
    def end(self) -> Float[Array, ""]:
        """Time [s] at which the last point is reached."""
        return self.times[-1]

    @looks_at(t=reals)
    def at(self, t: Numeric) -> Float[Array, "*times 2"]:
        """Planned position [m] at `t` [s]; that of the last point after the end."""
        t = jnp.clip(jnp.asarray(t, jnp.float64), 0.0, self.end)
        piece = jnp.clip(jnp.searchsorted(self.times, t, side="right") - 1, 0, self.times.size - 2)
        since = (t - self.times[piece])[..., None]
        return self.position[piece] + since * (
            self.velocity[piece] + 0.5 * since * self.acceleration[piece]
        )


def feedforward(
    parameters: CoreXYParameters,
    points: Given[Any],
    *,
    volts: Numeric,
    margin: Numeric = 0.9,
    tension_error: Numeric = 0.0,
    steps: int = 40,
) -> Feedforward:
    r"""Voltages under which the collar goes from point to point on straight lines, from rest to rest at
    each, in the shortest time without a belt that slips.

    While both motors roll (DMN 1) the machine is differentially flat but for friction that changes its
    sense: path and speed tell the forces, so what the belts carry and what the motors need is linear
    in the acceleration along the path. The greatest acceleration within

    $$|f_i^b| \le c\,\max(\mu_{is}^b, \mu_{ik}^b)\,2P_i, \qquad |v_i| \le V,$$

    then the greatest braking, is the fastest motion along a straight line; no gradient can better
    it. Where the line lets one of $x$, $y$, $x + y$, $x - y$ stand still, the friction that holds it
    is chosen with it, within $c$ of its static limit. Acceleration is constant in each piece, hence
    voltages are linear and the motion is followed exactly; only where $V$ limits it, pieces of 1/`steps`
    of a leg lose a little time.

    **Arguments**

    - `parameters`: the machine, its numbers scalars. `points` [m]: `[point, 2]`, x and y, the first
      where the collar rests. `volts` $V$ [V].
    - `margin` $c$, up to 1: the part of the static friction that may be needed. With 1 rounding
      decides whether a belt slips.
    - `tension_error`: the belts also hold on the four machines whose tensions are off by this part, each
      up or down, which is seen by simulation. Where the collar goes is then another matter, which
      `check_rolling` tells.

    **Returns** a `Feedforward`. **Raises** `TypeError`, `ValueError` for what is not so, and for a point
    that cannot be reached like this: friction at rest, which is greater than that in motion, must break
    on all lines that move at the same instant, or the collar leaves the path, and belts and voltage
    must suffice for it.

    Source: time scaling along a path under linear limits, Bobrow, Dubowsky and Gibson (1985),
    doi:10.1177/027836498500400301; the outlook of the paper.
    """
    the_machine(parameters, "parameters")
    if not is_concrete(parameters):
        raise refusal("parameters", parameters, "known: call this outside of jit and vmap", TypeError)
    for name in parameters.__dataclass_fields__:
        if np.ndim(getattr(parameters, name)):
            raise misshaped(f"parameters.{name}", getattr(parameters, name), "one number")
    points = _points(points)
    limit = float(one_concrete("volts", volts, "positive"))
    margin = float(check_between("margin", one_concrete("margin", margin, "positive"), 0.0, 1.0))
    error = float(one_concrete("tension_error", tension_error, "not negative"))
    if error >= 1.0:
        raise refusal("tension_error", error, "below 1")
    check_count("steps", steps, 1)
    wrong = list(itertools.product((1.0 - error, 1.0 + error), repeat=2)) if error else []
    machines = [parameters, *(with_tensions(parameters, *factors) for factors in wrong)]
    for share in SHARES if error else (1.0,):
        plan = _plan(machines, points, limit, margin, share * margin, steps)
        # What a line that stops early does to the belts is not of first order: see whether they hold.
        if all(jnp.all(check_rolling(plan, p).rolls) for p in machines[1:]):
            return plan
    raise refusal(
        "tension_error", error, "so small that a voltage can be found with which the belts hold"
    )


def _plan(
    machines: list[CoreXYParameters], points: Any, limit: float, margin: float, other: float, steps: int
) -> Feedforward:
    """For the first of the machines, with the margin `other` for the belts of the others."""
    numbers = [plain(p) for p in machines]
    margins = [margin] + [other] * (len(machines) - 1)

    def start_of(i: int, leg: Leg, a: float, hold: float) -> tuple[float, float]:
        start = _break_away(machines, leg, a, hold, margin)
        if isinstance(start, str):
            raise _unreachable(points, i, f"what does not start as it must is {start}")
        return start

    found: list[tuple[Leg, list[Piece]]] = []
    for i, (start, stop) in enumerate(itertools.pairwise(points)):
        length = float(np.linalg.norm(stop - start))
        leg = Leg(machines[0], numbers, (stop - start) / length, margins, limit)
        pieces = leg.pieces(length, steps, lambda a, hold, i=i, leg=leg: start_of(i, leg, a, hold))
        if pieces is None:
            raise _unreachable(points, i, "belts and voltage are too weak against the friction")
        found.append((leg, pieces))
    return _joined(machines[0], points, found)


def with_tensions(p: CoreXYParameters, one: Any, two: Any) -> CoreXYParameters:
    """The machine with its tensions multiplied."""
    return eqx.tree_at(lambda p: (p.P1, p.P2), p, (p.P1 * one, p.P2 * two))


def _points(points: Any) -> np.ndarray:
    if not is_concrete(points):
        raise refusal("points", points, "known: call this outside of jit and vmap", TypeError)
    check_finite("points", points)
    found = np.asarray(points, np.float64)
    if found.ndim != 2 or found.shape[0] < 2 or found.shape[1] != 2:
        raise misshaped("points", points, "of shape [point, 2], at least two points")
    for i, (a, b) in enumerate(itertools.pairwise(found)):
        if not np.linalg.norm(b - a) > 0.0:
            raise refusal(f"points[{i + 1}]", b.tolist(), "another place than the point before it")
    return found


def _unreachable(points: np.ndarray, i: int, why: str) -> Exception:
    allowed = f"a point that the collar can reach from points[{i}] with both motors rolling"
    return refusal(f"points[{i + 1}]", points[i + 1].tolist(), allowed, but=why)


def _break_away(
    machines: list[CoreXYParameters], leg: Leg, a: float, hold: float, margin: float
) -> tuple[float, float] | str:
    """The greatest acceleration up to `a` [m/s²], and its hold [N], under which all contacts start or
    rest as the leg needs them to, by the law of all contacts, with the friction at rest greater and
    that of the belts smaller by the margin. Or the contacts that do not.

    Before anything slides friction is greater than after it, and the belts carry more.
    """
    shares = np.linspace(1.0, 0.0, TRIALS, endpoint=False)
    holds = np.linspace(1.0, 0.0, HOLDS) if hold else np.ones(1)
    tried = np.array([(share * a, part * hold) for share in shares for part in holds])
    volts = jnp.asarray([leg.voltage(*one, 0.0) for one in tried])
    senses = np.stack([SIGNS[np.asarray(_first_modes(_harder(p, margin), volts))] for p in machines])
    wanted = np.concatenate([leg.senses, leg.senses[2:], np.zeros(2)])
    # On a machine with other tensions the collar may leave the path, but no belt may slip.
    right = np.all(senses[0] == wanted, axis=1) & np.all(senses[:, :, BELT_1:] == 0, axis=(0, 2))
    if right.any():
        one = tried[int(np.argmax(right))]
        return float(one[0]), float(one[1])
    wrong = senses[0, 0] != wanted
    wrong[BELT_1:] |= np.any(senses[:, 0, BELT_1:] != 0, axis=0)
    return ", ".join(CONTACT_NAMES[c] for c in np.flatnonzero(wrong))


def _harder(p: CoreXYParameters, margin: float) -> CoreXYParameters:
    names = ("mu_s", "mu_1s_b", "mu_2s_b")
    factors = (1.0 / margin, margin, margin)
    return eqx.tree_at(
        lambda p: [getattr(p, name) for name in names], p,
        [getattr(p, name) * factor for name, factor in zip(names, factors, strict=True)],
    )  # fmt: skip


@eqx.filter_jit
def _first_modes(p: CoreXYParameters, volts: Float[Array, "trial 2"]) -> Any:
    """The modes at rest after these voltages have come on."""

    def mode(pair):
        still = jnp.zeros(2)
        system = CoreXY(p, Ramps(jnp.arange(2.0), *(jnp.full(2, v) for v in pair), still, still))
        return system.initial_mode(jnp.zeros(()), system.state(), None)

    return jax.lax.map(mode, volts)


def _joined(
    p: CoreXYParameters, points: np.ndarray, legs: list[tuple[Leg, list[Piece]]]
) -> Feedforward:
    t, times, places, velocities, accelerations, forces = 0.0, [0.0], [], [], [], []
    table, reached = [], [0.0]
    for (leg, pieces), start in zip(legs, points, strict=False):
        way = 0.0
        for piece in pieces:
            d = leg.direction
            volts = leg.voltage(piece.a, piece.hold, piece.speed)
            table.append((t, *volts, *(leg.emf * piece.a)))
            places.append(start + way * d)
            velocities.append(piece.speed * d)
            accelerations.append(piece.a * d)
            forces.append(leg.belt_forces(piece.a, piece.hold))
            way += piece.speed * piece.duration + 0.5 * piece.a * piece.duration**2
            t += piece.duration
            times.append(t)
        # The voltage is off a moment before the stop, so that the contacts come to rest one by one and
        # not all within rounding, and for a moment after it, so that they do.
        table.append((t - CUT * max(p.speed for p in pieces) / abs(pieces[-1].a), 0.0, 0.0, 0.0, 0.0))
        reached.append(t)
        places.append(start + way * leg.direction)
        velocities.append(np.zeros(2))
        accelerations.append(np.zeros(2))
        forces.append(np.zeros(2))
        t += PAUSE * (t - reached[-2])
        times.append(t)
    more = -(-len(table) // ROWS) * ROWS - len(table)
    table += [(t + float(i), 0.0, 0.0, 0.0, 0.0) for i in range(more)]
    voltage = Ramps(*(jnp.asarray(column) for column in np.array(table).T))
    rows = (times, places, velocities, accelerations, forces, reached)
    return Feedforward(p, jnp.asarray(points), voltage, *(jnp.asarray(np.array(a)) for a in rows))


class RollingCheck(eqx.Module):
    """What the machine does under the voltages of a plan; `print` says it in words.

    - `slip` [m]: distance that each belt slips. `first_slip` [s]: when, infinite if never.
    - `deviation` [m]: greatest distance from the planned place. `end_error` [m]: distance of the collar
      from the last point at the end of the check. `at_rest`: whether it rests there.
    - `solution`: the `CoreXYSolution`.
    """

    slip: Float[Array, "2"]
    first_slip: Float[Array, "2"]
    deviation: Float[Array, ""]
    end_error: Float[Array, ""]
    at_rest: Array
    solution: CoreXYSolution

    @property
    def rolls(self) -> Array:
        """Whether each motor rolls all the time."""
        return jnp.isinf(self.first_slip)

    def __str__(self):
        slips = [
            f"belt {i + 1} slips from {self.first_slip[i]:.4g} s on, by {1e3 * self.slip[i]:.3g} mm in all"
            for i in np.flatnonzero(~np.asarray(self.rolls))
        ]
        word = "at rest" if self.at_rest else "still moving"
        end = f"the collar ends {1e3 * self.end_error:.3g} mm off, {word}"
        return "; ".join([*(slips or ["both motors roll all the time"]), end])


def check_rolling(
    plan: Given[Feedforward],
    parameters: Given[CoreXYParameters | None] = None,
    *,
    voltage: Given[AbstractVoltage | None] = None,
    rows: int = 401,
    integrator: Integrator | None = None,
) -> RollingCheck:
    """Simulate a plan with all its events, on the machine it was made for or on another one.

    **Arguments:** `plan`; `parameters` of another machine, e.g. with wrong tensions; `voltage` in place
    of the plan's, e.g. sampled; `rows` at which the deviation is looked at, until a quarter of the plan
    after its end; `integrator` as for `simulate`. **Returns** a `RollingCheck`. **Raises** `TypeError`,
    `ValueError` for what is not so, and where the run fails.
    """
    check_type("plan", plan, Feedforward, "a Feedforward")
    p = plan.parameters if parameters is None else the_machine(parameters, "parameters")
    if voltage is None:
        voltage = plan.voltage
    check_type("voltage", voltage, AbstractVoltage | None, "an AbstractVoltage or None")
    the_integrator(integrator)
    t1 = (1.0 + AFTER) * plan.end
    start = CoreXY(p, voltage).state(x=plan.points[0, 0], y=plan.points[0, 1])
    found = simulate_consistent(p, voltage, t1, rows=rows, y0=start, integrator=integrator)
    return _checked(plan, found)


@eqx.filter_jit
def _checked(plan: Feedforward, found: CoreXYSolution) -> RollingCheck:
    log = found.events
    assert log is not None
    happened = jnp.arange(log.t.shape[0], dtype=jnp.int32) < log.count
    dmn = jnp.asarray(MODE_DMN)[jnp.maximum(log.mode_after, 0)]
    times, models = jnp.append(log.t, 0.0), jnp.append(jnp.where(happened, dmn, 1), found.dmn[0])
    slips = jnp.stack([(models == 2) | (models == 4), models >= 3])
    first = jnp.min(jnp.where(slips, times[None], jnp.inf), axis=1)
    place = jnp.stack([found.y.x, found.y.y], axis=-1)
    off = jnp.linalg.norm(place - plan.at(found.t), axis=-1)
    still = jnp.all(found.senses[-1] == 0.0)
    return RollingCheck(found.ledger.slip[-1], first, jnp.max(off), off[-1], still, found)
