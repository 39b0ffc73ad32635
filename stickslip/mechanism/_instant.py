"""What a mechanism declares at one instant, and the motion that follows in a known mode."""

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where
from stickslip._validation import DeclarationError, refusal
from stickslip.hybrid.dependence import NONE, degrees

from ._check import check_contacts
from ._contact import Contact
from ._declaration import in_order, mass_of
from ._first_order import rates_of
from ._island import Island, Motion
from ._modes import sense_of
from ._reserve import NO_LIMIT
from ._scalars import Mass, dot, is_zero, minus, over, times, total
from ._settle import Limits
from ._stop import StopNow, stops_at

if TYPE_CHECKING:
    from ._mechanism import AbstractMechanism

ROUNDING = 8 * 2.3e-16  # of the terms of a sliding speed


class Instant(NamedTuple):
    """Everything that the declaration says about one instant.

    - `q`, `v`: coordinates with the states of first order after them, and rates of the coordinates.
    - `rates` of the states of first order.
    - `mass`, `force`: inertia, and all forces but those of the contacts [N].
    - `contacts`, `stops`: a `Contact` for each contact, a `StopNow` for each stop.
    - `directions`: a row for each contact and then for each stop, the gradient of its gap.
    - `surfaces`: speeds $w$ of the counter surfaces [m/s], those of moving stops too.
    - `speeds`: sliding speeds $u = n \\cdot v - w$ [m/s]; of stops the rates of their gaps.
    """

    q: Any
    v: Any
    mass: Mass
    force: list[Any]
    contacts: list[Contact]
    directions: list[list[Any]]
    speeds: list[Any]
    stops: list[StopNow]
    surfaces: list[Any]
    rates: list[Any]

    @property
    def q_rate(self) -> Any:
        """Rates of all that `q` holds."""
        both = zip(self.q, (*self.v, *self.rates), strict=True)
        return type(self.q)(*(None if place is None else rate for place, rate in both))


def instant_of(machine: "AbstractMechanism", t: Any, q: Any, v: Any, args: Any) -> Instant:
    """What `machine` declares at time `t`, at the coordinates `q` with the rates `v`."""
    names = machine.names
    force = in_order(
        "forces(t, q, v, args)", machine.forces(t, q, v, args), names.coordinates, "forces"
    )
    mass = mass_of(machine.mass_matrix(q), names.coordinates)
    rates = rates_of(machine, t, q, v, args)
    contacts, directions, speeds, stops, surfaces = touching(machine, t, q, v, args)
    return Instant(q, v, mass, force, contacts, directions, speeds, stops, surfaces, rates)


def touching(machine: "AbstractMechanism", t: Any, q: Any, v: Any, args: Any) -> tuple:
    """What an `Instant` has after its forces: contacts, directions, speeds, stops and surfaces."""
    names = machine.names
    contacts = check_contacts(machine, machine.contacts(t, q, v, args))
    rows = []
    for name, row, contact in zip(names.contacts, machine.directions, contacts, strict=True):
        if np.isnan(row).any():
            what = f"contacts(...)[{name!r}].direction"
            rows.append(in_order(what, contact.direction, names.coordinates, "numbers"))
        elif contact.direction is not None:
            allowed = "left out, as `contact_directions` has constant numbers for it"
            raise refusal(f"contacts(...)[{name!r}].direction", contact.direction, allowed)
        else:
            rows.append([float(x) for x in row])
    stops = stops_at(machine, t, q, args)
    rows += [stop.row for stop in stops]
    surfaces = [contact.surface_speed for contact in contacts]
    surfaces += [times(-1.0, stop.rate) for stop in stops]
    speeds = [
        jnp.asarray(minus(dot(row, v), surface), jnp.float64)
        for row, surface in zip(rows, surfaces, strict=True)
    ]
    return contacts, rows, speeds, stops, surfaces


