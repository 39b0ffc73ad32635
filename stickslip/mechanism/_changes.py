"""Changes of the mode: what fires, what stops and gives way, and the mode of a given state."""

import functools
import operator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
from jax import lax

from stickslip._fastmath import where
from stickslip.hybrid.dependence import OTHER, degrees
from stickslip.hybrid.system import NO_MODE

from ._any_args import with_any_args
from ._beginning import begun, drifting
from ._check import SLIDES
from ._contact import drags
from ._declaration import at_zero
from ._impacts import struck, touches
from ._instant import (
    Instant,
    floats,
    held_contacts,
    in_rows,
    landed,
    limits_of,
    loaded,
    motion_of,
    rows_of,
    slow_contacts,
    surface_accelerations,
    touching,
)
from ._island import Island
from ._island_rows import IslandRows, with_rows
from ._parting import beside_what_rests, placed
from ._reserve import least_reserve, lone_reaction
from ._rows import row
from ._scalars import any_of, dot, is_zero, minus, without_slope
from ._settle import settled

if TYPE_CHECKING:
    from ._mechanism import AbstractMechanism

MOST_SHARE = 1e6  # a share of friction beyond it says no more


def guards(machine: "AbstractMechanism", t: Any, y: Any, mode: Any, args: Any) -> tuple:
    """Values of all guards, in the order of their names."""
    at, states = machine.instant(t, y, args), machine.states(mode)
    force = loaded(machine, at, states, lone=False, apart=True)
    gamma = surface_accelerations(machine, t, at, args)
    own: list[Any] = [None] * len(states)
    parted: dict[int, Any] = dict.fromkeys(machine.parted)
    shared: list[Any] = []
    names = machine.names
    for island in machine.islands:
        if not island.rows:
            continue
        if in_rows(machine, island):
            values, left = IslandRows(machine, island, at, states, force).guards()
            for c, value in zip(island.rows, values, strict=True):
                own[c] = value
            shared.append(left)
            continue
        motion = motion_of(island, at, states, force, gamma)
        limits = limits_of(island, at, "static_coefficient")
        rest = [states[c] == 0.0 for c in island.rows]
        slip = [states[c] * at.speeds[c] for c in island.rows[: island.contacts]]
        for i, c in enumerate(island.rows[island.contacts :], island.contacts):
            gap = jnp.asarray(at.stops[c - len(at.contacts)].stop.gap, jnp.float64)
            alone = 1.0 if island.dependent else lone_reaction(island, rows_of(island, at), motion, i)
            own[c] = where(rest[i], alone, gap)
        if island.dependent:
            # One of those that always slide together is enough; two would count as coincident.
            tied_to = island.tied(rest, [at.surfaces[c] for c in island.rows])
            # One that is open looks after no other.
            rows = island.rows[: island.contacts]
            openings = [states[c] == 2.0 for c in rows if names.contacts[c] in names.opening]
            if openings:
                closed = ~any_of(openings)
                tied_to = [tied & closed for tied in tied_to]
            for c, r, tied, u in zip(island.rows, rest, tied_to, slip, strict=False):
                own[c] = where(r | tied, 1.0, u)
            if island.shut:
                beside = beside_what_rests(island, at, states, force, gamma, limits, motion)
                some = any_of(rest)
                for i, (c, r, x) in enumerate(zip(island.rows, rest, beside, strict=False)):
                    slides = some & (states[c] != 2.0) if i < island.contacts else r
                    own[c] = where(slides, x, own[c])
            if island.stops:
                reserve = least_reserve(island, *limits, rows_of(island, at), rest, motion)[0]
                shared.append(where(reserve < jnp.inf, reserve, 1.0))
                continue
            share = island.onset(*limits, rest, motion)[0]
            shared.append(1.0 - jnp.minimum(share, MOST_SHARE))
            continue
        for i, c in enumerate(island.rows[: island.contacts]):
            low, high, borne = limits.low[i], limits.high[i], motion.force[i]
            if c in parted:
                reserve = high - borne
                parted[c] = where(rest[i], borne - low, 1.0)
            elif at.contacts[c].law.is_odd:
                reserve = high - jnp.abs(borne)
            else:
                reserve = jnp.minimum(high - borne, borne - low)
            own[c] = where(rest[i], reserve, slip[i])
    opens = []
    for name in machine.opening:
        c = names.contacts.index(name)
        closed = at.contacts[c].normal_force
        if drags(at.contacts[c].law):
            # A normal force that stays at 0 crosses nothing, but drag would go on without it.
            load, rate = _load(machine, t, at, c, args)
            drag = jnp.abs(at.contacts[c].law.drag(at.speeds[c]))
            closed = where((load == 0.0) & (rate == 0.0), -drag, closed)
        opens.append(where(states[c] == 2.0, -at.contacts[c].normal_force, closed))
        own[c] = where(states[c] == 2.0, 1.0, own[c])
    lifts = [at.contacts[c].normal_force for c in machine.lifting]
    first = len(at.contacts)
    found = (*own[:first], *parted.values(), *shared, *opens, *lifts, *own[first:])
    return tuple(jnp.asarray(x, jnp.float64) for x in found)


