"""Voltages that move the collar along a path in the shortest time with both motors rolling."""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip.checks import (
    Given,
    Numeric,
    check_between,
    check_count,
    check_known,
    one_concrete,
    refusal,
    shape_refusal,
)

from ._arguments import the_machine
from ._contacts import BELT_1, CONTACT_NAMES
from ._leg import Leg, Piece, plain
from ._modes import SIGNS
from ._parameters import CoreXYParameters
from ._path import rows_of_points
from ._plan import Feedforward, joined
from ._rolling_check import check_rolling
from ._system import CoreXY
from ._voltage import Ramps

TRIALS, HOLDS = 64, 5  # accelerations and holds that are tried for the start
SHARES = tuple(0.95**i for i in range(12))  # of the margin, tried for machines with other tensions


def feedforward(
    parameters: CoreXYParameters,
    points: Given[Sequence[Sequence[float]] | np.ndarray | Array],
    *,
    volts: Numeric,
    margin: Numeric = 0.9,
    tension_error: Numeric = 0.0,
    steps: int = 100,
) -> Feedforward:
    r"""Voltages under which the collar goes from point to point on straight lines, from rest to rest at
    each, in the shortest time without a belt that slips.

    While both motors roll (DMN 1), path and speed determine the forces: the forces in the belts and the
    voltages of the motors are linear in the acceleration along the path. The greatest acceleration
    within

    $$|f_i^b| \le c\,\max(\mu_{is}^b, \mu_{ik}^b)\,2P_i, \qquad |v_i| \le V,$$

    then the greatest braking, is the fastest motion along a straight line, and no gradient can better
    it. Where the line lets one of $x$, $y$, $x + y$, $x - y$ stand still, the friction that holds it
    is chosen too, within $c$ of its static limit. Acceleration is constant in each piece, hence
    voltages are linear and the motion is followed exactly. A little time is lost to the first piece,
    in which friction at rest must break, to pieces of 1/`steps` of a leg where $V$ limits it, and to
    1/10,000 of each leg in which the collar comes to rest at 0 V.

    **Arguments**

    - `parameters`: the machine, its numbers scalars. `points` [m]: `[point, 2]`, x and y, the first
      where the collar rests. `volts` $V$ [V].
    - `margin` $c$, up to 1: the part of the friction of the belts that may be needed, and of the
      friction at rest of a line that has to stand still; where friction at rest has to break, it may
      be greater by $1/c$. With 1 rounding decides.
    - `tension_error`: the belts also hold on the four machines whose tensions are off by this part,
      each up or down, which is seen by simulation. Where the collar goes there is another matter,
      which `check_rolling` reports.

    **Returns** a `Feedforward`. **Raises** `TypeError`, `ValueError` for an argument of another
    kind, and for a point that cannot be reached like this: friction at rest must break on all lines
    that move at the same instant, or the collar leaves the path, and belts and voltage must suffice
    for it.

    Source: time scaling along a path under linear limits, Bobrow, Dubowsky and Gibson (1985),
    doi:10.1177/027836498500400301; the outlook of the paper.
    """
    the_machine(parameters, "parameters")
    known_machine(parameters)
    points = rows_of_points("points", points)
    limit, margin, error = plan_limits(volts, margin, tension_error, steps)
    machines = machines_within(parameters, error)
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
        start = break_away(machines, leg, a, hold, margin)
        if isinstance(start, str):
            raise _unreachable(points, i, f"these contacts do not start as they must: {start}")
        return start

    found: list[tuple[Leg, list[Piece]]] = []
    for i, (start, stop) in enumerate(itertools.pairwise(points)):
        length = float(np.linalg.norm(stop - start))
        leg = Leg(machines[0], numbers, (stop - start) / length, margins, limit)
        pieces = leg.pieces(length, steps, lambda a, hold, i=i, leg=leg: start_of(i, leg, a, hold))
        if pieces is None:
            raise _unreachable(points, i, "belts and voltage are too weak against the friction")
        found.append((leg, pieces))
    return joined(machines[0], points, found)


def plan_limits(volts: Any, margin: Any, tension_error: Any, steps: Any) -> tuple[float, float, float]:
    """Voltage, margin and error of the tensions as numbers. Errors: `ValueError`, `TypeError`."""
    limit = float(one_concrete("volts", volts, "positive"))
    margin = float(check_between("margin", one_concrete("margin", margin, "positive"), 0, 1))
    error = float(one_concrete("tension_error", tension_error, "not negative"))
    if error >= 1.0:
        raise refusal("tension_error", error, "below 1")
    check_count("steps", steps, 1)
    return limit, margin, error


def machines_within(parameters: CoreXYParameters, error: float) -> list[CoreXYParameters]:
    """The machine, then those whose two tensions are off by this part of them, both ways."""
    wrong = itertools.product((1.0 - error, 1.0 + error), repeat=2) if error else ()
    return [parameters, *(with_tensions(parameters, *factors) for factors in wrong)]


def known_machine(parameters: CoreXYParameters) -> None:
    """Errors: `TypeError`, `ValueError` for a machine that is traced, or a batch of them."""
    check_known("parameters", parameters)
    for name in (field.name for field in dataclasses.fields(parameters)):
        if np.ndim(getattr(parameters, name)):
            raise shape_refusal(f"parameters.{name}", getattr(parameters, name), "one number")


def with_tensions(p: CoreXYParameters, one: Any, two: Any) -> CoreXYParameters:
    """The machine with its tensions multiplied."""
    return eqx.tree_at(lambda p: (p.P1, p.P2), p, (p.P1 * one, p.P2 * two))


def _unreachable(points: np.ndarray, i: int, why: str) -> Exception:
    allowed = f"a point that the collar can reach from points[{i}] with both motors rolling"
    return refusal(f"points[{i + 1}]", points[i + 1].tolist(), allowed, but=why)


def break_away(
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
    volts = jnp.asarray([leg.voltage(a, hold, 0.0) for a, hold in tried])
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
        one, two = (jnp.full(2, v) for v in pair)
        system = CoreXY(p, Ramps(jnp.arange(2.0), one, two, still, still))
        return system.initial_mode(jnp.zeros(()), system.state(), None)

    return jax.lax.map(mode, volts)
