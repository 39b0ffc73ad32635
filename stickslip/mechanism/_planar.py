"""Friction in a plane: two contacts that bear together what lies in an ellipse."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from stickslip._fastmath import SMOOTH, where
from stickslip._validation import DeclarationError, check_positive, refusal
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._accuracy import ACCURACY
from ._group import AbstractContactGroup, Change, Fired, Guards, Release
from ._independent import CoupledContacts
from ._local import LocalInstant, Part
from ._motion import Motion
from ._rows import NumberRow
from ._varying import VaryingContacts

Pair = tuple[Any, Any]


class Slide(NamedTuple):
    """A planar contact that slides.

    - `speed` [m/s]; `limits` of the friction along each axis [N]; `toward`: the part of each that acts,
      against it, a unit vector;
    - `load` that the contact would bear at rest, in parts of the limits; `friction` [N].
    """

    speed: Any
    limits: Pair
    toward: Pair
    load: Pair
    friction: Pair


class PlanarContact(AbstractContactGroup):
    r"""Two contacts that are the axes of one contact in a plane.

    With the sliding velocity $u = (u_1, u_2)$, its size $s$ and the limits $R_i = \mu_i N$ friction is
    that of the greatest dissipation (Moreau):

    $$s = 0:\ \Bigl(\frac{\lambda_1}{R_1}\Bigr)^2 + \Bigl(\frac{\lambda_2}{R_2}\Bigr)^2 \le 1, \qquad
      s > 0:\ \lambda_i = -\frac{R_i(s)^2 u_i}{\sqrt{(R_1 u_1)^2 + (R_2 u_2)^2}} - d_i(s)\frac{u_i}{s}$$

    For one law it is a disc, and friction is opposite to the velocity. The states of both are (0, 0) at
    rest, (1, 1) as they slide, (1, 0) at the end of a slide, (2, 2) where they are open.

    **The end of a slide.** As $s \to 0$ the direction settles like a power of the time $T$ that is
    left, which no step resolves. Slower than the speed of rest $s_0$ the load $m = F/R$ in parts of the
    limit and the deceleration $A$ by friction are held. Then, for a disc without coupling,

    $$T = \frac{s\,(1 + m\cdot e)}{A\,(1 - m^2)}, \qquad \Delta = \frac{s^2}{A}\Bigl[
      \frac{2 + g}{4 - m^2}\,e + \frac{4 - m^2 + 6g + 3g^2}{4(1 - m^2)(4 - m^2)}\,m\Bigr],
      \quad g = m\cdot e$$

    are exact (combinations of $s^2$, $s^2 g$, $s^2 g^2$ whose rates are the velocity). The contact is
    moved by $\Delta$ and stops after $T$, meanwhile on a straight line. Up to there the error of the
    steps shortens them in proportion to the time that is left: some sixty for a slide.

    ??? cite "Reference"

        J. J. Moreau, *Unilateral contact and dry friction in finite freedom dynamics*, in
        Nonsmooth Mechanics and Applications, Springer, 1988; the end of a slide is derived here.
    """

    def __init__(self, part: Part):
        super().__init__(part)
        self.first, self.second = part.planar[0]
        if self.m != 2 or part.dependent:
            those = " and ".join(part.names)
            allowed = (
                "two contacts of independent directions, which no other contact or stop joins by a "
                "velocity or by inertia"
            )
            raise DeclarationError(str(refusal("planar", those, allowed)))
        self.plain = VaryingContacts(part) if part.varies else CoupledContacts(part)

    @classmethod
    def takes(cls, part: Part) -> bool:
        return bool(part.planar)

    @property
    def joint_guards(self) -> int:
        return 1

    def motion(self, M, F, J, rest, gamma):
        return self.plain.motion(M, F, J, rest, gamma)

    def still_in(self, own):
        return _both((own[0] == 0.0) & (own[1] == 0.0))

    def decides(self, rests, n):
        return self.plain.decides(rests, n)

    # -- friction

    def normal_force(self, here: LocalInstant) -> Any:
        """That of the first contact [N]; raises for one of the second, and for laws of two senses."""
        first, second = (here.at.contacts[c] for c in (self.first, self.second))
        names = dict(zip(self.rows, self.part.names, strict=True))
        given = second.normal_force, second.normal_direction
        if not (isinstance(given[0], float) and given[0] == 1.0) or given[1] is not None:
            allowed = f"left out: contact {names[self.first]!r} has that of both"
            what = f"the normal force of contact {names[self.second]!r}"
            raise DeclarationError(str(refusal(what, second.normal_force, allowed)))
        for name, contact in zip(names.values(), here.contacts, strict=True):
            if not contact.law.is_odd:
                allowed = "the same in both senses, of which a planar contact has none"
                raise DeclarationError(
                    str(refusal(f"the law of contact {name!r}", contact.law, allowed))
                )
        return first.normal_force

    def normal_forces(self, here: LocalInstant, states: Any) -> dict[int, Any]:
        load = jnp.asarray(self.normal_force(here), jnp.float64)
        return {self.second: where(states[self.second] == 2.0, 0.0, load)}

    def static(self, here: LocalInstant) -> Pair:
        """Semi-axes of the ellipse at rest [N]."""
        load = self.normal_force(here)
        return tuple(contact.law.static_coefficient(1) * load for contact in here.contacts)

    def held(self, here: LocalInstant, states: Any) -> Motion:
        """Motion at rest."""
        force = self.without_friction(here, states)
        return self.motion(here.mass, force, here.lines, _both(True), here.gamma)

    def without_friction(self, here: LocalInstant, states: Any) -> NumberRow:
        """All other forces on the velocities."""
        everything = here.at.forces_in(states)
        return tuple(everything[j] for j in self.columns)

    @jax.named_scope(SMOOTH)
    def slide(self, here: LocalInstant, states: Any) -> Slide:
        """The contact as it slides."""
        u, speed = here.speeds, _size(here.speeds)
        normal, laws = self.normal_force(here), [contact.law for contact in here.contacts]
        limits = tuple(law.kinetic(speed, 1) * normal for law in laws)
        borne = self.held(here, states).force
        least = ENGINE.slack * _size(borne) + ENGINE.tiny  # where the normal force vanishes
        load = tuple(-f / (limit + least) for f, limit in zip(borne, limits, strict=True))
        pulled = _size(load)
        hint = self.hint(here, speed, load, pulled) * limits[0] / pulled
        used = [r * x + hint * m for r, x, m in zip(limits, u, load, strict=True)]
        size = _size(used)
        toward = (used[0] / size, used[1] / size)
        friction = tuple(
            -(r * e + law.drag(speed) * x / speed)
            for r, e, law, x in zip(limits, toward, laws, u, strict=True)
        )
        return Slide(speed, limits, toward, load, friction)

    def hint(self, here: LocalInstant, speed: Any, load: Pair, pulled: Any) -> Any:
        """Speed along the load by which the direction of a contact is known that has begun to slide.

        At zero it has none of its own, and while it gains speed slowly it follows the load all the more
        stiffly; so slow it slides along it.
        """
        u, most = here.speeds, self.rest_speed(here) / ACCURACY.slow
        steep = jnp.abs(_across(load, u)) / jnp.maximum(ACCURACY.slow * _dot(load, u), ENGINE.tiny)
        steep = jnp.minimum(steep, 1.0)
        along = where((u[0] == 0.0) & (u[1] == 0.0), 1.0, 1.0 - steep * steep)
        slow = jnp.maximum(1.0 - speed / most, 0.0) * along
        found = most * (ENGINE.same + slow * slow)
        return where(pulled >= 1.0 - ENGINE.zero, found, 0.0)

    def rest_speed(self, here: LocalInstant) -> Any:
        """Slower slides end in closed form [m/s]."""
        name = self.part.names[self.rows.index(self.first)]
        speed = here.at.contacts[self.first].rest_speed
        return check_positive(f"the rest_speed of contact {name!r}", speed)

    def slip_forces(self, here: LocalInstant, states: Any) -> NumberRow:
        own = self.own_states(states)
        both = zip(self.slide(here, states).friction, self.motion_in(here, states).force, strict=True)
        return tuple(where(_slips(own), f, where(_ends(own), g, 0.0)) for f, g in both)

    def load(self, here: LocalInstant, states: Any, needed: bool = False) -> NumberRow:
        slips = _slips(self.own_states(states))
        friction = tuple(where(slips, f, 0.0) for f in self.slide(here, states).friction)
        return self.with_friction(here.lines, self.without_friction(here, states), friction)

    def motion_in(self, here: LocalInstant, states: Any, needed: bool = False) -> Motion:
        own = self.own_states(states)
        rests = own[1] == 0.0
        back = where(_ends(own), self.end_deceleration(here), 0.0)
        gamma = [here.gamma[0] - back, here.gamma[1]]
        return self.motion(here.mass, self.load(here, states), here.lines, (rests, rests), gamma)

    def end_deceleration(self, here: LocalInstant) -> Any:
        """Deceleration at the end of a slide, which is along the first axis [m/s^2]."""
        inertia = -self.impulse(here, (-1.0, 0.0)).force[0]
        law = here.contacts[0].law
        return law.kinetic_limit(1) * self.normal_force(here) / jnp.abs(inertia)

    def impulse(self, here: LocalInstant, change: Pair) -> Motion:
        """Changes of the velocities with these changes of the sliding velocity, and the impulses."""
        none = tuple(jnp.zeros_like(x) for x in here.velocities)
        return self.motion(here.mass, none, here.lines, _both(True), [jnp.asarray(x) for x in change])

    # -- guards and events

    def guards(self, here: LocalInstant, states: Any) -> Guards:
        own = self.own_states(states)
        slips, rests = _slips(own), own[1] == 0.0
        now, ends = self.slide(here, states), _ends(own)
        # Under a load beyond its limit it passes through zero if it slides straight against the load.
        most, load = _size(now.load), now.load
        pulls = most > 0.5
        size = where(pulls, most, 1.0)
        beside = _across(load, here.speeds) / (size * now.speed)
        against = jnp.maximum(-_dot(load, now.toward), 0.0) / size
        straight = against * jnp.maximum(1.0 - beside * beside / ENGINE.same, 0.0)
        within = (1.0 - ENGINE.zero - most) * now.limits[0] / (now.limits[0] + ENGINE.tiny)
        slow = self.rest_speed(here) * jnp.maximum(within, where(pulls, straight, 0.0))
        stops = where(slips, now.speed - slow, where(ends, here.speeds[0], 1.0))
        left = where(rests & ~ends, self.left(here, self.held(here, states)), 1.0)
        return Guards((stops, jnp.ones_like(stops)), {}, (left,))

    def left(self, here: LocalInstant, held: Motion) -> Any:
        """Force that is left until the contact gives way [N], along the first axis."""
        first, second = self.static(here)
        share = (first + ENGINE.tiny) / (second + ENGINE.tiny)
        return first + ENGINE.tiny - _size((held.force[0], share * held.force[1]))

    def release(self, here: LocalInstant, states: Any, hit: NumberRow, fired: Fired) -> Release:
        raise NotImplementedError("a planar contact has a transition of its own")

    def at_zero(self, here: LocalInstant, states: Any) -> Pair:
        """State of a contact without speed: at rest, or sliding along its load."""
        held = jax.lax.stop_gradient(self.held(here, states))
        static = jax.lax.stop_gradient(self.static(here))
        bears = (held.force[0] != 0.0) | (held.force[1] != 0.0)
        gives_way = bears & (self.left(here, held) < -ENGINE.slack * static[0])
        return _both(where(gives_way, 1.0, 0.0))

    def slow_both(self, here: LocalInstant) -> Any:
        """Whether the sliding velocity is rounding."""
        first, second = here.slow()
        return first & second

    def at_start(self, here: LocalInstant, states: Any) -> NumberRow:
        opens, slow = states[self.first] == 2.0, self.slow_both(here)
        return _both(where(opens, 2.0, where(slow, 0.0, 1.0)))

    def states_after(self, here, states, own, started, active, passing=None):
        stands = (own[0] == 0.0) | (own[1] == 0.0)
        zero = self.at_zero(here, self.with_own(states, _both(0.0)))
        found = tuple(where(stands, z, s) for z, s in zip(zero, own, strict=True))
        return found, jnp.ones((), bool)

    def transition(self, here: LocalInstant, states: Any, fired: Fired) -> Change:
        own, u = self.own_states(states), here.speeds
        slips = _slips(own)
        stop = fired.guard == fired.numbers[self.rows[0]][0]
        gives_way = (fired.guard == fired.joint[self.rows[0]]) & (own[1] == 0.0)
        # A contact that bears nothing gives way only where nothing presses it on any more.
        held = self.held(here, states).force
        empty = gives_way & (held[0] == 0.0) & (held[1] == 0.0)
        failed = empty if self.first in self.part.lifting else empty & False
        time, moves, speed = self.end(here, states)
        lasts = stop & slips & (time > 0.0)
        zero = stop & ~lasts
        slides = gives_way
        opens, opened = own[0] == 2.0, jnp.zeros((), bool)
        if self.first in fired.toggled:
            toggle = fired.toggled[self.first]
            opened = (toggle & ~opens) | empty
            closes = toggle & opens
            zero, slides = zero | (closes & self.slow_both(here)), slides | closes
            opens = opens & ~toggle
        if fired.asked is not None:
            asked = fired.asked & ~opens & ~opened
            stands = self.slow_both(here) | ((own[0] == 0.0) & (own[1] == 0.0))
            zero, slides = zero | (asked & stands), slides | asked
        at_zero = self.at_zero(here, self.with_own(states, _both(0.0)))
        found = tuple(
            where(opened, 2.0, where(zero, z, where(lasts, last, where(slides, 1.0, s))))
            for s, z, last in zip(own, at_zero, (1.0, 0.0), strict=True)
        )
        rest = self.at_rest(here, _both(jnp.ones((), bool)))
        last = self.impulse(here, (speed - u[0], -u[1])).acceleration
        velocities = tuple(
            where(zero, r, where(lasts, v + dv, v))
            for r, v, dv in zip(rest, here.velocities, last, strict=True)
        )
        back = 0.5 * time * speed
        shift = self.impulse(here, (moves[0] - back, moves[1])).acceleration
        places = {
            j: here.at.q[j] + where(lasts, dq, 0.0)
            for j, dq in zip(self.columns, shift, strict=True)
            if here.at.q[j] is not None
        }
        return Change(velocities, found, places, failed)

    def end(self, here: LocalInstant, states: Any) -> tuple[Any, tuple[Any, ...], Any]:
        """Time that is left of a slide [s], the way on it [m], and the speed with which it ends along
        the first axis."""
        now, u = self.slide(here, states), here.speeds
        m, used = now.load, (now.limits[0] * u[0], now.limits[1] * u[1])
        power = _size(used)
        e = (used[0] / power, used[1] / power)
        m2, g = _dot(m, m), _dot(m, e)
        # Twice the energy of the sliding velocity over its power of friction, of a disc s/A.
        pushes = self.impulse(here, (-u[0], -u[1])).force
        base = -_dot(pushes, u) / (power + ENGINE.tiny)
        room = where(jnp.abs(1.0 - m2) > ENGINE.zero, 1.0 - m2, 1.0)
        longest = 2.0 * base * self.rest_speed(here) / now.speed
        time = jnp.clip(base * (1.0 + g) / room, 0.0, longest)
        inside = m2 < 1.0 - ENGINE.zero
        m2 = where(inside, m2, 0.0)
        own = base * (2.0 + g) / (4.0 - m2)
        more = base * (4.0 - m2 + 6.0 * g + 3.0 * g * g) / (4.0 * (1.0 - m2) * (4.0 - m2))
        size = _size(u)
        moves = tuple(
            where(inside, own * x + more * size * y, 0.5 * time * x) for x, y in zip(u, m, strict=True)
        )
        return time, moves, self.end_deceleration(here) * time


def _both(value: Any) -> tuple[Any, Any]:
    return value, value


def _slips(own: NumberRow) -> Any:
    """Whether the contact slides, and not to its end."""
    return (own[1] != 0.0) & (own[1] != 2.0)


def _ends(own: NumberRow) -> Any:
    """Whether it slides to its end."""
    return (own[1] == 0.0) & (own[0] != 0.0)


def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1]


def _across(a: Any, b: Any) -> Any:
    return a[0] * b[1] - a[1] * b[0]


def _size(x: Any) -> Any:
    """Size of a vector; at zero it has the slope 0."""
    return jnp.sqrt(x[0] * x[0] + x[1] * x[1] + ENGINE.tiny**2)