def parted(machine: "AbstractMechanism") -> tuple[int, ...]:
    """Contacts at rest whose friction left on either side is affine in time and state.

    Each side then has a guard of its own, a straight line along the motion: nothing has to be looked
    for between the ends of a step, as it must where the lesser of the two is one guard.
    """
    names = machine.names
    count, stops = len(names.contacts), len(names.stops)
    if not count:
        return ()

    def sides(t, y, args):
        # What is chosen by a state counts with all it may be: stops that are open, and closed.
        at = machine.instant(t, y, args)
        states = [jnp.zeros(())] * count + [jnp.full((), 2.0)] * stops
        force = loaded(machine, at, states, lone=False)
        gamma = surface_accelerations(machine, t, at, args)
        found: list[Any] = [at.v[0] * at.v[0]] * (2 * count)
        for island in machine.islands:
            if island.dependent or not island.rows:
                continue
            motion = motion_of(island, at, states, force, gamma)
            limits = limits_of(island, at, "static_coefficient")
            for i, c in enumerate(island.rows[: island.contacts]):
                found[2 * c] = limits.high[i] - motion.force[i]
                found[2 * c + 1] = motion.force[i] - limits.low[i]
        return [jnp.asarray(x, jnp.float64) + 0.0 for x in found]

    def with_args(args):
        operands = jnp.zeros(()), machine.from_coordinates(*at_zero(names))
        degree = degrees(lambda t, y: sides(t, y, args), operands, (True, True))
        return {c for c in range(count) if OTHER not in degree[2 * c : 2 * c + 2]}

    return tuple(sorted(with_any_args(with_args)))


