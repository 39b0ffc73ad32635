"""Declare masses, forces and contacts of a mechanism; its modes, guards and transitions follow."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._argument_checks import check_arguments, reals
from stickslip._argument_checks import state as some_state
from stickslip._fastmath import where
from stickslip._jit_by_code import jit_by_code
from stickslip._types import Numeric, overridable
from stickslip._validation import is_concrete
from stickslip.friction import AbstractBristleLaw, LuGre
from stickslip.hybrid.status import NO_MODE
from stickslip.hybrid.system import mode_type

from ._abstract import traced_with
from ._analysis import check_args, contacts_without_drag
from ._check import (
    check_declaration,
    check_directions,
    check_law,
    check_mass,
    check_numbers_at_start,
    inertia_entries,
)
from ._dependent import motion_in_rows
from ._first_order import check_rates
from ._forms import BristleMechanism, RegularisedMechanism
from ._gaps import check_gaps
from ._group import AbstractContactGroup
from ._known import numbers_known
from ._laws import resisting
from ._modes import ModeNames
from ._moment import touching
from ._observables import AbstractWithObservables
from ._rows import NumberRow
from ._scalars import Mass, times, total
from ._verbs import accelerations, guards, held_state, initial_states, transition


class AbstractMechanism(AbstractWithObservables):
    r"""A mechanism with dry contacts, declared by its inertia, forces and contacts.

    $$M(q)\,\dot v = f(t, q, v) + \sum_c n_c\,\lambda_c, \qquad \dot q = v, \qquad
      u_c = n_c\cdot v - w_c, \qquad -\lambda_c \in \mu_c(u_c)\,N_c + d_c(u_c)$$

    From the declaration follow the state, the modes and their names, the field, the guards, the
    transitions, the initial mode, the energy account and the observables. A block on a belt:

    >>> from typing import ClassVar
    >>> import stickslip as ss
    >>> from stickslip.friction import AbstractFrictionLaw, Coulomb
    >>> from stickslip.mechanism import AbstractMechanism, Contact
    >>> class Block(AbstractMechanism):
    ...     mass: float
    ...     stiffness: float
    ...     law: AbstractFrictionLaw
    ...     belt_speed: float
    ...     coordinates: ClassVar = {"x": "m"}
    ...     contact_directions: ClassVar = {"belt": {"x": 1.0}}
    ...
    ...     def mass_matrix(self, q):
    ...         return {"x": self.mass}
    ...
    ...     def forces(self, t, q, v, args):
    ...         return {"x": -self.stiffness * q.x}
    ...
    ...     def contacts(self, t, q, v, args):
    ...         return {"belt": Contact(self.law, surface_speed=self.belt_speed)}
    >>> block = Block(1.0, 1.0, Coulomb(1.0, 0.5), 0.2)
    >>> run = ss.simulate(block, 0.0, 50.0, block.state(v_x=0.2))
    >>> print(f"{run.y1.x:.10f}")
    1.0354672845
    >>> [block.mode_names[m] for m in run.events.mode_after[:3]]
    ['slip backward', 'stick', 'slip backward']
    >>> block.contact_states(1)
    {'belt': 'stick'}

    **To declare**, as class attributes (or properties, where a number of parts is a static field):

    - `coordinates`: names of the generalised coordinates $q$ and their units.
    - `contact_directions`: names of the contacts, and the direction $n_c$ of each, which makes its
      sliding speed out of the velocities: a mapping from coordinates to constant numbers, or a row of
      them. None where it depends on the state or on parameters; then `contacts` returns it.
    - `velocities`: names of their rates $v$ in the state, by coordinate; `"v_x"` for `"x"` if left out.
    - `first_order`: names and units of states $s$ that have a rate of their own and no inertia, as the
      current of a motor: $\dot s = $ `rates(t, q, v, args)`, a mapping by name.
    - `periods`: of coordinates that are angles, their full turn, `{"phi": 2 * jnp.pi}`: a motion that
      goes round has periods then, and pictures and tables show it within one turn.
    - `cyclic`: names of coordinates on which nothing depends, as the angle of a rotor: the state has
      their rates only, and their fields of `q` are None.
    - `state_class`: named tuple of the state, its fields the coordinates, velocities and states of
      first order in any order; made from their names if left out.
    - `opening`: names of the contacts that open where their normal force falls to zero, and close
      where it rises again.
    - `stops`: names of rigid stops, which end the motion towards them with an impact.
    - `rubbing`: of contacts that rub on a stop, the stop: `{"sole": "floor"}`. The load of the stop is
      their normal force, and they are open while it is; its impacts are without friction. Each on a
      coordinate of its own, which inertia does not couple with the other.
    - `planar`: of two contacts at right angles that are the axes of one in a plane, the second:
      `{"along": "across"}`. At rest they bear together what lies in an ellipse of the semi-axes
      $\mu_i N$, a disc for two equal laws; sliding, friction is that of the greatest dissipation, for a
      disc $-\mu(|u|)\,N\,u/|u|$. Laws are functions of the speed $|u|$. The first has the normal force
      of both, and opens both. Both slip forward as it slides, whatever its direction; a slide ends in
      the mode `"slip forward / stick"` (`Contact.rest_speed`).

    and as methods `mass_matrix(q)`, `forces(t, q, v, args)`, `contacts(t, q, v, args)`,
    `gaps(t, q, args)` (where there are stops), `potential_energy(q)` (for the energy account only)
    and, if the forces depend on the time, `time_scale(args)`. In them `q` and `v` are named tuples,
    both by the names of the coordinates. States of first order are fields of `q` too, after the
    coordinates: as these they go on through every event unchanged, and all but a gap may depend on
    them. Python and NumPy constants in what the methods return are structure:
    a mass matrix whose constant zeros part the mechanism is treated part by part. Numbers in `q`, `v`,
    `t` and the fields never are, whatever their values. `args` are known in a run only: what looks at
    them is taken to change with time and state, whatever its default. Loads that jump at known times:
    `WithBreaks`.

    A coordinate may stand for an array of them, as those of a beam, if no contact and no other inertia
    touches it; `energy` and `declared_power` then have to be overridden, and states made by
    `state_class`. So may a state of first order, as temperatures along a rod.

    **What follows**

    - Modes: each contact slips backward, sticks, slips forward, or is open; after the contacts each
      stop is open or closed.
    - Within a mode: Gauss' principle, with the contacts at rest as constraints
      $n_c\cdot a = \dot w_c - \dot n_c\cdot v$; directions of contacts may depend on each other.
    - Guards: for each contact the friction that is left to it [N], or its sliding speed in the sense of
      its slip [m/s]; one more for the other sense, where what is left in each is affine in time and
      state; of dependent contacts the least part of their friction that is left together; the normal
      force of one that opens, or may vanish; of a stop its gap [m], or what it bears [N].
    - Transitions: a contact that stops is at rest, and stays so if the law of all contacts lets it; the
      threshold is the greater of static and kinetic friction; a contact that begins to slide is
      under kinetic friction at once, which may start others at the same instant.
    - A contact that does not open and loses its normal force ends the run with
      `RESULTS.no_admissible_mode`; its guard is the last in the log (one that bears no force at rest
      gives way at that instant, and is logged as giving way).
    - At an impact stops that are closed take impulses too, by Newton's law with no speed before it:
      they are pushed on, or left. Friction is finite and takes no impulse, but a contact that sticks
      may slide then.

    **To override**, where a machine has something better or of its own:

    - `motion_together`: the motion of contacts with dependent directions, where it has a closed form.
    - `states` and `mode_of`, both: other numbers of the modes, with `mode_names`.
    - `to_coordinates` and `from_coordinates`, both: a state in other coordinates than the declared.
    - `guards`, `guard_names` and `transition`: guards of its own, after all others. Where one of them
      fires, `transition` of this class asks the law of all contacts again, in the state given to it.

    **Limits.** Friction acts along a line, or in a plane where `planar` says so: two contacts that only
    cross, each with the normal force of the body, are a square in place of the circle, and a puck on
    them bends off its line and stops too early. Beside a planar contact no other contact or stop may
    touch the velocities that it or inertia joins (a plate on three feet).
    Normal forces that depend on friction (Painlevé) are not covered, nor is friction at an impact.
    Dependent directions that vary, surfaces of dependent contacts whose speeds vary (but
    beside a stop on one coordinate), and more than 31 contacts (a stop counts as half of one) raise an
    error. Where contacts have directions across the coordinates, accelerations lose as many digits as
    the inertias that they join have in their ratio.

    **Raises** `DeclarationError`, `ValueError` or `TypeError` that name what is declared wrongly,
    before anything is compiled: directions of the wrong length, a mass matrix that is not positive
    definite, a law that has no set-valued form, a normal force that is negative at the start, friction
    that drives there.

    ??? cite "Reference"

        Ch. Glocker, *Set-Valued Force Laws*, Springer, 2001; F. Pfeiffer, Ch. Glocker, *Multibody
        Dynamics with Unilateral Contacts*, Wiley, 1996.
    """

    # -- names and structure

    def __check_init__(self):
        check_declaration(self)

    @overridable
    def mode_names(self) -> Sequence[str]:
        """`"slip backward"`, `"stick"`, `"slip forward"` or `"open"` of each contact; of each stop
        `"open"` or `"closed"`."""
        return ModeNames(len(self.contact_directions), len(self.stops))

    @overridable
    def guard_names(self) -> tuple[str, ...]:
        """One guard per contact, and per second limit of its friction, per group of dependent contacts,
        per contact that may open or lose its normal force, per stop."""
        return self.structure.guard_names

    @property
    def islands(self) -> tuple[AbstractContactGroup, ...]:
        """Groups of velocities that contacts and inertia couple: `columns` are the numbers of their
        coordinates, `rows` those of their contacts and stops."""
        return self.structure.groups

    # -- one instant, and the hybrid system

    def vector_field(self, t, y, mode, args):
        now = self._moment(t, y, args)
        for name, contact in zip(self.names.contacts, now.at.contacts, strict=True):
            check_law(name, contact.law)
        a = accelerations(now, self.states(mode))
        return self.from_coordinates(now.at.q_rate, type(now.at.v)(*a))

    def motion_together(
        self, group: AbstractContactGroup, mass: Mass, force: NumberRow, rest: NumberRow
    ) -> tuple[NumberRow, NumberRow]:
        """Motion of dependent contacts: acceleration of each velocity, and force of all in `rest`.

        A machine that has a faster closed form overrides this. A `NumberRow` is an array with one axis;
        in a program that is fused over many lanes it is a tuple, and so are both results.

        **Arguments:** `group`, the velocities and contacts; their `mass`; `force` on each velocity
        [N]; `rest`, whether each contact is at rest: with each set all contacts that it holds.
        """
        return motion_in_rows(group, mass, force, rest)

    def switches_in(self, t, y, mode, args):
        return tuple(self.switches(t, *self.to_coordinates(y), args))

    def guards(self, t, y, mode, args):
        return guards(self._moment(t, y, args), self.states(mode))

    @property
    def continuous_guards(self) -> tuple[int, ...]:
        """Those of the normal forces: friction begins and ends with them at 0, but for drag."""
        numbers = self.structure.guards
        smooth = traced_with(contacts_without_drag, self) if self.opening else set()
        opens = [number for c, number in numbers.opens.items() if c in smooth]
        return (*opens, *numbers.lifts.values())

    @property
    def answers_jumps(self) -> bool:
        """True: the law of all contacts is asked again."""
        return True

    def transition(self, t, y, mode, guard, args):
        """State and mode right after guard number `guard` has fired; -1 if a load has jumped."""
        now = self._moment(t, y, args)
        others = len(self.guard_names) > now.structure.guards.many
        q, v, states, failed = transition(now, self.states(mode), guard, others)
        return self.from_coordinates(q, v), self._mode_of(states, failed)

    def held_state(self, t, y, mode, args):
        found = held_state(self._moment(t, y, args), self.states(mode))
        return y if found is None else self.from_coordinates(*found)

    @check_arguments(t=reals, y=some_state)
    def initial_mode(self, t, y, args):
        return self._mode_of(*initial_states(self._moment(t, y, args)))

    def _mode_of(self, states: Any, failed: Any) -> Any:
        mode = self.mode_of(states)
        return where(failed, jnp.asarray(NO_MODE, mode.dtype), mode)

    def check_start(self, t, y, mode, args):
        """Raise `ValueError` for a contact that pulls or drives, and for wrong inertia or stops; in a
        mode also for a contact that sticks but slides, and for a closed stop that is not met."""
        try:
            q, _ = type(self).to_coordinates(self, y)
        except (AttributeError, TypeError):
            return  # no state of this mechanism, as the run says
        check_args(self, args)
        if args is not None:
            check_directions(self, args)
        check_gaps(self, t, y, args)
        check_rates(self, t, y, args)
        if not is_concrete((self, t, y, args)):
            if is_concrete((self, y)):
                check_mass(self, q)
            return
        if mode is not None:
            named = is_concrete(mode) and not np.ndim(mode) and int(mode) >= 0
            mode = np.asarray(mode, mode_type(self)) if named else None
        try:
            found = numbers_known(_start_numbers, self, t, y, mode, args)
            found = _compiled_start_numbers(self, t, y, mode, args) if found is None else found
        except jax.errors.JAXTypeError:
            return  # closed over what is traced
        if is_concrete(found):
            check_numbers_at_start(self, found, mode)

    def constraints(self, t, y, mode, args):
        """Sliding speeds of the contacts that stick [m/s], then rates and gaps of closed stops."""
        at, states = self.instant(t, y, args), self.states(mode)
        gaps = [stop.stop.gap for stop in at.stops]
        held = zip((*at.speeds, *gaps), (*states, *states[len(at.contacts) :]), strict=True)
        return tuple(where(s == 0.0, x, 0.0) for x, s in held)

    # -- the same declaration in other forms

    def regularised(self, v_reg: Numeric, kind: str = "tanh") -> RegularisedMechanism:
        """The mechanism with `Regularised` laws of the width `v_reg` [m/s]: a smooth system."""
        return RegularisedMechanism(self, v_reg, kind)

    def bristles(
        self, kind: type[AbstractBristleLaw] = LuGre, **parameters: Numeric
    ) -> BristleMechanism:
        """The mechanism with elastic bristles in its contacts: `bristles(LuGre, sigma_0=1e5)`."""
        return BristleMechanism(self, kind, parameters)


def _start_numbers(machine: AbstractMechanism, t: Any, y: Any, mode: Any, args: Any) -> list[Any]:
    """Numbers by which a start is judged.

    Normal forces of the contacts that do not open [N], then coefficients that resist of each; of a mode
    states, speeds, and sizes of the terms of the speeds, of contacts and stops, gaps of the stops, and
    sizes of their terms to first order; the inertia.
    """
    names, (q, v) = machine.names, machine.to_coordinates(y)
    contacts, _, speeds, *_ = touching(machine, machine.structure, t, q, v, args)
    pairs = [*zip(names.contacts, contacts, strict=True)]
    found = [c.normal_force for name, c in pairs if name not in names.opening]
    for contact, speed in zip(contacts, speeds, strict=False):
        found += resisting(contact, speed)
    if mode is not None:
        at = machine.instant(t, y, args)
        fastest = [
            total(jnp.abs(times(n, x)) for n, x in zip(line, at.v, strict=True)) + jnp.abs(w)
            for line, w in zip(at.directions, at.surfaces, strict=True)
        ]
        gaps, farthest = [stop.stop.gap for stop in at.stops], []
        for gap, line in zip(gaps, at.directions[len(at.contacts) :], strict=True):
            terms = [times(n, x) for n, x in zip(line, at.q, strict=False) if x is not None]
            rest = jnp.abs(gap - total(terms))
            farthest.append(total(jnp.abs(x) for x in terms) + rest)
        found += [*machine.states(mode), *at.speeds, *fastest, *gaps, *farthest]
    return [jnp.asarray(x, jnp.float64) for x in (*found, *inertia_entries(machine, q))]


_compiled_start_numbers = jit_by_code(_start_numbers)