def surface_accelerations(machine: "AbstractMechanism", t: Any, at: Instant, args: Any) -> list[Any]:
    r"""$\gamma = \dot w - \dot n \cdot v$: what $n \cdot a$ is while the contact rests.

    The constant 0 where neither direction nor surface speed depends on time or coordinates. Raises
    `DeclarationError` where one of them depends on the velocities.
    """
    if not at.speeds:
        return []
    names = machine.names.contacts

    def speeds(t, q):
        return touching(machine, t, q, at.v, args)[2]

    def given(v):
        contacts, rows, *_ = touching(machine, t, at.q, v, args)
        return [
            sum(jnp.asarray(x, jnp.float64) + 0.0 for x in (contact.surface_speed, *row))
            for contact, row in zip(contacts, rows, strict=False)
        ]

    t = jnp.asarray(t, jnp.float64)
    q, v = floats(at.q), floats(at.v)
    q_rate = floats(at.q_rate)
    for name, depends in zip(names, degrees(given, (v,), (True,)) if names else [], strict=True):
        if depends != NONE:
            what = f"surface_speed and direction of contact {name!r}"
            allowed = (
                "functions of time and coordinates (a surface that moves belongs to the direction)"
            )
            raise DeclarationError(str(refusal(what, "functions of the velocities", allowed)))
    depends = degrees(speeds, (t, q), (True, True))
    if all(d == NONE for d in depends):
        return [0.0] * len(depends)
    # Of one velocity a stop without a speed of its own holds everything that is at rest.
    still = [len(names) + k for k, rate in enumerate(machine.slopes[:, -1]) if rate == 0.0]
    for island in machine.islands:
        moves = [c for c in island.rows if depends[c] != NONE and not (island.shut and c in still)]
        if island.dependent and moves and not (island.shut and _straight(machine, t, at, island, args)):
            raise _moving(machine, island, moves)
    rates = jax.jvp(speeds, (t, q), (jnp.ones_like(t), q_rate))[1]
    return [0.0 if d == NONE else -r for d, r in zip(depends, rates, strict=True)]


def _straight(machine: "AbstractMechanism", t: Any, at: Instant, island: Island, args: Any) -> bool:
    """Whether the directions of all contacts of an island are constant during a run."""
    if not np.isnan(island.directions[: island.contacts]).any():
        return True

    def directions(t, q):
        rows = touching(machine, t, q, at.v, args)[1]
        return [jnp.asarray(total(rows[c])) + 0.0 for c in island.rows[: island.contacts]]

    return all(d == NONE for d in degrees(directions, (t, floats(at.q)), (True, True)))


def _moving(machine: "AbstractMechanism", island: Island, moves: list[int]) -> DeclarationError:
    """The error of surfaces that move or turn beside others, on which something would rest as well."""
    others = ", ".join(names_of_rows(machine, [c for c in island.rows if c not in moves]))
    beside = f" beside {others}" if others else ""
    allowed = (
        f"of constant speed{beside}: what rests on two surfaces cannot follow both. Stops and contacts "
        "of constant directions may move where they touch one coordinate that nothing couples with "
        "another, and where no direction depends on others; else put a stiff spring in place of one"
    )
    what = "surfaces of contacts and stops whose directions depend on each other"
    return DeclarationError(str(refusal(what, ", ".join(names_of_rows(machine, moves)), allowed)))


def names_of_rows(machine: "AbstractMechanism", rows: Any) -> list[str]:
    """Names of some of the contacts and stops."""
    names = machine.names.contacts + machine.names.stops
    return [names[c] for c in rows]


def floats(numbers: Any) -> Any:
    """Numbers of a state as arrays, as `jax.jvp` wants them."""
    return jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), numbers)


def loaded(
    machine: "AbstractMechanism",
    at: Instant,
    states: Any,
    without: list | None = None,
    lone: bool = True,
    apart: bool = False,
) -> list[Any]:
    """All forces [N]: those declared, friction of the sliding contacts, normal forces of closed ones.

    `without`: contacts whose friction is left out too. `lone`: whether friction of contacts that change
    the acceleration along no other counts: what they would bear at rest does not depend on it. `apart`:
    whether that of islands which are treated in rows is left out.
    """
    force = list(at.force)
    separate = () if lone else (island for island in machine.islands if island.separate)
    skipped = {c for island in separate for c in island.rows}
    if apart:
        skipped |= {c for island in machine.islands if in_rows(machine, island) for c in island.rows}
    for c, contact in enumerate(at.contacts):
        if c in skipped and contact.normal_direction is None:
            continue
        s = states[c]
        if c in skipped:
            force = pushed(machine, force, at, c, s)
            continue
        idle = s == 0.0
        if machine.names.contacts[c] in machine.opening:
            idle = idle | (s == 2.0)
        if without is not None:
            idle = idle | without[c]
        friction = contact.law.slip_force(at.speeds[c], contact.normal_force, sense_of(s))
        friction = where(idle, 0.0, friction)
        force = [total((f, times(n, friction))) for f, n in zip(force, at.directions[c], strict=True)]
        force = pushed(machine, force, at, c, s)
    return force


def in_rows(machine: "AbstractMechanism", island: Island) -> bool:
    """Whether the contacts of an island are treated side by side: dependent ones, none that opens."""
    names = machine.names
    opens = any(names.contacts[c] in names.opening for c in island.rows[: island.contacts])
    return island.dependent and not island.stops and not opens