def transition(
    machine: "AbstractMechanism", t: Any, y: Any, mode: Any, guard: Any, args: Any
) -> tuple[Any, Any]:
    """State and mode right after guard number `guard` has fired.

    Guards that a subclass has after all others ask the law of all contacts again, and so does the
    constant -1: a load has jumped.
    """
    names, jumped = machine.names, isinstance(guard, int) and guard < 0
    guard = jnp.asarray(guard)
    count = len(names.contacts)
    at, states = machine.instant(t, y, args), machine.states(mode)
    rested = [s == 0.0 for s in states]
    shared = count + len(machine.parted)
    opens = shared + sum(island.dependent for island in machine.islands)

    def fired(c: int) -> Any:
        own = guard == c
        parts = (guard == count + k for k, p in enumerate(machine.parted) if p == c)
        return functools.reduce(operator.or_, parts, own)

    toggled = {name: guard == opens + k for k, name in enumerate(names.opening)}
    lifting = machine.lifting
    lifts = opens + len(toggled)
    first_stop = lifts + len(lifting)
    # A contact that cannot open has lost its normal force.
    own = first_stop + len(names.stops)
    asked = guard >= own if len(machine.guard_names) > own else None
    asked = guard < 0 if jumped else asked
    others = names.stops or asked is not None
    failed = (guard >= lifts) & (guard < first_stop) if others else guard >= lifts
    left = met = [failed & False] * len(states)
    gamma = surface_accelerations(machine, t, at, args)
    if jumped:
        states = _carried(machine, at, states, gamma)
        states = begun(machine, t, y, at, states, args)
        for name in names.opening:
            c = names.contacts.index(name)
            load, off = at.contacts[c].normal_force, states[c] == 2.0
            toggled[name] = (off & (load > 0.0)) | (~off & (load < 0.0))
    elif names.stops:
        left = [(guard == first_stop + c - count) & (s == 0.0) for c, s in enumerate(states)]
        at, states, met, jammed = struck(
            machine, t, at, states, guard - first_stop, args, _law_of(machine, t, args)
        )
        failed = failed | jammed
        gamma = surface_accelerations(machine, t, at, args)
    force = loaded(machine, at, states, lone=False, apart=True)
    q, v, new = at.q, [jnp.asarray(x, jnp.float64) for x in at.v], states
    for island in machine.islands:
        if not island.rows:
            continue
        if in_rows(machine, island):
            rows = IslandRows(machine, island, at, states, force)
            speeds, found, ended = rows.changed(guard, guard == shared, asked)
            shared += 1
            failed = failed | ~ended
            for j, x in zip(island.columns, speeds, strict=True):
                v[j] = x
            new = with_rows(island, new, found)
            continue
        s = [states[c] for c in island.rows]
        rest = [x == 0.0 for x in s]
        hit = [fired(c) if c < count else left[c] for c in island.rows]
        motion = jax.tree.map(lax.stop_gradient, motion_of(island, at, states, force, gamma))
        if island.dependent:
            gives_way, stops = guard == shared, any_of(hit)
            shared += 1
            low, high = without_slope(limits_of(island, at, "static_coefficient"))
            if island.stops:
                rows = rows_of(island, at)
                _, released = least_reserve(island, low, high, rows, rest, motion)
            else:
                _, released = island.onset(low, high, rest, motion)
        else:
            # What it bears pushes back: it gives way against it.
            released = [
                where(h & r, where(borne > 0.0, -1.0, 1.0) if c < count else 1.0, 0.0)
                for c, h, r, borne in zip(island.rows, hit, rest, motion.force, strict=True)
            ]
            gives_way = any_of(h & r for h, r in zip(hit, rest, strict=True))
            for c, h, r, borne in zip(island.rows, hit, rest, motion.force, strict=True):
                if c in lifting:
                    # What bears nothing gives way only where nothing presses it on any more.
                    failed = failed | (h & r & (borne == 0.0))
            stops = any_of(hit) & ~gives_way
        now = [where(gives_way & r, way, x) for r, way, x in zip(rest, released, s, strict=True)]
        started = [gives_way & r & (way != 0.0) for r, way in zip(rest, released, strict=True)]
        # What stops, rests at once, with all that has no speed then; the law decides what stays.
        on = [r | (h & stops) for r, h in zip(rest, hit, strict=True)]
        drifts = any(not is_zero(gamma[c]) for c in island.rows)
        parts, first = drifts and island.shut, on
        if parts:
            # On one velocity what has just lost its speed says which others have lost theirs.
            first = [h | (r & ~stops) for h, r in zip(hit, on, strict=True)]
        slow = _slow(at, island, states, first)
        still = island.closed(on, held_contacts(at, island, states, slow))
        now = [where(stops & r, 0.0, x) for r, x in zip(still, now, strict=True)]
        touched = stops | gives_way
        if drifts:
            # Rest on a direction or surface that varies is held by accelerations: what their steps err
            # by is a speed, and one against the sense in which it gives way would stop it at once.
            still = [(gives_way & r) | (~gives_way & x) for r, x in zip(rest, still, strict=True)]
        if island.stops:
            touched = touched | any_of(met[c] for c in island.rows)
        if asked is not None:
            touched = touched | asked
        lands = touched if island.stops or drifts else stops
        for i, c in enumerate(island.rows[: island.contacts]):
            toggle = toggled.get(names.contacts[c])
            if toggle is not None:
                closes = where(slow[i], 0.0, jnp.sign(at.speeds[c]))
                now[i] = where(toggle, where(s[i] == 2.0, closes, 2.0), now[i])
                touched = touched | toggle
        passing = [where(stops & h & ~r, -x, 0.0) for h, r, x in zip(hit, rest, s, strict=True)]
        found, ended = _settled(machine, at, island, states, now, started, gamma, touched, passing)
        failed = failed | (touched & ~ended)
        if parts:
            # What a stop carries off keeps its velocity: that of a stop which has hardly begun to move
            # is rounding, and might be against the sense in which the others are left.
            left_behind = any_of(h & r for h, r in zip(hit, rest, strict=True))
            keeps = [left_behind & (c >= count) for c in island.rows]
            still = [x & (f == 0.0) & ~k for x, f, k in zip(still, found, keeps, strict=True)]
            q = placed(island, at, q, [r & touched for r in rest])
        elif island.varies:
            # What passes through rest keeps its velocity: where its direction vanishes, to be made to
            # rest would stop the mechanism.
            still = [
                x & (rested[c] | (f == 0.0)) for x, c, f in zip(still, island.rows, found, strict=True)
            ]
            # Nor is anything else made to rest then: it might send back what has just passed.
            passed = ((p != 0.0) & (f != 0.0) for p, f in zip(passing, found, strict=True))
            lands = lands & ~any_of(passed)
        for j, x in zip(island.columns, landed(island, at, still), strict=True):
            v[j] = where(lands, x, v[j])
        new = list(new)
        for c, x in zip(island.rows, found, strict=True):
            new[c] = where(touched, x, new[c])
    y = machine.from_coordinates(q, type(at.v)(*v))
    new = drifting(machine, t, y, at, new, args) if jumped else new
    return y, _mode(machine, new, failed)


