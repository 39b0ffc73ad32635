"""Energy, powers and forces of a mechanism in a state and mode."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from stickslip._argument_checks import OBSERVABLE, check_arguments, modes
from stickslip._argument_checks import state as some_state
from stickslip._fastmath import where
from stickslip._types import Numeric, Whole
from stickslip._validation import is_concrete, refusal

from ._abstract import traced_with
from ._abstract_declaration import AbstractDeclaration
from ._analysis import driven_contacts
from ._declaration import mass_of
from ._instant import Instant, floats, pressing
from ._modes import STOP_WORDS, WORDS
from ._moment import Moment, moment_of
from ._scalars import dot, is_zero, total
from ._structure import Structure, structure_of
from ._two_sided import two_sided_contacts
from ._verbs import held_forces, normal_forces, slip_forces


class AbstractWithObservables(AbstractDeclaration):
    """An `AbstractMechanism` at one instant, and what is observed of it."""

    @property
    def structure(self) -> Structure:
        """All that the declaration says once and for all: names, groups of contacts, guards."""
        return traced_with(structure_of, self)

    @property
    def two_sided_contacts(self) -> tuple[int, ...]:
        """Contacts with a guard for each of the two limits of their friction at rest."""
        return traced_with(two_sided_contacts, self)

    def instant(self, t: Numeric, y: PyTree, args: PyTree) -> Instant:
        """All that the declaration says at time `t` in state `y`."""
        return self._moment(t, y, args).at

    def _moment(self, t: Numeric, y: PyTree, args: PyTree) -> Moment:
        # As arrays: a number of Python would count as structure.
        t, (q, v) = floats((t, self.to_coordinates(y)))
        return moment_of(self, self.structure, t, q, v, args)

    @check_arguments(y=some_state)
    def energy(self, y):
        """Kinetic and potential energy [J]."""
        q, v = self.to_coordinates(y)
        one_shape(v)
        momentum = mass_of(self.mass_matrix(q), self.names.coordinates).times(v)
        return total((0.5 * dot(v, momentum), self.potential_energy(q)))

    @check_arguments(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        r"""Powers into the energy [W], by name.

        `forces`: of all declared forces but those that `potential_energy` accounts for;
        `friction of NAME`, the loss $\lambda u$ in a contact; `drive of NAME`, the work $\lambda w$ of
        its counter surface; `drive of NAME`, likewise, of a stop that moves. Losses at impacts are in
        the log of events.
        """
        at = self.instant(t, y, args)
        found = {"forces": self.declared_power(at, self.states(mode))}
        friction = self.friction_forces(t, y, mode, args)
        moving = traced_with(driven_contacts, (self, args))
        for c, name in enumerate(self.names.contacts):
            found[f"friction of {name}"] = friction[name] * at.speeds[c]
            if name in moving:
                found[f"drive of {name}"] = friction[name] * at.contacts[c].surface_speed
        return {**found, **self.drives_of_stops(t, y, mode, args)}

    def smooth_powers(self, at: Instant, friction: list) -> dict[str, Any]:
        """`powers` of a smooth form of this mechanism [W]: under the `friction` [N], one a contact.

        Whoever overrides `powers` with other names overrides this too.
        """
        closed = [where(pressing(c.normal_force) > 0.0, 0.0, 2.0) for c in at.contacts]
        found = {"forces": self.declared_power(at, closed)}
        for name, contact, u, f in zip(
            self.contact_directions, at.contacts, at.speeds, friction, strict=True
        ):
            found[f"friction of {name}"] = f * u
            found[f"drive of {name}"] = f * contact.surface_speed
        return found

    def declared_power(self, at: Instant, states: PyTree) -> Any:
        """Power of all forces but friction, less what the potential and the changing inertia take."""
        one_shape(at.v)
        force = at.forces_in(states)

        def stored_energy(q):
            momentum = mass_of(self.mass_matrix(q), self.names.coordinates).times(at.v)
            zero = 0.0 * jnp.asarray(at.v[0], jnp.float64)
            return total((0.5 * dot(at.v, momentum), self.potential_energy(q), zero))

        _, rate = jax.jvp(stored_energy, (floats(at.q),), (floats(at.q_rate),))
        return total((dot(force, at.v), rate))

    @check_arguments(mode=modes)
    def contact_states(self, mode: Whole) -> dict[str, Any]:
        """State of each contact and stop in a mode, in the words of `mode_names`, by name.

        A contact is in `"slip backward"`, `"stick"`, `"slip forward"` or `"open"`, a stop `"open"` or
        `"closed"`. An array of modes, as of a log, gives arrays of words of its shape; in mode -1, of
        rows that were never reached, they are empty.

        **Raises** `TypeError` or `ValueError` for anything but known numbers of modes.
        """
        if not is_concrete(mode):
            raise refusal("mode", mode, "known: words are made outside of jit and vmap")
        mode, contacts = np.asarray(mode), self.names.contacts
        found = {}
        for name, state in zip(contacts + self.names.stops, self.states(mode), strict=True):
            state = np.broadcast_to(np.asarray(state), mode.shape).astype(int)
            if name in contacts:
                words = np.array(WORDS)[state + 1]
            else:
                words = np.array(STOP_WORDS)[(state == 0).astype(int)]
            words = np.where(mode < 0, "", words)
            found[name] = words if mode.shape else str(words)
        return found

    @check_arguments(**OBSERVABLE)
    def friction_forces(
        self, t: Numeric, y: PyTree, mode: Whole, args: PyTree = None
    ) -> dict[str, Any]:
        """Friction on the mechanism along each contact [N], by name.

        Contacts at rest with dependent directions share a load in no unique way: those that lead bear
        all of it.
        """
        now, states = self._moment(t, y, args), self.states(mode)
        held, slips = held_forces(now, states), slip_forces(now, states)
        return {
            name: where(states[c] == 0.0, held[c], slips[c])
            for c, name in enumerate(self.names.contacts)
        }

    @check_arguments(**OBSERVABLE)
    def normal_forces(
        self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None
    ) -> dict[str, Any]:
        """Normal force in each contact [N], by name; 0 where it is open."""
        now, states = self._moment(t, y, args), self.states(mode)
        loads, found = normal_forces(now, states), {}
        for c, (name, contact) in enumerate(zip(self.names.contacts, now.at.contacts, strict=True)):
            load = loads.get(c, contact.normal_force)
            found[name] = where(states[c] == 2.0, 0.0, load) if name in self.opening else load
        return found

    @check_arguments(**OBSERVABLE)
    def relative_velocities(
        self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None
    ) -> dict[str, Any]:
        """Sliding speed of each contact, and rate of the gap of each stop [m/s], by name."""
        names = self.names
        speeds = self.instant(t, y, args).speeds
        return dict(zip(names.contacts + names.stops, speeds, strict=True))

    @check_arguments(**OBSERVABLE)
    def stop_forces(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree = None) -> dict[str, Any]:
        """Force of each stop on the mechanism, along the gradient of its gap [N], by name.

        0 where it is open. A stop that shares its load with contacts at rest in no unique way bears
        what those that lead leave to it.
        """
        now, states = self._moment(t, y, args), self.states(mode)
        first, held = len(now.at.contacts), held_forces(now, states)
        return {
            name: where(states[first + k] == 0.0, held[first + k], 0.0)
            for k, name in enumerate(self.stops)
        }

    def drives_of_stops(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> dict[str, Any]:
        """Power of each stop that moves [W], by name, while the mechanism rests on it."""
        stops = self.instant(t, y, args).stops
        moving = [k for k, stop in enumerate(stops) if not is_zero(stop.rate)]
        borne = self.stop_forces(t, y, mode, args) if moving else {}
        names = {k: self.names.stops[k] for k in moving}
        return {f"drive of {name}": -borne[name] * stops[k].rate for k, name in names.items()}


def one_shape(v: Any) -> None:
    """Raise where some coordinates are arrays: sums over them are not those of rows of a log."""
    shapes = {np.shape(x) for x in v}
    if len(shapes) > 1:
        allowed = "one for all; with coordinates that are arrays override `energy` and `declared_power`"
        raise refusal("shapes of the velocities", sorted(shapes), allowed)
