"""Declare masses, forces and contacts of a mechanism; its modes, guards and transitions follow."""

import abc
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import PyTree

from stickslip._fastmath import where
from stickslip._looks_at import OBSERVABLE, looks_at, reals
from stickslip._looks_at import state as some_state
from stickslip._types import Numeric
from stickslip._validation import as_parameter, check_finite, is_concrete
from stickslip.friction import AbstractBristleLaw, LuGre
from stickslip.hybrid._dependence import NONE, degrees
from stickslip.hybrid._system import NO_MODE
from stickslip.systems._mechanical import AbstractMechanicalSystem

from ._check import check_contacts, check_declaration, check_law, check_load
from ._contact import Contact
from ._declaration import (
    Names,
    coordinates_type,
    directions_of,
    in_order,
    mass_of,
    state_type,
    traced_with,
)
from ._island import Island, Motion, islands_of
from ._modes import ModeNames, mode_of, sense_of, states_of
from ._scalars import Mass, any_of, dot, is_zero, minus, times, total
from ._settle import Limits, settled

if TYPE_CHECKING:
    from ._forms import BristleMechanism, RegularisedMechanism

ROUNDING = 8 * 2.3e-16  # of the terms of a sliding speed
MOST_SHARE = 1e6  # a share of friction beyond it says no more


class Instant(NamedTuple):
    """Everything that the declaration says about one instant."""

    q: Any
    v: Any
    mass: Mass
    force: list[Any]
    contacts: list[Contact]
    directions: list[list[Any]]
    speeds: list[Any]  # sliding speeds u = n . v - w


