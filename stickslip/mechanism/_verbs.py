"""The verbs of a mechanism, group by group: it moves, its guards fire, its mode changes, it starts."""

from typing import Any

import jax.numpy as jnp

from stickslip._fastmath import where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._ahead import loosened_ahead, sliding_ahead
from ._contact import drags
from ._group import Fired
from ._impacts import impact, touches
from ._laws import drives
from ._moment import Moment
from ._scalars import any_of, is_zero


def accelerations(now: Moment, states: Any) -> list[Any]:
    """Rates of all velocities in the mode of these states."""
    a: list[Any] = [None] * len(now.at.force)
    for group in now.structure.groups:
        found = group.motion_in(now.of(group), states, needed=True).acceleration
        for j, x in zip(group.columns, found, strict=True):
            a[j] = jnp.asarray(x, jnp.float64)
    return a


def held_state(now: Moment, states: Any) -> tuple[Any, Any] | None:
    """Coordinates and velocities at which what rests on a surface that moves or turns is there, and has
    its speed, nearest by the inertia; None where there is no such surface."""
    q, v, drifts = list(now.at.q), list(now.at.v), False
    for group in now.structure.contact_groups:
        here = now.of(group)
        if not here.drifts:
            continue
        drifts, still = True, group.still_in(group.own_states(states))
        for j, x in zip(group.columns, group.at_rest(here, still), strict=True):
            v[j] = x
        if group.stops:
            for j, x in zip(group.columns, group.to_closed(here, still), strict=True):
                q[j] = None if q[j] is None else q[j] + x  # a cyclic coordinate has no place
    return (type(now.at.q)(*q), type(now.at.v)(*v)) if drifts else None


def held_forces(now: Moment, states: Any) -> list[Any]:
    """Force in each contact and each stop if it is at rest [N]."""
    held: list[Any] = [0.0] * len(states)
    for group in now.structure.contact_groups:
        here, rest = now.of(group), [states[c] == 0.0 for c in group.rows]
        load = tuple(group.load(here, states, needed=True))
        motion = group.motion(here.mass, load, here.lines, tuple(rest), here.gamma)
        for c, borne in zip(group.rows, motion.force, strict=True):
            held[c] = borne
    return held


def slip_forces(now: Moment, states: Any) -> list[Any]:
    """Friction of each contact if it slides [N]; 0 of one that is open, and of the stops."""
    found: list[Any] = [0.0] * len(states)
    for group in now.structure.contact_groups:
        for c, force in zip(group.rows, group.slip_forces(now.of(group), states), strict=True):
            found[c] = force
    return found


def normal_forces(now: Moment, states: Any) -> dict[int, Any]:
    """Normal forces that follow from the motion, by contact [N]."""
    found: dict[int, Any] = {}
    for group in now.structure.contact_groups:
        found.update(group.normal_forces(now.of(group), states))
    return found


def guards(now: Moment, states: Any) -> tuple:
    """Values of all guards, in the order of their names."""
    numbers, contacts = now.structure.guards, now.at.contacts
    found: list[Any] = [None] * numbers.many
    for group in now.structure.contact_groups:
        values = group.guards(now.of(group), states)
        for c, value in zip(group.rows, values.own, strict=True):
            found[numbers.stops[c] if c in numbers.stops else c] = value
        for c, value in values.ahead.items():
            found[numbers.own[c][1]] = value
        for value in values.joint:
            found[numbers.joint[group.rows[0]]] = value
    for c, number in numbers.opens.items():
        found[number] = where(states[c] == 2.0, -contacts[c].normal_force, _closed_load(now, c))
        found[c] = where(states[c] == 2.0, 1.0, found[c])
    for c, number in numbers.lifts.items():
        found[number] = contacts[c].normal_force
    return tuple(jnp.asarray(x, jnp.float64) for x in found)


def _closed_load(now: Moment, c: int) -> Any:
    """The normal force of a contact that is closed, as a guard."""
    contact = now.at.contacts[c]
    if not drags(contact.law):
        return contact.normal_force
    # A normal force that stays at 0 crosses nothing, but drag would go on without it.
    load, rate = now.load(c)
    drag = jnp.abs(contact.law.drag(now.at.speeds[c]))
    return where((load == 0.0) & (rate == 0.0), -drag, contact.normal_force)


