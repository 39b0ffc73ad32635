"""Contacts and stops whose directions vary: they may vanish, and depend on each other."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where

from ._accuracy import ACCURACY
from ._independent import AbstractIndependentContacts, states_one_by_one
from ._laws import NO_LIMIT
from ._local import Part
from ._motion import Motion, motion_by_forces, resisting
from ._rows import NumberRow, each
from ._scalars import Mass, dot, minus, over, times, total
from ._search import Problem, senses_of, states_by_search


class VaryingContacts(AbstractIndependentContacts):
    """Contacts of which at least one has a direction that varies, in general position."""

    def __init__(self, part: Part):
        super().__init__(part)
        self.separate = self.m == 1

    @classmethod
    def takes(cls, part: Part) -> bool:
        return part.in_general_position

    def motion(self, M: Mass, F: Any, J: list[list], rest: NumberRow, gamma: list) -> Motion:
        if (self.m, self.n) != (1, 1):
            return motion_by_forces(self.part, M, F, J, rest, rest, gamma)
        (m,), n = M.diagonal or (M.full or [[None]])[0], J[0][0]
        free = F[0] / m
        needed = minus(gamma[0], times(n, free)) / resisting(times(n, n) / m)
        needed = where(rest[0], needed, 0.0)
        a = where(self.decides(rest[0], n), times(over(n), gamma[0]), free)
        return Motion((a,), (times(n, needed),), (needed,))

    def decides(self, rests: Any, n: Any) -> Any:
        return rests & (n != 0.0)

    def nearest_velocities(self, here, still, kept=None):
        if (self.m, self.n) == (1, 1):
            return here.velocities
        return super().nearest_velocities(here, still, kept)

    def passing(self, own, hit, stops):
        return passing_through(own, hit, stops)

    def landing(self, here, still, found, landing, fired):
        return contacts_at_rest(self.rows, still, found, fired.rested), landing.lands, {}

    least_acceleration = -1.0

    def ending(self, problem, states, acceleration, slow):
        return ends_at_rest(problem, states, acceleration, slow)

    def law(self, problem):
        problem = with_loose(self.part, problem)
        return states_one_by_one(problem) if self.separate else states_by_search(self, problem)


def passing_through(own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow:
    """The sense beyond its zero of a contact whose speed has just passed through it, else 0."""
    return each(lambda h, s: where(stops & h & (s != 0.0), -s, 0.0), hit, own)


def contacts_at_rest(
    rows: tuple[int, ...], still: NumberRow, found: NumberRow, rested: list
) -> NumberRow:
    """Contacts in `still` that were at rest, or are.

    A contact that passes through rest keeps its velocity: where its direction vanishes, to be made to
    rest would stop the mechanism.
    """
    return tuple(x & (rested[c] | (f == 0.0)) for x, c, f in zip(still, rows, found, strict=True))


def ends_at_rest(problem: Problem, states: NumberRow, acceleration: NumberRow, slow: Any) -> NumberRow:
    """States at the end of a search, where what does not accelerate rests.

    Directions that vary may coincide: beside one that rests the other bears all that it can, without an
    acceleration. It stops only where it would go back, and is at rest where the search ends.
    """
    moves = (jnp.abs(x) for x in senses_of(problem, acceleration, slow))
    return each(lambda on, s, x: where(on, s * x, s), problem.standing, states, tuple(moves))


def with_loose(part: Part, problem: Problem) -> Problem:
    """The problem without the contacts that slide whatever the others bear: their friction is a load.

    As a direction vanishes, what a contact would have to bear at rest grows without bound. Among the
    forces of the others such a number would be the measure of what is rounding.
    """
    problem = problem.without_slopes()
    senses, force, limits = _loose_senses(part, problem), problem.force, problem.kinetic
    for line, low, high, sense in zip(problem.lines, limits.lower, limits.high, senses, strict=True):
        if high is not NO_LIMIT:
            friction = where(sense > 0.0, low, where(sense < 0.0, high, 0.0))
            force = tuple(total((f, times(n, friction))) for f, n in zip(force, line, strict=True))
    return problem._replace(
        force=force,
        states=each(lambda s, sense: where(sense == 0.0, s, sense), problem.states, senses),
        started=each(lambda start, sense: start & (sense == 0.0), problem.started, senses),
    )


def _loose_senses(part: Part, problem: Problem) -> NumberRow:
    standing, passing = problem.standing, problem.passing
    M, J, static, found = problem.mass, problem.lines, problem.static, []
    free, mobility = M.solve(problem.force), [M.solve(row) for row in J]
    for c, (line, g, stands) in enumerate(zip(J, problem.gamma, standing, strict=True)):
        if not np.isnan(part.directions[c]).any() or c >= part.contacts:
            found.append(jnp.zeros_like(jnp.asarray(free[0], jnp.float64)))
            continue
        most: Any = 0.0
        for d, (p, low, high) in enumerate(zip(mobility, static.lower, static.high, strict=True)):
            share = jnp.abs(jnp.asarray(dot(p, line)))
            bound = share * jnp.maximum(-low, high if high is not NO_LIMIT else 0.0)
            if high is NO_LIMIT:
                bound = where(share > 0.0, NO_LIMIT, 0.0)
            most = most + where(standing[d], bound, 0.0)
        drive = minus(dot(line, free), g)
        sense = jnp.sign(drive)
        if passing is not None:
            # The rest of direction and speed may be rounding.
            sense = where(passing[c] == 0.0, sense, passing[c])
        found.append(where(stands & (jnp.abs(drive) > ACCURACY.clearly * most), sense, 0.0))
    return tuple(found)