class AbstractMechanism(AbstractMechanicalSystem):
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
    ...     def force(self, t, q, v, args):
    ...         return {"x": -self.stiffness * q.x}
    ...
    ...     def contacts(self, t, q, v, args):
    ...         return {"belt": Contact(self.law, surface_speed=self.belt_speed)}
    >>> block = Block(1.0, 1.0, Coulomb(1.0, 0.5), 0.2)
    >>> run = ss.simulate(block, 0.0, 50.0, block.state(v_x=0.2))
    >>> print(f"{run.y1.x:.10f}")
    1.0354672757
    >>> [block.mode_names[m] for m in run.events.mode_after[:3]]
    ['slip backward', 'stick', 'slip backward']

    **To declare**, as class attributes (or properties, where a number of parts is a static field):

    - `coordinates`: names of the generalised coordinates $q$ and their units.
    - `contact_directions`: names of the contacts, and the direction $n_c$ of each, which makes its
      sliding speed out of the velocities: a mapping from coordinates to constant numbers, or a row of
      them. None where it depends on the state or on parameters; then `contacts` returns it.
    - `velocities`: names of their rates $v$ in the state, by coordinate; `"v_x"` for `"x"` if left out.
    - `opening`: names of the contacts that open where their normal force falls to zero, and close
      where it rises again.

    and as methods `mass_matrix(q)`, `force(t, q, v, args)`, `contacts(t, q, v, args)`,
    `potential_energy(q)` (for the energy account only) and, if the forces depend on the time,
    `time_scale(args)`. In them `q` and `v` are named tuples, both by the names of the coordinates.
    Python and NumPy constants in what they return are structure: a mass matrix whose constant zeros
    part the mechanism is treated part by part. Loads that jump at known times: `WithBreaks`.

    **What follows**

    - Modes: each contact slips backward, sticks, slips forward, or is open.
    - Within a mode: Gauss' principle, with the contacts at rest as constraints
      $n_c\cdot a = \dot w_c - \dot n_c\cdot v$; directions of contacts may depend on each other.
    - Guards: for each contact the friction that is left to it [N], or its sliding speed in the sense of
      its slip [m/s]; of dependent contacts the least part of their friction that is left together; the
      normal force of one that opens, or may vanish.
    - Transitions: a contact that stops is at rest, and stays so if the law of all contacts lets it; the
      threshold is the greater of static and kinetic friction; what begins to slide is under kinetic
      friction at once, which may start others at the same instant.
    - A contact that does not open and loses its normal force ends the run with
      `RESULTS.no_admissible_mode`; its guard is the last in the log.

    **Limits.** Normal forces that depend on friction or accelerations (Painlevé), impacts, and dependent
    directions that vary are not covered; the last are refused. Surfaces of dependent contacts need
    speeds that stay what they are.

    **Raises** `DeclarationError`, `ValueError` or `TypeError` that name what is declared wrongly,
    before anything is compiled: directions of the wrong length, a mass matrix that is not positive
    definite, a law that has no set-valued form, a normal force that is negative at the start.

    ??? cite "Reference"

        Ch. Glocker, *Set-Valued Force Laws*, Springer, 2001; F. Pfeiffer, Ch. Glocker, *Multibody
        Dynamics with Unilateral Contacts*, Wiley, 1996.
    """

    coordinates: eqx.AbstractClassVar[Mapping[str, str]]
    contact_directions: ClassVar[Mapping[str, Any]] = {}
    velocities: ClassVar[Mapping[str, str]] = {}
    opening: ClassVar[tuple[str, ...]] = ()

    # -- what the user declares

    @abc.abstractmethod
    def mass_matrix(self, q: Any) -> Any:
        """Inertia: a mass for each coordinate, or the rows of a symmetric positive definite matrix.

        A mapping by coordinate or a sequence in their order, its entries numbers or again such rows.
        """

    @abc.abstractmethod
    def force(self, t: Numeric, q: Any, v: Any, args: PyTree) -> Any:
        """Generalised forces [N] other than those of the contacts, gyroscopic ones too.

        A mapping by coordinate, where a missing one is 0, or a sequence in their order.
        """

    def contacts(self, t: Numeric, q: Any, v: Any, args: PyTree) -> Mapping[str, Contact]:
        """A `Contact` for each name in `contact_directions`."""
        return {}

    def potential_energy(self, q: Any) -> Any:
        """Potential energy [J] of those forces that have one; 0 if left out."""
        return 0.0

    # -- names and structure

    def __check_init__(self):
        check_declaration(self)

    @property
    def _names(self) -> Names:
        coordinates = tuple(self.coordinates)
        velocities = tuple(self.velocities.get(name, f"v_{name}") for name in coordinates)
        return Names(coordinates, velocities, tuple(self.contact_directions), tuple(self.opening))

    @property
    def _directions(self) -> np.ndarray:
        return directions_of(self.contact_directions, tuple(self.coordinates))

    @property
    def _islands(self) -> tuple[Island, ...]:
        names, directions = self._names, self._directions
        n = len(names.coordinates)
        kind = coordinates_type(names.coordinates)
        mass = traced_with(
            lambda s, q: mass_of(s.mass_matrix(q), names.coordinates), self, kind(*[0.0] * n)
        )
        coupled = np.eye(n, dtype=bool)
        if mass.full is not None:
            coupled = np.array([[not is_zero(x) for x in row] for row in mass.full])
            coupled = coupled | coupled.T
        return islands_of(directions.tobytes(), directions.shape, coupled.tobytes())

    @property
    def _lifting(self) -> tuple[int, ...]:
        """Contacts that do not open, and whose normal force changes with time or state."""
        names = self._names
        n = len(names.coordinates)
        kind = coordinates_type(names.coordinates)

        def loads(system, t, q, v):
            contacts = in_order("contacts(...)", system.contacts(t, q, v, None), names.contacts, "")
            return [jnp.asarray(c.normal_force, jnp.float64) + 0.0 for c in contacts]

        fixed = [c for c, name in enumerate(names.contacts) if name not in names.opening]
        zero = jnp.zeros(())
        try:
            operands = (zero, kind(*[zero] * n), kind(*[zero] * n))
            found = degrees(lambda t, q, v: loads(self, t, q, v), operands, (True,) * 3)
        except Exception:
            return tuple(fixed)  # it looks at `args`, which are not known here
        return tuple(c for c in fixed if found[c] != NONE)

    @property
    def _shared(self) -> tuple[Island, ...]:
        """Islands whose resting contacts have one guard together."""
        return tuple(island for island in self._islands if island.dependent)

    @property
    def mode_names(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        """`"slip backward"`, `"stick"`, `"slip forward"` or `"open"` of each contact."""
        return ModeNames(len(self.contact_directions))

    @property
    def guard_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """One of each contact, one of each group of dependent contacts, one of each that may open."""
        names = self._names
        own = [f"{name} stops or gives way" for name in names.contacts]
        for island in self._shared:
            own.append(" and ".join(names.contacts[c] for c in island.rows) + " give way")
        own += [f"{name} opens or closes" for name in names.opening]
        own += [f"{names.contacts[c]} loses its normal force" for c in self._lifting]
        return tuple(own)

    @property
    def units(self) -> dict[str, str]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Those of the coordinates, and of their rates."""
        names, given = self._names, self.coordinates
        rates = {
            v: _per_second(given[q]) for q, v in zip(names.coordinates, names.velocities, strict=True)
        }
        return {**given, **rates}

    # -- states

    def state(self, **values: Numeric) -> Any:
        """A state by the names of coordinates and velocities; what is left out is 0.

        **Raises** `TypeError` for a name that is none, `ValueError` for what is not finite.
        """
        names = self._names
        known = (*names.coordinates, *names.velocities)
        for name in values:
            if name not in known:
                raise TypeError(f"state() has no component {name!r}: there are {', '.join(known)}.")
        numbers = [as_parameter(check_finite(name, values.get(name, 0.0))) for name in known]
        n = len(names.coordinates)
        return self.from_coordinates(self._tuple(numbers[:n]), self._tuple(numbers[n:]))

    def from_coordinates(self, q: Any, v: Any) -> Any:
        """The state of these coordinates and velocities; linear, so that it takes rates too."""
        names = self._names
        return state_type((*names.coordinates, *names.velocities))(*q, *v)

    def to_coordinates(self, y: Any) -> tuple[Any, Any]:
        """Coordinates and velocities of a state, each under the names of the coordinates."""
        names = self._names
        return (
            self._tuple([getattr(y, name) for name in names.coordinates]),
            self._tuple([getattr(y, name) for name in names.velocities]),
        )

    def _tuple(self, entries: Any) -> Any:
        return coordinates_type(tuple(self.coordinates))(*entries)

    # -- one instant

    def instant(self, t: Numeric, y: Any, args: PyTree) -> Instant:
        """What the declaration says at time `t` in state `y`."""
        q, v = self.to_coordinates(y)
        return self._instant(t, q, v, args)

    def _instant(self, t, q, v, args) -> Instant:
        names = self._names
        force = in_order("force(t, q, v, args)", self.force(t, q, v, args), names.coordinates, "forces")
        contacts = check_contacts(self, self.contacts(t, q, v, args))
        rows = []
        for name, row, contact in zip(names.contacts, self._directions, contacts, strict=True):
            if np.isnan(row).any():
                what = f"contacts(...)[{name!r}].direction"
                rows.append(in_order(what, contact.direction, names.coordinates, "numbers"))
            else:
                rows.append([float(x) for x in row])
        speeds = [
            jnp.asarray(minus(dot(row, v), contact.surface_speed), jnp.float64)
            for row, contact in zip(rows, contacts, strict=True)
        ]
        mass = mass_of(self.mass_matrix(q), names.coordinates)
        return Instant(q, v, mass, force, contacts, rows, speeds)

    def _surface_accelerations(self, t, at: Instant, args) -> list[Any]:
        r"""$\gamma = \dot w - \dot n \cdot v$: what $n \cdot a$ is while the contact rests."""

        def speeds(t, q):
            return self._instant(t, q, at.v, args).speeds

        if not at.contacts:
            return []
        t = jnp.asarray(t, jnp.float64)
        q = jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), at.q)
        depends = degrees(speeds, (t, q), (True, True))
        if all(d == NONE for d in depends):
            return [0.0] * len(depends)
        rates = jax.jvp(speeds, (t, q), (jnp.ones_like(t), self._tuple(at.v)))[1]
        return [0.0 if d == NONE else -r for d, r in zip(depends, rates, strict=True)]

    def _loaded(self, at: Instant, states: list, without: list | None = None) -> list[Any]:
        """All forces: those declared, friction of the sliding contacts, normal forces of closed ones."""
        force = list(at.force)
        for c, (name, contact, s) in enumerate(
            zip(self._names.contacts, at.contacts, states, strict=True)
        ):
            idle = s == 0.0
            if name in self.opening:
                idle = idle | (s == 2.0)
            if without is not None:
                idle = idle | without[c]
            friction = contact.law.slip_force(at.speeds[c], contact.normal_force, sense_of(s))
            friction = where(idle, 0.0, friction)
            force = [
                total((f, times(n, friction))) for f, n in zip(force, at.directions[c], strict=True)
            ]
            force = self._pushed(force, at, c, s)
        return force

    def push_of(self, at: Instant, c: int) -> list[Any] | None:
        """Generalised force of a normal force of 1 N in contact number `c`; None where it has none."""
        direction, name = at.contacts[c].normal_direction, self._names.contacts[c]
        if direction is None:
            return None
        what = f"contacts(...)[{name!r}].normal_direction"
        return in_order(what, direction, self._names.coordinates, "numbers")

    def _pushed(self, force: list, at: Instant, c: int, s: Any) -> list[Any]:
        push = self.push_of(at, c)
        if push is None:
            return force
        pressed = where(s == 2.0, 0.0, at.contacts[c].normal_force)
        return [total((f, times(n, pressed))) for f, n in zip(force, push, strict=True)]

    def _motion_of(self, island: Island, at: Instant, states, force, gamma) -> Motion:
        rest = [states[c] == 0.0 for c in island.rows]
        own = [force[j] for j in island.columns]
        return island.motion(
            at.mass.of(island.columns),
            own,
            self._rows(island, at),
            rest,
            [gamma[c] for c in island.rows],
        )

    @staticmethod
    def _rows(island: Island, at: Instant) -> list[list[Any]]:
        return [[at.directions[c][j] for j in island.columns] for c in island.rows]

    def _static(self, island: Island, at: Instant) -> Limits:
        return _limits([at.contacts[c] for c in island.rows], "static_coefficient")

    # -- hybrid system

    def vector_field(self, t, y, mode, args):
        at, states = self.instant(t, y, args), states_of(mode, len(self.contact_directions))
        for name, contact in zip(self._names.contacts, at.contacts, strict=True):
            check_law(name, contact.law)
        force, gamma = self._loaded(at, states), self._surface_accelerations(t, at, args)
        a: list[Any] = [None] * len(at.force)
        for island in self._islands:
            motion = self._motion_of(island, at, states, force, gamma)
            for j, x in zip(island.columns, motion.acceleration, strict=True):
                a[j] = jnp.asarray(x, jnp.float64)
        return self.from_coordinates(at.v, self._tuple(a))

    def guards(self, t, y, mode, args):
        at, states = self.instant(t, y, args), states_of(mode, len(self.contact_directions))
        force, gamma = self._loaded(at, states), self._surface_accelerations(t, at, args)
        own: list[Any] = [None] * len(at.contacts)
        shared = []
        for island in self._islands:
            if not island.rows:
                continue
            motion = self._motion_of(island, at, states, force, gamma)
            limits = self._static(island, at)
            rest = [states[c] == 0.0 for c in island.rows]
            slip = [states[c] * at.speeds[c] for c in island.rows]
            if island.dependent:
                tied = island.tied(rest)
                for c, r, covered, u in zip(island.rows, rest, tied, slip, strict=True):
                    own[c] = where(r | covered, 1.0, u)
                share = island.onset(*limits, rest, motion)[0]
                shared.append(1.0 - jnp.minimum(share, MOST_SHARE))
            else:
                for i, c in enumerate(island.rows):
                    low, high = limits.low[i], limits.high[i]
                    borne = motion.force[i]
                    if at.contacts[c].law.is_odd:
                        reserve = high - jnp.abs(borne)
                    else:
                        reserve = jnp.minimum(high - borne, borne - low)
                    own[c] = where(rest[i], reserve, slip[i])
        opens = []
        for name in self.opening:
            c = self._names.contacts.index(name)
            opens.append(where(states[c] == 2.0, -1.0, 1.0) * at.contacts[c].normal_force)
            own[c] = where(states[c] == 2.0, 1.0, own[c])
        lifts = [at.contacts[c].normal_force for c in self._lifting]
        return tuple(jnp.asarray(x, jnp.float64) for x in (*own, *shared, *opens, *lifts))

    def transition(self, t, y, mode, guard, args):
        count = len(self.contact_directions)
        at, states = self.instant(t, y, args), states_of(mode, count)
        force, gamma = self._loaded(at, states), self._surface_accelerations(t, at, args)
        v, new = [jnp.asarray(x, jnp.float64) for x in at.v], list(states)
        shared, opens = count, count + len(self._shared)
        toggled = {name: guard == opens + k for k, name in enumerate(self.opening)}
        failed = guard >= opens + len(toggled)
        for island in self._islands:
            if not island.rows:
                continue
            s = [states[c] for c in island.rows]
            rest = [x == 0.0 for x in s]
            hit = [guard == c for c in island.rows]
            motion = self._motion_of(island, at, states, force, gamma)
            motion = jax.tree.map(lambda x: lax.stop_gradient(x), motion)
            if island.dependent:
                gives_way = guard == shared
                shared += 1
                _, released = island.onset(*lax.stop_gradient(self._static(island, at)), rest, motion)
                stops = any_of(hit)
            else:
                released = [
                    where(h & r, where(borne > 0.0, -1.0, 1.0), 0.0)
                    for h, r, borne in zip(hit, rest, motion.force, strict=True)
                ]
                gives_way = any_of(h & r for h, r in zip(hit, rest, strict=True))
                stops = any_of(hit) & ~gives_way
            now = [where(gives_way & r, way, x) for r, way, x in zip(rest, released, s, strict=True)]
            started = [gives_way & r & (way != 0.0) for r, way in zip(rest, released, strict=True)]
            touched = stops | gives_way
            # What stops, rests at once, with all that has no speed then; the law decides what stays.
            stopped = [r | (h & stops) for r, h in zip(rest, hit, strict=True)]
            still = island.closed(stopped, self._slow(at, island))
            now = [where(stops & x, 0.0, s) for x, s in zip(still, now, strict=True)]
            landed = self._landed(island, at, still)
            for j, x in zip(island.columns, landed, strict=True):
                v[j] = where(stops, x, v[j])
            for i, c in enumerate(island.rows):
                name = self._names.contacts[c]
                if name in toggled:
                    closes = where(self._slow(at, island)[i], 0.0, jnp.sign(at.speeds[c]))
                    after = where(s[i] == 2.0, closes, 2.0)
                    now[i] = where(toggled[name], after, now[i])
                    touched = touched | toggled[name]
            found, ended = self._settled(at, island, states, now, started, gamma, touched)
            failed = failed | (touched & ~ended)
            for c, x in zip(island.rows, found, strict=True):
                new[c] = where(touched, x, new[c])
        mode = mode_of(new)
        return self.from_coordinates(at.q, self._tuple(v)), where(
            failed, jnp.asarray(NO_MODE, mode.dtype), mode
        )

    @looks_at(t=reals, y=some_state)
    def initial_mode(self, t, y, args):
        at = self.instant(t, y, args)
        gamma = self._surface_accelerations(t, at, args)
        states = [jnp.sign(u) for u in at.speeds]
        failed = jnp.zeros((), bool)
        for c in self._lifting:
            failed = failed | (at.contacts[c].normal_force < 0.0)
        for name in self.opening:
            c = self._names.contacts.index(name)
            pressing = self._pressing(t, at, c, args)
            states[c] = where(pressing, states[c], 2.0)
        for island in self._islands:
            if not island.rows:
                continue
            slow = self._slow(at, island)
            now = [
                where(x & (states[c] != 2.0), 0.0, states[c])
                for x, c in zip(slow, island.rows, strict=True)
            ]
            none = [jnp.zeros_like(x) for x in slow]
            found, ended = self._settled(at, island, states, now, none, gamma, ~none[0])
            failed = failed | ~ended
            for c, x in zip(island.rows, found, strict=True):
                states[c] = x
        mode = mode_of(states)
        return where(failed, jnp.asarray(NO_MODE, mode.dtype), mode)

    def _pressing(self, t, at: Instant, c: int, args) -> Any:
        """Whether contact `c` presses now, or in an instant."""

        def load(t, q):
            return (
                jnp.asarray(self._instant(t, q, at.v, args).contacts[c].normal_force, jnp.float64)
                + 0.0 * t
            )

        t = jnp.asarray(t, jnp.float64)
        now, rate = jax.jvp(load, (t, at.q), (jnp.ones_like(t), self._tuple(at.v)))
        return (now > 0.0) | ((now == 0.0) & (rate > 0.0))

    def _slow(self, at: Instant, island: Island) -> list[Any]:
        """Whether a sliding speed is rounding of its terms."""
        terms = [
            total((*(jnp.abs(times(n, x)) for n, x in zip(at.directions[c], at.v, strict=True) if not is_zero(n)),
                   jnp.abs(jnp.asarray(at.contacts[c].surface_speed))))
            for c in island.rows
        ]  # fmt: skip
        largest = terms[0]
        for term in terms[1:]:
            largest = jnp.maximum(largest, term)
        return [jnp.abs(at.speeds[c]) <= ROUNDING * largest for c in island.rows]

    def _landed(self, island: Island, at: Instant, still: list) -> list[Any]:
        """Velocities of the island with the contacts in `still` exactly at rest."""
        v = [jnp.asarray(at.v[j], jnp.float64) for j in island.columns]
        rows = self._rows(island, at)
        if not island.alone:
            v = island.project(
                at.mass.of(island.columns), v, rows, still, [at.speeds[c] for c in island.rows]
            )
        for row, c, rests in zip(rows, island.rows, still, strict=True):
            own = [j for j, n in enumerate(row) if not is_zero(n)]
            if len(own) == 1:
                (j,) = own
                v[j] = where(rests, times(1.0 / row[j], at.contacts[c].surface_speed), v[j])
        return v

    def _settled(self, at, island, states, now, started, gamma, active) -> tuple[list[Any], Any]:
        standing = [(s == 0.0) | b for s, b in zip(now, started, strict=True)]
        without = [jnp.zeros_like(active)] * len(states)
        given = list(states)
        for c, stands, s in zip(island.rows, standing, now, strict=True):
            without[c], given[c] = stands, s
        force = self._loaded(at, given, without)
        own = [at.contacts[c] for c in island.rows]
        return settled(
            island,
            at.mass.of(island.columns),
            [force[j] for j in island.columns],
            self._rows(island, at),
            [gamma[c] for c in island.rows],
            _limits(own, "static_coefficient"),
            _limits(own, "kinetic_limit"),
            now,
            started,
            active,
        )

    def check_start(self, t: Any, y: Any, args: Any) -> None:
        """Raise `ValueError` for a contact that pulls at the start: no motion begins with it."""
        fixed = [c for c, name in enumerate(self._names.contacts) if name not in self.opening]
        if fixed and is_concrete((self, t, y, args)):
            for c, load in zip(fixed, _loads_at(self, t, y, args), strict=True):
                check_load(self._names.contacts[c], load)

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

    # -- energy and observables

    @looks_at(y=some_state)
    def energy(self, y):
        """Kinetic and potential energy [J]."""
        q, v = self.to_coordinates(y)
        momentum = mass_of(self.mass_matrix(q), self._names.coordinates).times(v)
        return total((0.5 * dot(v, momentum), self.potential_energy(q)))

    @looks_at(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        r"""Powers into the energy [W], by name.

        `forces`: of all declared forces but those that `potential_energy` accounts for;
        `friction of NAME`, the loss $\lambda u$ in a contact; `drive of NAME`, the work $\lambda w$ of
        its counter surface.
        """
        at = self.instant(t, y, args)
        found = {"forces": self.declared_power(at, states_of(mode, len(at.contacts)))}
        friction = self.friction_forces(t, y, mode, args)
        for c, name in enumerate(self._names.contacts):
            found[f"friction of {name}"] = friction[name] * at.speeds[c]
            if not is_zero(at.contacts[c].surface_speed):
                found[f"drive of {name}"] = friction[name] * at.contacts[c].surface_speed
        return found

    def declared_power(self, at: Instant, states: list) -> Any:
        """Power of all forces but friction, less what the potential and the changing inertia take."""
        force = list(at.force)
        for c, s in enumerate(states):
            force = self._pushed(force, at, c, s)

        def stored(q):
            momentum = mass_of(self.mass_matrix(q), self._names.coordinates).times(at.v)
            zero = 0.0 * jnp.asarray(q[0], jnp.float64)
            return total((0.5 * dot(at.v, momentum), self.potential_energy(q), zero))

        q = jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), at.q)
        v = jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), at.v)
        _, rate = jax.jvp(stored, (q,), (v,))
        return total((dot(force, at.v), rate))

    @looks_at(**OBSERVABLE)
    def friction_forces(self, t, y, mode, args=None) -> dict[str, Any]:
        """Friction on the mechanism along each contact [N], by name.

        Contacts at rest with dependent directions share a load in no unique way: those that lead bear
        all of it.
        """
        at, states = self.instant(t, y, args), states_of(mode, len(self.contact_directions))
        force, gamma = self._loaded(at, states), self._surface_accelerations(t, at, args)
        found: dict[str, Any] = dict.fromkeys(self._names.contacts)
        for island in self._islands:
            motion = self._motion_of(island, at, states, force, gamma)
            for c, borne in zip(island.rows, motion.force, strict=True):
                contact, s = at.contacts[c], states[c]
                slips = contact.law.slip_force(at.speeds[c], contact.normal_force, sense_of(s))
                name = self._names.contacts[c]
                found[name] = where(s == 0.0, borne, where(s == 2.0, 0.0, slips))
        return found

    @looks_at(**OBSERVABLE)
    def normal_forces(self, t, y, mode=0, args=None) -> dict[str, Any]:
        """Normal force in each contact [N], by name; 0 where it is open."""
        at, states = self.instant(t, y, args), states_of(mode, len(self.contact_directions))
        return {
            name: where(s == 2.0, 0.0, contact.normal_force)
            for name, contact, s in zip(self._names.contacts, at.contacts, states, strict=True)
        }

    @looks_at(**OBSERVABLE)
    def relative_velocities(self, t, y, mode=0, args=None) -> dict[str, Any]:
        """Sliding speed of each contact [m/s], by name."""
        return dict(zip(self._names.contacts, self.instant(t, y, args).speeds, strict=True))


@eqx.filter_jit
def _loads_at(mechanism: AbstractMechanism, t, y, args) -> list[Any]:
    at, names = mechanism.instant(t, y, args), mechanism._names
    loads = zip(names.contacts, at.contacts, strict=True)
    return [jnp.asarray(c.normal_force, jnp.float64) for name, c in loads if name not in names.opening]


def _limits(contacts: list[Contact], which: str) -> Limits:
    """Friction that each contact can bear, by the coefficient of its law named `which`."""
    low, high = [], []
    for contact in contacts:
        ahead = getattr(contact.law, which)(1) * contact.normal_force
        behind = ahead if contact.law.is_odd else getattr(contact.law, which)(-1) * contact.normal_force
        low.append(-ahead)
        high.append(behind)
    return Limits(low, high)


def _per_second(unit: str) -> str:
    return {"1": "1/s"}.get(unit, f"{unit}/s")