def push_of(machine: "AbstractMechanism", at: Instant, c: int) -> list[Any] | None:
    """Generalised force of a normal force of 1 N in contact number `c`; None where it has none."""
    direction, names = at.contacts[c].normal_direction, machine.names
    if direction is None:
        return None
    what = f"contacts(...)[{names.contacts[c]!r}].normal_direction"
    return in_order(what, direction, names.coordinates, "numbers")


def pushed(machine: "AbstractMechanism", force: list, at: Instant, c: int, s: Any) -> list[Any]:
    """`force`, and that of the normal force of contact `c` unless it is open."""
    push = push_of(machine, at, c)
    if push is None:
        return force
    pressed = where(s == 2.0, 0.0, at.contacts[c].normal_force)
    return [total((f, times(n, pressed))) for f, n in zip(force, push, strict=True)]


def rows_of(island: Island, at: Instant) -> list[list[Any]]:
    """Directions of the contacts of an island."""
    return [[at.directions[c][j] for j in island.columns] for c in island.rows]


def motion_of(island: Island, at: Instant, states: Any, force: list, gamma: list) -> Motion:
    """Motion of an island in the mode of these states under all forces."""
    rest = [states[c] == 0.0 for c in island.rows]
    own = [force[j] for j in island.columns]
    surface = [gamma[c] for c in island.rows]
    return island.motion(at.mass.of(island.columns), own, rows_of(island, at), rest, surface)


def limits_of(island: Island, at: Instant, which: str) -> Limits:
    """Friction that each contact can bear [N], by the coefficient of its law named `which`."""
    low, high = [], []
    for c in island.rows:
        if c >= len(at.contacts):
            low.append(0.0)
            high.append(NO_LIMIT)
            continue
        law, load = at.contacts[c].law, at.contacts[c].normal_force
        ahead = getattr(law, which)(1) * load
        behind = ahead if law.is_odd else getattr(law, which)(-1) * load
        low.append(-ahead)
        high.append(behind)
    return Limits(low, high)


def held_contacts(at: Instant, island: Island, states: Any, slow: list) -> list[Any]:
    """The `slow` contacts, which rest where those do that decide their speed; none that are open."""
    if not island.dependent:
        return slow
    # Beside speeds that are all rounding none of them is small.
    agree = False if island.stops else island.agree([at.surfaces[c] for c in island.rows])
    return [(x | agree) & (states[c] != 2.0) for x, c in zip(slow, island.rows, strict=True)]


def slow_contacts(
    at: Instant, island: Island, before: Instant | None = None, part: float = ROUNDING
) -> list[Any]:
    """Whether a sliding speed is rounding of the terms that it is the sum of, or this `part` of them.

    `before`: an instant whose terms count too, of which these speeds are what an event has left.
    """
    largest: Any = 0.0
    for c in island.rows:
        for one in (at,) if before is None else (at, before):
            pairs = zip(one.directions[c], one.v, strict=True)
            terms = [times(n, x) for n, x in pairs if not is_zero(n)]
            size = total(jnp.abs(x) for x in (*terms, jnp.asarray(one.surfaces[c])))
            largest = jnp.maximum(largest, size)
    return [jnp.abs(at.speeds[c]) <= part * largest for c in island.rows]


def landed(island: Island, at: Instant, still: list) -> list[Any]:
    """Velocities of an island with the contacts in `still` at rest, to the last digit."""
    v = [jnp.asarray(at.v[j], jnp.float64) for j in island.columns]
    rows, speeds = rows_of(island, at), [at.speeds[c] for c in island.rows]
    if not island.alone:
        v = island.project(at.mass.of(island.columns), v, rows, still, speeds)
    for row, c, rests in zip(rows, island.rows, still, strict=True):
        own = [j for j, n in enumerate(row) if not is_zero(n)]
        if len(own) == 1:
            (j,) = own
            v[j] = where(island.decides(rests, row[j]), times(over(row[j]), at.surfaces[c]), v[j])
        elif c >= len(at.contacts):
            # A gap that rounding still closes as it opens would look as if it were touched. By the
            # velocity that decides most: an entry may be 0 without being known to be.
            leads, now = jnp.argmax(jnp.abs(jnp.stack([row[j] + 0.0 for j in own]))), list(v)
            for place, j in enumerate(own):
                others = dot([row[i] for i in own if i != j], [now[i] for i in own if i != j])
                alone = times(over(row[j]), minus(at.surfaces[c], others))
                v[j] = where(rests & (leads == place), alone, now[j])
    return v


def pressing(load: Any) -> Any:
    """The normal force of a contact that may be open."""
    load = jnp.asarray(load, jnp.float64)
    return where(load > 0.0, load, 0.0)
