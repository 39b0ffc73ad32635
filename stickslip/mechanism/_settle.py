"""Which contacts of an island begin to slide, and in which sense: their law at one instant."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip._fastmath import where

from ._island import Island
from ._reserve import NO_LIMIT, least_reserve, stops_alone
from ._rows import row
from ._scalars import Mass, any_of, dot, is_zero, minus, over, times, total, without_slope
from ._settle_together import MOST_PIVOTS, PATIENCE, SLACK, settled_together, without_drop
from ._together import Bounds, motion_in_rows

CLEARLY = 2.0  # a drive beyond this part of all that can be borne leaves no question


class Limits(NamedTuple):
    """Friction that each contact can bear [N], from `low` <= 0 to `high` >= 0; a stop bears any
    force off it, from 0 to the constant `NO_LIMIT`."""

    low: list[Any]
    high: list[Any]


class _Search(NamedTuple):
    states: list[Any]  # the face of the search: 0 at rest, else the sense
    given: list[Any]  # senses that the friction of contacts without speed belongs to
    acceleration: list[Any]
    pivots: Any
    settled: Any
    still: Any  # overloads below it are rounding [N]


def settled(
    island: Island,
    M: Mass,
    F: list,
    J: list[list],
    gamma: list,
    static: Limits,
    kinetic: Limits,
    states: list,
    started: list,
    active: Any,
    passing: list | None = None,
) -> tuple[list[Any], Any]:
    r"""States of all contacts an instant later: those without speed by the law of all contacts.

    $$a = \arg\min \tfrac12 a^T M a - a^T F
      + \sum_{c\ \text{without speed}} \phi_c(n_c\cdot a - \gamma_c)$$

    For a contact at rest $\phi_c$ is its static friction times the relative acceleration. What begins
    to slide is under kinetic friction from then on: kinetic ahead, static behind. That may make others
    slide, or send one back that had only just begun. So the law is asked again, as time stepping with
    steps of no length would, until the senses stay.

    The minimum is found by the primal active-set method on the faces of the arrangement of the planes
    $n_c\cdot a = \gamma_c$: go to the minimum of the face, or to the first contact that stops on the
    way and rest it; at the minimum release what is overloaded most. The function falls from face to
    face, so none returns.

    **Arguments:** inertia, forces without the friction of contacts without speed, directions, relative
    accelerations of the surfaces; the limits of friction; `states`, 0 for every contact at rest;
    `started`, which contacts with a sense have no speed yet; `active`, whether the answer is wanted;
    `passing`, the sense beyond its zero of a contact whose speed has just passed through it, else 0.

    A stop is a contact that begins to move off with the sense 1, and bears nothing then.

    **Returns** the states and whether the search ended.
    """
    F, gamma, J, static, kinetic, states = without_slope((F, gamma, J, static, kinetic, states))
    M = Mass(without_slope(M.diagonal), without_slope(M.full))
    standing = [(s == 0.0) | start for s, start in zip(states, started, strict=True)]
    if island.varies:
        loose = _unheld(island, M, F, J, gamma, static, standing, passing)
        standing = [stands & (sense == 0.0) for stands, sense in zip(standing, loose, strict=True)]
        states = [where(sense == 0.0, s, sense) for s, sense in zip(states, loose, strict=True)]
        for line, low, high, sense in zip(J, kinetic.low, kinetic.high, loose, strict=True):
            if high is not NO_LIMIT:
                friction = where(sense > 0.0, low, where(sense < 0.0, high, 0.0))
                F = [total((f, times(n, friction))) for f, n in zip(F, line, strict=True)]
    if island.shut and island.stops == island.m:
        return stops_alone(island, M, F, J, gamma, states, standing), jnp.ones_like(standing[0])
    if island.separate:
        # The law of each contact and stop: what it bears at rest decides.
        every = [jnp.ones_like(x) for x in standing]
        after = []
        for c, borne in enumerate(island.motion(M, F, J, every, gamma).force):
            leaves = where(borne < static.low[c], 1.0, 0.0)
            if static.high[c] is not NO_LIMIT:
                leaves = where(borne > static.high[c], -1.0, leaves)
            after.append(where(states[c] == 0.0, leaves, states[c]))
        return after, every[0]
    if island.dependent and not island.stops:
        found, ended = settled_together(
            island, M, motion_in_rows, row(F),
            Bounds(row(static.low), row(static.high)), Bounds(row(kinetic.low), row(kinetic.high)),
            row(states), row(started), active,
        )  # fmt: skip
        return list(found), ended
    levers = _levers(island, J, standing)
    felt = _inertia(M, levers)
    inertia, least = total(felt), functools.reduce(jnp.minimum, map(jnp.asarray, felt))
    # Of what accelerated surfaces carry only the lightest counts: a heavy part has no say over it.
    size = _size(F, levers, static, [times(least, g) for g in gamma])
    zero = jnp.zeros_like(size)
    # At its limit without a drop of friction a contact begins with no acceleration, but it begins.
    creeping = []
    for c, (start, s) in enumerate(zip(started, states, strict=True)):
        ahead = without_drop(static.low[c], kinetic.low[c])
        behind = without_drop(static.high[c], kinetic.high[c])
        creeping.append(start & (((s > 0.0) & ahead) | ((s <= 0.0) & behind)))

    # What has no speed may be parted at once: on each surface the one velocity changes differently.
    parts = island.shut and not all(map(is_zero, gamma))

    def beside(acceleration: list, slow: Any) -> list[Any]:
        slips = (minus(dot(n, acceleration), g) for n, g in zip(J, gamma, strict=True))
        found = [where(jnp.abs(x) <= slow, 0.0, jnp.sign(x)) for x in map(jnp.asarray, slips)]
        return [*found[: island.contacts], *(jnp.maximum(x, 0.0) for x in found[island.contacts :])]

    # Directions that vary may coincide: beside one that rests the other bears all that it can, without
    # an acceleration. It stops only where it would go back, and is at rest where the search ends.
    least_speed_up = -1.0 if island.varies else 1.0

    def held(states: list, acceleration: list, slow: Any) -> list[Any]:
        if not island.varies:
            return states
        ways = [jnp.abs(x) for x in beside(acceleration, slow)]
        return [where(on, s * x, s) for on, s, x in zip(standing, states, ways, strict=True)]

    def pivot(now: _Search) -> _Search:
        slow = 0.1 * now.still / inertia  # slower than what an overload of this size brings about
        low, high, load = [], [], list(F)
        for c, (s, given, stands) in enumerate(zip(now.states, now.given, standing, strict=True)):
            least = where(given > 0.0, kinetic.low[c], static.low[c])
            most = where(given < 0.0, kinetic.high[c], static.high[c])
            # The middle of the interval is a force, so that what is left to bear lies around 0.
            middle = 0.0 if static.high[c] is NO_LIMIT else 0.5 * (least + most)
            low.append(least - middle)
            high.append(most - middle)
            friction = where(stands, where(s > 0.0, least, where(s < 0.0, most, middle)), 0.0)
            load = [total((f, times(j, friction))) for f, j in zip(load, J[c], strict=True)]
        rest = [s == 0.0 for s in now.states]
        found = island.motion(M, load, J, rest, gamma)
        share, first = jnp.full_like(size, 2.0), jnp.full_like(now.pivots, -1)
        for c, s in enumerate(now.states):
            before = jnp.maximum(s * minus(dot(J[c], now.acceleration), gamma[c]), 0.0)
            after = s * minus(dot(J[c], found.acceleration), gamma[c])
            stops = standing[c] & ~rest[c] & (after < least_speed_up * slow)
            path = where(stops, before / (before - after + 2.0 * slow), 2.0)
            sooner = path < share
            share, first = where(sooner, path, share), where(sooner, jnp.int32(c), first)
        blocked, part = first >= 0, jnp.clip(share, 0.0, 1.0)
        reached = [
            where(blocked, a + part * (b - a), b)
            for a, b in zip(now.acceleration, found.acceleration, strict=True)
        ]
        # Of dependent contacts those that have no speed and would have none by the others' rest.
        along = standing
        if parts:
            slips = beside(reached, slow)
            along = [stands & (s == 0.0) for stands, s in zip(standing, slips, strict=True)]
        stopped = island.closed([r | (first == c) for c, r in enumerate(rest)], along)
        if island.stops:
            reserve, released = least_reserve(island, low, high, J, rest, found)
            overloaded = ~blocked & (reserve < -now.still)
        else:
            used, released = island.onset(low, high, rest, found, slack=now.still)
            overloaded = ~blocked & (used > 1.0)
        states_now = [
            where(blocked & r, 0.0, where(overloaded & (s == 0.0), way, s))
            for r, way, s in zip(stopped, released, now.states, strict=True)
        ]
        minimum = ~blocked & ~overloaded
        ends = [
            where(creeps & (s == 0.0), old, s)
            for creeps, old, s in zip(creeping, states, held(now.states, reached, slow), strict=True)
        ]
        changed = any_of(s != given for s, given in zip(ends, now.given, strict=True))
        again, done = minimum & changed, minimum & ~changed
        # The next search begins at rest: started on the face found, all its speeds zero, it could
        # stop and release the same contacts for ever.
        states_now = [
            where(again & stands, begin, where(done, end, s))
            for stands, begin, end, s in zip(standing, face, ends, states_now, strict=True)
        ]
        given = [where(again, end, g) for end, g in zip(ends, now.given, strict=True)]
        reached = [where(again, start, a) for start, a in zip(origin, reached, strict=True)]
        # A tie within rounding of an ill-conditioned inertia may send a contact to and fro.
        tired = (now.pivots % PATIENCE) == PATIENCE - 1
        still = where(tired, 10.0 * now.still, now.still)
        return _Search(states_now, given, reached, now.pivots + 1, done, still)

    origin = [zero] * island.n
    if not all(map(is_zero, gamma)):
        origin = island.motion(M, origin, J, standing, gamma).acceleration
    begun: list[Any] = [0.0] * island.m
    if parts:
        for c in range(island.contacts, island.m):
            # Nothing goes through a stop: of several the one that is ahead decides.
            least = times(over(J[c][0]), gamma[c])
            behind = standing[c] & (minus(times(J[c][0], origin[0]), gamma[c]) < 0.0)
            origin = [where(behind, least, origin[0])]
        begun = beside(origin, 0.1 * SLACK * size / inertia)
    face = [where(stands, x, s) for stands, x, s in zip(standing, begun, states, strict=True)]
    given = [jnp.asarray(s) for s in states]
    start = _Search(face, given, origin, jnp.zeros_like(size, jnp.int32), ~active, SLACK * size)
    end = lax.while_loop(
        lambda now: ~now.settled & (now.pivots < MOST_PIVOTS), pivot, jax.tree.map(jnp.asarray, start)
    )
    return list(end.states), end.settled


def _unheld(
    island: Island, M: Mass, F: list, J: list[list], gamma: list, static: Limits, standing: list,
    passing: list | None,
) -> list[Any]:  # fmt: skip
    """Senses of the contacts in `standing` that slide whatever the others bear; 0 of all others.

    As a direction vanishes, what a contact would have to bear at rest grows without bound. Among the
    forces of the others such a number would be the measure of what is rounding.
    """
    free, mobility, found = M.solve(F), [M.solve(row) for row in J], []
    for c, (line, g, stands) in enumerate(zip(J, gamma, standing, strict=True)):
        if not np.isnan(island.directions[c]).any() or c >= island.contacts:
            found.append(jnp.zeros_like(static.low[c]))
            continue
        most: Any = 0.0
        for d, (p, low, high) in enumerate(zip(mobility, static.low, static.high, strict=True)):
            share = jnp.abs(jnp.asarray(dot(p, line)))
            bound = share * jnp.maximum(-low, high if high is not NO_LIMIT else 0.0)
            if high is NO_LIMIT:
                bound = where(share > 0.0, NO_LIMIT, 0.0)
            most = most + where(standing[d], bound, 0.0)
        drive = minus(dot(line, free), g)
        sense = jnp.sign(drive)
        if passing is not None:
            # What is left of direction and speed may be rounding.
            sense = where(passing[c] == 0.0, sense, passing[c])
        found.append(where(stands & (jnp.abs(drive) > CLEARLY * most), sense, 0.0))
    return found


def _levers(island: Island, J: list[list], standing: list) -> list[Any]:
    """Contact speed per unit of each velocity: coordinates may have different units."""
    levers: list[Any] = []
    for j in range(island.n):
        largest: Any = 0.0
        for line, stands in zip(J, standing, strict=True):
            if not is_zero(line[j]):
                size = abs(line[j]) if isinstance(line[j], float) else jnp.abs(line[j])
                size = where(stands, size, 0.0) if island.varies else size
                largest = size if is_zero(largest) else jnp.maximum(largest, size)
        levers.append(largest)
    return levers


def _size(F: list, levers: list, static: Limits, carried: list) -> Any:
    """All forces at the contacts together [N], `carried` by accelerated surfaces among them."""
    limits = zip(static.low, static.high, strict=True)
    borne = [jnp.abs(high - low) for low, high in limits if high is not NO_LIMIT]
    loads = [jnp.abs(f) * over(x) for f, x in zip(F, levers, strict=True) if not is_zero(x)]
    return total((*borne, *loads, *(jnp.abs(x) for x in carried if not is_zero(x)))) + 1e-300


def _inertia(M: Mass, levers: list) -> list[Any]:
    """Inertia that contacts feel [kg], by the velocities that they touch."""
    diagonal = M.diagonal or [line[i] for i, line in enumerate(M.full or [])]
    parts = ((m, over(x)) for m, x in zip(diagonal, levers, strict=True) if not is_zero(x))
    return [times(m, times(x, x)) for m, x in parts]
