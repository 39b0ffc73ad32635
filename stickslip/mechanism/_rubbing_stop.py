"""A stop with friction: a contact that is pressed by what a stop bears, and open while it is open."""

from typing import Any

import jax.numpy as jnp

from stickslip._fastmath import where
from stickslip._validation import refusal

from ._group import AbstractContactGroup, Change, Fired, Guards, Release
from ._independent import SeparateContacts
from ._instant import Instant
from ._local import LocalInstant, Part
from ._motion import Motion
from ._scalars import Mass


class RubbingStop(AbstractContactGroup):
    r"""A stop on one coordinate, and a contact on another with the normal force of the stop.

    $$0 \le g \perp N \ge 0, \qquad -\lambda \in \mu(u)\,N + d(u) \quad (g = 0)$$

    The impact is Newton's, and without friction: it changes the velocity along the stop alone, however
    large its impulse. Friction begins once the stop is closed. Since the inertia does not couple the
    two coordinates, friction does not change the force of the stop.
    """

    separate = True

    def __init__(self, part: Part):
        super().__init__(part)
        if (
            self.m != 2
            or self.n != 2
            or part.varies
            or (part.directions != 0.0).sum() != 2
            or part.joined
        ):
            allowed = (
                "a contact and a stop of constant directions on a coordinate each, which neither "
                "inertia nor others join"
            )
            raise refusal("rubbing", f"{self.m} contacts and stops of one group", allowed)
        J = part.directions
        self.places = tuple(int(abs(row).argmax()) for row in J)

        def one(row: int, stops: int, opening: tuple[int, ...]) -> SeparateContacts:
            i = self.places[row]
            alone = J[row : row + 1, i : i + 1]
            return SeparateContacts(
                Part((part.columns[i],), (part.rows[row],), alone, None, stops, opening,
                     two_sided=part.two_sided)
            )  # fmt: skip

        self.contact, self.stop = one(0, 0, (self.rows[0],)), one(1, 1, ())

    @classmethod
    def takes(cls, part: Part) -> bool:
        return bool(part.rubbing)

    def motion(self, M: Mass, F: Any, J: list[list], rest: Any, gamma: list) -> Motion:
        found, force = [None, None], []
        for row, (group, i) in enumerate(zip((self.contact, self.stop), self.places, strict=True)):
            mass, line = M.of((i,)), [[J[row][i]]]
            one = group.motion(mass, (F[i],), line, (rest[row],), [gamma[row]])
            found[i], force = one.acceleration[0], [*force, one.force[0]]
        return Motion(tuple(found), (), tuple(force))

    def of_stop(self, here: LocalInstant, at: Instant | None = None) -> LocalInstant:
        return here.of(self.stop.part, here.at if at is None else at)

    def of_contact(self, here: LocalInstant, states: Any) -> LocalInstant:
        """The contact, pressed by what the stop bears in the mode of these states."""
        return here.of(self.contact.part, self.instant_under_load(here, states))

    def instant_under_load(self, here: LocalInstant, states: Any) -> Instant:
        ((c, k), (force,)) = self.rows, self.stop.motion_in(self.of_stop(here), states).force
        load = where((states[k] == 0.0) & (force > 0.0), force, 0.0)
        contacts = list(here.at.contacts)
        contacts[c] = contacts[c]._replace(normal_force=load)
        return here.at._replace(contacts=contacts)

    def motion_in(self, here: LocalInstant, states: Any, needed: bool = False) -> Motion:
        contact = self.contact.motion_in(self.of_contact(here, states), states, needed)
        stop = self.stop.motion_in(self.of_stop(here), states, needed)
        a = [contact.acceleration[0], stop.acceleration[0]]
        a = a if self.places == (0, 1) else a[::-1]
        return Motion(tuple(a), (), (contact.force[0], stop.force[0]))

    def slip_forces(self, here: LocalInstant, states: Any) -> Any:
        return (*self.contact.slip_forces(self.of_contact(here, states), states), 0.0)

    def guards(self, here: LocalInstant, states: Any) -> Guards:
        contact = self.contact.guards(self.of_contact(here, states), states)
        stop = self.stop.guards(self.of_stop(here), states)
        closed = states[self.rows[0]] != 2.0
        ahead = {c: where(closed, x, 1.0) for c, x in contact.ahead.items()}
        return Guards((where(closed, contact.own[0], 1.0), stop.own[0]), ahead)

    def release(self, here: LocalInstant, states: Any, hit: Any, fired: Fired) -> Release:
        contact = self.contact.release(self.of_contact(here, states), states, hit[:1], fired)
        stop = self.stop.release(self.of_stop(here), states, hit[1:], fired)
        ways = (*contact.ways, *stop.ways)
        return Release(ways, contact.gives_way | stop.gives_way, contact.stops | stop.stops)

    def transition(self, here: LocalInstant, states: Any, fired: Fired) -> Change:
        (c, k), stop = self.rows, self.stop.transition(self.of_stop(here), states, fired)
        after = self.stop.with_own(states, stop.states)
        # The contact closes and opens with the stop.
        toggles = (states[c] == 2.0) == (after[k] == 0.0)
        fired = fired._replace(toggled={**fired.toggled, c: toggles})
        contact = self.contact.transition(self.of_contact(here, after), after, fired)
        v = (contact.velocities[0], stop.velocities[0])
        v = v if self.places == (0, 1) else v[::-1]
        return Change(v, (*contact.states, *stop.states), {}, contact.failed | stop.failed)

    def at_start(self, here: LocalInstant, states: Any) -> Any:
        contact, stop = super().at_start(here, states)
        return (where(stop == 0.0, contact, 2.0), stop)

    def states_after(self, here, states, own, started, active, passing=None):
        states = self.with_own(states, own)
        stop, ended = self.stop.states_after(self.of_stop(here), states, own[1:], started[1:], active)
        after = self.stop.with_own(states, stop)
        contact, also = self.contact.states_after(
            self.of_contact(here, after), after, own[:1], started[:1], active
        )
        return (where(stop[0] == 0.0, contact[0], 2.0), *stop), ended & also

    def normal_forces(self, here: LocalInstant, states: Any) -> dict[int, Any]:
        c = self.rows[0]
        return {
            c: jnp.asarray(self.instant_under_load(here, states).contacts[c].normal_force, jnp.float64)
        }