def _carried(machine: "AbstractMechanism", at: Instant, states: list, gamma: list) -> list[Any]:
    """States of contacts whose surfaces may have jumped: what a surface has left behind slides."""
    states = list(states)
    for island in machine.islands:
        for i, c in enumerate(island.rows[: island.contacts]):
            if not is_zero(gamma[c]):
                near = slow_contacts(at, island, part=SLIDES)[i] & (states[c] == 0.0)
                moving = where(slow_contacts(at, island)[i] | near, 0.0, jnp.sign(at.speeds[c]))
                states[c] = where(states[c] == 2.0, 2.0, moving)
    return states


def _law_of(machine: "AbstractMechanism", t: Any, args: Any) -> Any:
    """The law of all contacts of an island, as a function of the instant, the island and its states."""

    def law(at: Instant, island: Island, given: list, active: Any) -> list[Any]:
        states: list[Any] = [2.0] * len(at.speeds)
        for c, s in zip(island.rows, given, strict=True):
            states[c] = s
        gamma = surface_accelerations(machine, t, at, args)
        none = [s == 9.0 for s in given]
        return _settled(machine, at, island, states, given, none, gamma, active)[0]

    return law


def _slow(at: Instant, island: Island, states: list, on: list) -> list[Any]:
    """Contacts without speed while those in `on` rest; of the stops only those that are closed."""
    if not island.stops:
        return slow_contacts(at, island)
    speeds = list(at.v)
    for j, x in zip(island.columns, landed(island, at, on), strict=True):
        speeds[j] = x
    still = [
        jnp.asarray(minus(dot(n, speeds), w)) for n, w in zip(at.directions, at.surfaces, strict=True)
    ]
    slow = slow_contacts(at._replace(speeds=still), island)
    return [
        x if c < len(at.contacts) else x & (states[c] == 0.0)
        for c, x in zip(island.rows, slow, strict=True)
    ]