def transition(now: Moment, states: Any, guard: Any, others: bool) -> tuple[Any, Any, Any, Any]:
    """Coordinates, velocities and states right after guard number `guard`, and whether none is allowed.

    `others`: whether there are guards after all these, which ask the law of all contacts again; so does
    the constant -1: a load has jumped.
    """
    numbers, jumped = now.structure.guards, isinstance(guard, int) and guard < 0
    guard = jnp.asarray(guard)
    rested = [s == 0.0 for s in states]
    toggled = {c: guard == number for c, number in numbers.opens.items()}
    asked = guard < 0 if jumped else guard >= numbers.many if others else None
    # A contact that cannot open has lost its normal force.
    failed = any_of([guard < guard, *(guard == number for number in numbers.lifts.values())])
    left = met = [failed & False] * len(states)
    if jumped:
        states = sliding_ahead(now, _states_after_jump(now, states), accelerations)
        for c in toggled:
            load, off = now.at.contacts[c].normal_force, states[c] == 2.0
            toggled[c] = (off & (load > 0.0)) | (~off & (load < 0.0))
    elif numbers.stops:
        left = [
            (guard == numbers.stops[c]) & (s == 0.0) if c in numbers.stops else failed & False
            for c, s in enumerate(states)
        ]
        now, states, met, jammed = impact(now, states, guard)
        failed = failed | jammed
    fired = Fired(guard, numbers.own, numbers.joint, left, met, toggled, asked, rested)
    q, v, new = list(now.at.q), [jnp.asarray(x, jnp.float64) for x in now.at.v], states
    for group in now.structure.contact_groups:
        change = group.transition(now.of(group), states, fired)
        for j, x in zip(group.columns, change.velocities, strict=True):
            v[j] = x
        for j, x in change.places.items():
            q[j] = x
        new = group.with_own(new, change.states)
        failed = failed | change.failed
    q, v = type(now.at.q)(*q), type(now.at.v)(*v)
    new = loosened_ahead(now.moved_to(q, v), new, accelerations) if jumped else new
    return q, v, new, failed


def _states_after_jump(now: Moment, states: Any) -> list[Any]:
    """States of contacts whose surfaces may have jumped: what a surface has left behind slides."""
    states = list(states)
    for group in now.structure.contact_groups:
        here = now.of(group)
        for i, c in enumerate(group.rows[: group.contacts]):
            if not is_zero(here.gamma[i]):
                near = here.slow(part=ENGINE.same)[i] & (states[c] == 0.0)
                moving = where(here.slow()[i] | near, 0.0, jnp.sign(now.at.speeds[c]))
                states[c] = where(states[c] == 2.0, 2.0, moving)
    return states


def initial_states(now: Moment) -> tuple[Any, Any]:
    """States of all contacts and stops at the start, and whether none is allowed.

    Contacts with a speed slide, the law of all contacts decides the others.
    """
    at, structure = now.at, now.structure
    states: Any = [jnp.sign(u) for u in at.speeds]
    failed = drives(at.contacts, at.speeds)
    for k in range(len(at.stops)):
        met, beyond = touches(at, k)
        states[len(at.contacts) + k] = where(met, 0.0, 2.0)
        failed = failed | beyond
    for c in structure.lifting:
        failed = failed | (at.contacts[c].normal_force < 0.0)
    for c in structure.opening:
        load, rate = now.load(c)
        presses = (load > 0.0) | ((load == 0.0) & (rate > 0.0))
        states[c] = where(presses, states[c], 2.0)
    for group in structure.contact_groups:
        states = group.with_own(states, group.at_start(now.of(group), states))
    states = sliding_ahead(now, states, accelerations)
    for group in structure.contact_groups:
        own, active = group.own_states(states), jnp.ones((), bool)
        none = group.row([jnp.zeros((), bool)] * group.m)
        found, ended = group.states_after(now.of(group), states, own, none, active)
        states = group.with_own(states, found)
        failed = failed | ~ended
    return loosened_ahead(now, states, accelerations), failed
