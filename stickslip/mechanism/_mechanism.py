"""Declare masses, forces and contacts of a mechanism; its modes, guards and transitions follow."""

import abc
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from stickslip._argument_checks import check_arguments, reals
from stickslip._argument_checks import state as some_state
from stickslip._code import jit_by_code
from stickslip._fastmath import where
from stickslip._types import Numeric, overridable
from stickslip._validation import is_concrete
from stickslip.friction import AbstractBristleLaw, LuGre

from . import _changes
from ._abstract import traced_with
from ._check import check_declaration, check_directions, check_held, check_law, check_load, check_mass
from ._contact import Contact
from ._declaration import directions_of
from ._first_order import check_rates
from ._instant import (
    Instant,
    floats,
    in_rows,
    instant_of,
    loaded,
    motion_of,
    names_of_rows,
    surface_accelerations,
    touching,
)
from ._island import Island, islands_of
from ._island_rows import IslandRows
from ._known import known
from ._modes import ModeNames
from ._observables import AbstractWithObservables
from ._rows import NumberRow
from ._scalars import Mass
from ._stop import check_gaps
from ._structure import check_args, coupled, inertia_forms, steady, without_drag
from ._together import motion_in_rows

if TYPE_CHECKING:
    from ._forms import BristleMechanism, RegularisedMechanism


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
    touches it; `energy` then has to be overridden, and states made by `state_class`. So may a state of
    first order, as temperatures along a rod.

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

    **Limits.** Friction of a contact acts along one line. Friction in a plane, opposite to a velocity
    of two components, is not covered: two contacts that cross, each with the normal force of the body,
    are a square in place of the circle, and a puck on them bends off its line and stops too early.
    Normal forces that depend on friction or accelerations (Painlevé) are not covered, nor is friction
    in a stop. Dependent directions that vary, surfaces of dependent contacts whose speeds vary (but
    beside a stop on one coordinate), and more than 31 contacts (a stop counts as half of one) raise an
    error. Where contacts have directions across the coordinates, accelerations lose as many digits as
    the inertias that they join have in their ratio.

    **Raises** `DeclarationError`, `ValueError` or `TypeError` that name what is declared wrongly,
    before anything is compiled: directions of the wrong length, a mass matrix that is not positive
    definite, a law that has no set-valued form, a normal force that is negative at the start.

    ??? cite "Reference"

        Ch. Glocker, *Set-Valued Force Laws*, Springer, 2001; F. Pfeiffer, Ch. Glocker, *Multibody
        Dynamics with Unilateral Contacts*, Wiley, 1996.
    """

    # -- what the user declares

    @abc.abstractmethod
    def mass_matrix(self, q: PyTree) -> Any:
        """Inertia: a mass for each coordinate, or the rows of a symmetric positive definite matrix.

        A mapping by coordinate or a sequence in their order, its entries numbers or again such rows.
        A row is an array in a sequence only: by name, arrays are masses of many lanes.
        """

    @abc.abstractmethod
    def forces(self, t: Numeric, q: PyTree, v: PyTree, args: PyTree) -> Any:
        """Generalised forces [N] other than those of the contacts, gyroscopic ones too.

        A mapping by coordinate, where a missing one is 0, or a sequence in their order.
        """

    def contacts(
        self, t: Numeric, q: PyTree, v: PyTree, args: PyTree
    ) -> Mapping[str, Contact] | Sequence[Contact]:
        """A `Contact` for each name in `contact_directions`."""
        return {}

    def switches(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, t: Numeric, q: PyTree, v: PyTree, args: PyTree
    ) -> tuple:
        """Scalars at whose changes of sign a force bends or jumps without showing it.

        `AbstractHybridSystem.switches` says which those are, and what follows.
        """
        return ()

    def potential_energy(self, q: PyTree) -> Any:
        """Potential energy [J] of those forces that have one; 0 if left out.

        What states of first order store belongs to it too, as $\\frac12 L i^2$ of a winding.
        """
        return 0.0

    # -- names and structure

    def __check_init__(self):
        check_declaration(self)

    @property
    def directions(self) -> np.ndarray:
        """Directions of the contacts `[contact, coordinate]`, NaN where `contacts` returns them."""
        return directions_of(self.contact_directions, tuple(self.coordinates))

    @property
    def islands(self) -> tuple[Island, ...]:
        """Groups of velocities that contacts and inertia couple."""
        directions = np.vstack([self.directions, self.slopes[:, :-1]])
        joined, inertia = traced_with(coupled, self), traced_with(inertia_forms, self)
        return islands_of(directions.tobytes(), directions.shape, joined, inertia, len(self.stops))

    @property
    def lifting(self) -> tuple[int, ...]:
        """Contacts that do not open, and whose normal force changes with time or state."""
        names, kept = self.names, traced_with(steady, self)
        contacts = enumerate(names.contacts)
        return tuple(c for c, name in contacts if name not in names.opening and c not in kept)

    @property
    def parted(self) -> tuple[int, ...]:
        """Contacts with a guard for each of the two limits of their friction at rest."""
        return traced_with(_changes.parted, self)

    @property
    def shared(self) -> tuple[Island, ...]:
        """Islands whose resting contacts have one guard together."""
        return tuple(island for island in self.islands if island.dependent)

    @overridable
    def mode_names(self) -> Sequence[str]:
        """`"slip backward"`, `"stick"`, `"slip forward"` or `"open"` of each contact; of each stop
        `"open"` or `"closed"`."""
        return ModeNames(len(self.contact_directions), len(self.stops))

    @overridable
    def guard_names(self) -> tuple[str, ...]:
        """One of each contact, one of each group of dependent contacts, one of each that may open, and
        one of each stop."""
        names = self.names
        own = [f"{name} stops or gives way" for name in names.contacts]
        own += [f"{names.contacts[c]} gives way forward" for c in self.parted]
        for island in self.shared:
            own.append(" and ".join(names_of_rows(self, island.rows)) + " give way")
        own += [f"{name} opens or closes" for name in names.opening]
        own += [f"{names.contacts[c]} loses its normal force" for c in self.lifting]
        own += [f"{name} is met or left" for name in names.stops]
        return tuple(own)

    # -- one instant, and the hybrid system

    def instant(self, t: Numeric, y: PyTree, args: PyTree) -> Instant:
        """What the declaration says at time `t` in state `y`."""
        # As arrays: a number of Python would count as structure.
        t, (q, v) = floats((t, self.to_coordinates(y)))
        return instant_of(self, t, q, v, args)

    def vector_field(self, t, y, mode, args):
        at, states = self.instant(t, y, args), self.states(mode)
        for name, contact in zip(self.names.contacts, at.contacts, strict=True):
            check_law(name, contact.law)
        force, gamma = loaded(self, at, states, apart=True), surface_accelerations(self, t, at, args)
        a: list[Any] = [None] * len(at.force)
        for island in self.islands:
            if in_rows(self, island):
                found = IslandRows(self, island, at, states, force).motion()[0]
            else:
                found = motion_of(island, at, states, force, gamma).acceleration
            for j, x in zip(island.columns, found, strict=True):
                a[j] = jnp.asarray(x, jnp.float64)
        return self.from_coordinates(at.q_rate, type(at.v)(*a))

    def motion_together(
        self, island: Island, mass: Mass, force: NumberRow, rest: NumberRow
    ) -> tuple[NumberRow, NumberRow]:
        """Motion of dependent contacts: acceleration of each velocity, and force of all in `rest`.

        A machine that has a faster closed form overrides this. A `NumberRow` is an array with one axis;
        in a program that is fused over many lanes it is a tuple, and so are both results.

        **Arguments:** `island`, the velocities and contacts; their `mass`; `force` on each velocity
        [N]; `rest`, whether each contact is at rest: with each set all contacts that it holds.
        """
        return motion_in_rows(island, mass, force, rest)

    def switches_in(self, t, y, mode, args):
        return tuple(self.switches(t, *self.to_coordinates(y), args))

    def guards(self, t, y, mode, args):
        return _changes.guards(self, t, y, mode, args)

    @property
    def continuous_guards(self) -> tuple[int, ...]:
        """Those of the normal forces: friction begins and ends with them at 0, but for drag."""
        names, opening = self.names, self.opening
        first = len(names.contacts) + len(self.parted) + len(self.shared)
        smooth = traced_with(without_drag, self) if opening else set()
        own = [i for i, name in enumerate(opening) if names.contacts.index(name) in smooth]
        return tuple(first + i for i in (*own, *range(len(opening), len(opening) + len(self.lifting))))

    @property
    def answers_jumps(self) -> bool:
        """True: the law of all contacts is asked again."""
        return True

    def transition(self, t, y, mode, guard, args):
        return _changes.transition(self, t, y, mode, guard, args)

    @check_arguments(t=reals, y=some_state)
    def initial_mode(self, t, y, args):
        return _changes.initial_mode(self, t, y, args)

    def check_start(self, t, y, args):
        """Raise `ValueError` for a contact that pulls at the start, and a wrong inertia or stop."""
        names = self.names
        if not all(hasattr(y, name) for name in (*names.kept, *names.velocities)):
            return  # no state of this mechanism, as the run says
        check_args(self, args)
        if args is not None:
            check_directions(self, args)
        check_gaps(self, t, y, args)
        check_rates(self, t, y, args)
        if is_concrete((self, y)):
            check_mass(self, self.to_coordinates(y)[0])
        fixed = [name for name in names.contacts if name not in names.opening]
        if fixed and is_concrete((self, t, y, args)):
            loads = known(_loads, self, t, y, args)
            loads = _compiled_loads(self, t, y, args) if loads is None else loads
            for name, load in zip(fixed, loads, strict=True):
                check_load(name, load)

    def check_mode(self, t, y, mode, args):
        """Raise `ValueError` for a contact that sticks in this mode but slides, or a closed stop not
        met."""
        if not is_concrete((self, t, y, mode, args)) or np.ndim(mode) or int(mode) < 0:
            return
        try:  # a machine may have a state of its own
            jax.eval_shape(self.to_coordinates, y)
        except (AttributeError, TypeError):
            return  # no state of this mechanism, as the run says
        found = known(_motion, self, t, y, args)
        found = _compiled_motion(self, t, y, args) if found is None else found
        check_held(self, int(mode), found)

    def constraints(self, t, y, mode, args):
        """Sliding speeds of the contacts that stick [m/s], then rates and gaps of closed stops."""
        at, states = self.instant(t, y, args), self.states(mode)
        gaps = [stop.stop.gap for stop in at.stops]
        held = zip((*at.speeds, *gaps), (*states, *states[len(at.contacts) :]), strict=True)
        return tuple(where(s == 0.0, x, 0.0) for x, s in held)

    # -- the same declaration in other forms

    def regularised(self, v_reg: Numeric, kind: str = "tanh") -> "RegularisedMechanism":
        """The mechanism with `Regularised` laws of the width `v_reg` [m/s]: a smooth system."""
        from ._forms import RegularisedMechanism

        return RegularisedMechanism(self, v_reg, kind)

    def bristles(
        self, kind: type[AbstractBristleLaw] = LuGre, **parameters: Numeric
    ) -> "BristleMechanism":
        """The mechanism with elastic bristles in its contacts: `bristles(LuGre, sigma_0=1e5)`."""
        from ._forms import BristleMechanism

        return BristleMechanism(self, kind, parameters)


def _loads(machine: AbstractMechanism, t: Any, y: Any, args: Any) -> list[Any]:
    """Normal forces of the contacts that do not open [N]."""
    names = machine.names
    contacts, *_ = touching(machine, t, *machine.to_coordinates(y), args)
    loads = zip(names.contacts, contacts, strict=True)
    return [jnp.asarray(c.normal_force, jnp.float64) for name, c in loads if name not in names.opening]


_compiled_loads = jit_by_code(_loads)


def _motion(machine: AbstractMechanism, t: Any, y: Any, args: Any) -> list[Any]:
    """Sliding speeds of contacts and rates of gaps, velocities and speeds of surfaces; gaps, places."""
    at = machine.instant(t, y, args)
    speeds, gaps = (*at.speeds, *at.v, *at.surfaces), [stop.stop.gap for stop in at.stops]
    places = [x for x in at.q[: len(machine.names.coordinates)] if x is not None]
    return [jnp.asarray(x, jnp.float64) for x in (*speeds, *gaps, *places)]


_compiled_motion = jit_by_code(_motion)