def initial_mode(machine: "AbstractMechanism", t: Any, y: Any, args: Any) -> Any:
    """The mode of a state: contacts with a speed slide, the law of all contacts decides the others."""
    at = machine.instant(t, y, args)
    gamma = surface_accelerations(machine, t, at, args)
    states: Any = [jnp.sign(u) for u in at.speeds]
    failed = jnp.zeros((), bool)
    for k in range(len(at.stops)):
        met, beyond = touches(at, k)
        states[len(at.contacts) + k] = where(met, 0.0, 2.0)
        failed = failed | beyond
    for c in machine.lifting:
        failed = failed | (at.contacts[c].normal_force < 0.0)
    for name in machine.opening:
        c = machine.names.contacts.index(name)
        states[c] = where(_presses(machine, t, at, c, args), states[c], 2.0)
    for island in machine.islands:
        if not island.rows:
            continue
        slow = slow_contacts(at, island)
        if in_rows(machine, island):
            found, ended = IslandRows(machine, island, at, states, list(at.force)).begun(row(slow))
            failed = failed | ~ended
            states = with_rows(island, states, found)
            continue
        states = list(states)
        now = [
            where(x & (states[c] != 2.0), 0.0, states[c] if c < len(at.contacts) else 2.0)
            for x, c in zip(slow, island.rows, strict=True)
        ]
        if island.varies:
            for c, x in zip(island.rows, now, strict=True):
                states[c] = x
            states = begun(machine, t, y, at, states, args)
            now = [states[c] for c in island.rows]
        none = [jnp.zeros_like(x) for x in slow]
        found, ended = _settled(machine, at, island, states, now, none, gamma, ~none[0])
        failed = failed | ~ended
        for c, x in zip(island.rows, found, strict=True):
            states[c] = x
    return _mode(machine, drifting(machine, t, y, at, states, args), failed)


def _mode(machine: "AbstractMechanism", states: Any, failed: Any) -> Any:
    mode = machine.mode_of(states)
    return where(failed, jnp.asarray(NO_MODE, mode.dtype), mode)


def _presses(machine: "AbstractMechanism", t: Any, at: Instant, c: int, args: Any) -> Any:
    """Whether contact `c` presses now, or in an instant."""
    now, rate = _load(machine, t, at, c, args)
    return (now > 0.0) | ((now == 0.0) & (rate > 0.0))


def _load(machine: "AbstractMechanism", t: Any, at: Instant, c: int, args: Any) -> tuple[Any, Any]:
    """Normal force of contact `c`, and its rate by time and coordinates."""

    def load(t, q):
        now = touching(machine, t, q, at.v, args)[0][c]
        return jnp.asarray(now.normal_force, jnp.float64) + 0.0 * t

    t = jnp.asarray(t, jnp.float64)
    return jax.jvp(load, (t, floats(at.q)), (jnp.ones_like(t), floats(at.q_rate)))


def _settled(
    machine: "AbstractMechanism",
    at: Instant,
    island: Island,
    states: list,
    now: list,
    started: list,
    gamma: list,
    active: Any,
    passing: list | None = None,
) -> tuple[list[Any], Any]:
    """The law of all contacts of an island whose states are `now`, if `active`."""
    standing = [(s == 0.0) | b for s, b in zip(now, started, strict=True)]
    without, given = [jnp.zeros_like(active)] * len(states), list(states)
    for c, stands, s in zip(island.rows, standing, now, strict=True):
        without[c], given[c] = stands, s
    force = loaded(machine, at, given, without, lone=False)
    return settled(
        island,
        at.mass.of(island.columns),
        [force[j] for j in island.columns],
        rows_of(island, at),
        [gamma[c] for c in island.rows],
        limits_of(island, at, "static_coefficient"),
        limits_of(island, at, "kinetic_limit"),
        now,
        started,
        active,
        passing,
    )
