"""The same mechanism with friction that is smooth: regularised laws, or bristles with their states."""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from stickslip._argument_checks import OBSERVABLE, check_arguments, reals
from stickslip._fastmath import where
from stickslip._types import Given, Numeric
from stickslip._validation import (
    DeclarationError,
    as_parameter,
    check_in,
    check_positive,
    check_type,
    refusal,
)
from stickslip.friction import AbstractBristleLaw, AbstractFrictionLaw, LuGre, Regularised
from stickslip.hybrid.status import NO_MODE

from ._contact import drags
from ._instant import Instant, pressing
from ._laws import drives
from ._observables import AbstractWithObservables
from ._planar_smooth import Planes
from ._scalars import times, total
from .account import AbstractMechanicalSystem

KINDS = ("tanh", "sqrt", "arctan")


class _AbstractSmoothForm(AbstractMechanicalSystem):
    """A mechanism whose contacts have no modes: what its two smooth forms share.

    A contact that does not open and loses its normal force ends the run, as in the other form.
    """

    mechanism: eqx.AbstractVar[AbstractWithObservables]

    mode_names: ClassVar = ("motion",)

    @property
    def periods(self) -> Mapping[str, float]:
        """Those of the mechanism."""
        return self.mechanism.periods

    @abc.abstractmethod
    def bare(self, y: PyTree) -> Any:
        """The state of the mechanism in a state `y` of this form."""

    @property
    def guard_names(self) -> tuple[str, ...]:
        """One of each contact that does not open and may lose its normal force."""
        names = self.mechanism.names.contacts
        return tuple(f"{names[c]} loses its normal force" for c in self.mechanism.structure.lifting)

    def time_scale(self, args):
        """That of the mechanism."""
        return self.mechanism.time_scale(args)

    def check_start(self, t, y, mode, args):
        """As that of the mechanism, of which these modes are none."""
        self.mechanism.check_start(t, self.bare(y), None, args)

    def switches_in(self, t, y, mode, args):
        """Those of the mechanism."""
        return self.mechanism.switches_in(t, self.bare(y), mode, args)

    def guards(self, t, y, mode, args):
        at = self.mechanism.instant(t, self.bare(y), args)
        loads = (at.contacts[c].normal_force for c in self.mechanism.structure.lifting)
        return tuple(jnp.asarray(load, jnp.float64) for load in loads)

    def transition(self, t, y, mode, guard, args):
        return y, jnp.full_like(mode, NO_MODE)

    @check_arguments(t=reals)
    def initial_mode(self, t, y, args):
        mode = jnp.zeros((), jnp.int32)
        at = self.mechanism.instant(t, self.bare(y), args)
        none = drives(at.contacts, at.speeds)
        for load in self.guards(t, y, mode, args):
            none = none | (load < 0.0)
        return where(none, jnp.full_like(mode, NO_MODE), mode)

    def _motion(self, at: Instant, friction: list) -> tuple[Any, Any]:
        """Rates of coordinates and velocities under the friction of all contacts."""
        force = list(at.force)
        for c, (n, f) in enumerate(zip(at.directions, friction, strict=True)):
            force = [total((g, times(x, f))) for g, x in zip(force, n, strict=True)]
            push = at.pushes[c]
            if push is not None:
                pressed = pressing(at.contacts[c].normal_force)
                force = [total((g, times(x, pressed))) for g, x in zip(force, push, strict=True)]
        a = [jnp.asarray(x, jnp.float64) for x in at.mass.solve(force)]
        return at.q_rate, type(at.v)(*a)


class RegularisedMechanism(_AbstractSmoothForm):
    r"""A mechanism whose set-valued laws are `Regularised`: one mode, contacts creep.

    `AbstractMechanism.regularised` makes it. Laws that are smooth already are kept. The
    motion tends to that of the mechanism as `v_reg` goes to 0, and becomes stiff: the rate of the
    contact is the friction force over `v_reg` and the mass.

    - State: that of the mechanism.
    - A contact that may open has the normal force $\max(N, 0)$; any other ends the run with
      `RESULTS.no_admissible_mode` where it loses its normal force.
    - Rigid stops have impacts, and no smooth form: a mechanism with stops raises an error.

    **Arguments:** `mechanism`; `v_reg` [m/s], positive; `kind` of the rounding, as in `Regularised`.
    **Raises** `TypeError`, `ValueError` for anything else, and for a law with bristles, by the name of
    its contact.
    """

    mechanism: AbstractWithObservables
    v_reg: Float[Array, "..."]
    kind: Any = eqx.field(static=True)

    def __init__(self, mechanism: Given[AbstractWithObservables], v_reg: Numeric, kind: str = "tanh"):
        self.mechanism = _without_stops(mechanism)
        self.v_reg = as_parameter(check_positive("v_reg", v_reg))
        self.kind = check_in("kind", kind, KINDS)

    @property
    def units(self) -> dict[str, str]:
        """Those of the mechanism."""
        return self.mechanism.units

    parameter_units: ClassVar = {"v_reg": "m/s"}

    def _friction(self, at: Instant) -> list[Any]:
        found, planes = [], Planes(self.mechanism, at)
        for name, contact, u in zip(planes.names, planes.contacts, planes.speeds, strict=True):
            law = contact.law
            if law.num_states:
                why = "a law without internal state; `.bristles()` of the mechanism takes this one"
                raise DeclarationError(str(refusal(f"the law of contact {name!r}", law, why)))
            smooth = Regularised(law, self.v_reg, self.kind) if law.set_valued else law
            load = _load(self.mechanism, name, contact)
            found.append(_friction_under_load(self.mechanism, name, contact, smooth.force(u, load)))
        return planes.along_velocities(found)

    def state(self, **values: Numeric) -> Any:
        """A state by the names of its components, as that of the mechanism."""
        return self.mechanism.state(**values)

    def bare(self, y: PyTree) -> Any:
        """The state itself."""
        return y

    def vector_field(self, t, y, mode, args):
        at = self.mechanism.instant(t, y, args)
        return self.mechanism.from_coordinates(*self._motion(at, self._friction(at)))

    def energy(self, y):
        """Kinetic and potential energy [J]."""
        return self.mechanism.energy(y)

    @check_arguments(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """As `AbstractMechanism.powers`, under the regularised laws [W]."""
        at = self.mechanism.instant(t, y, args)
        return self.mechanism.smooth_powers(at, self._friction(at))


class BristleState(NamedTuple):
    """State `y` of the mechanism, and the deflections `z` of the bristles [m], a tuple a contact."""

    y: Any
    z: tuple


class BristleMechanism(_AbstractSmoothForm):
    r"""A mechanism whose contacts have elastic bristles, LuGre's or Dahl's: sticking is elastic.

    `AbstractMechanism.bristles` makes it. Each set-valued law is wrapped in `kind(law, **parameters)`;
    laws that have bristles already, and smooth ones, are kept. The motion tends to that of the
    mechanism as the stiffness `sigma_0` grows, the damping like its square root.

    - State `BristleState`; `start(y)` makes one with bristles that are not deflected.
    - A contact that may open has the normal force $\max(N, 0)$, and its bristles follow its speed while
      it is open; any other ends the run with `RESULTS.no_admissible_mode` where it loses its
      normal force. Rigid stops raise an error.

    **Arguments:** `mechanism`; `kind`, `LuGre` or `Dahl` or another bristle law; `parameters` of it.
    **Raises** `TypeError`, `ValueError` for anything else; the law itself raises where it cannot wrap
    that of a contact.
    """

    mechanism: AbstractWithObservables
    kind: type[AbstractBristleLaw] = eqx.field(static=True)
    parameters: dict[str, Any]

    def __init__(
        self,
        mechanism: Given[AbstractWithObservables],
        kind: type[AbstractBristleLaw] = LuGre,
        parameters: dict[str, Any] | None = None,
    ):
        self.mechanism = _without_stops(mechanism)
        if not (isinstance(kind, type) and issubclass(kind, AbstractBristleLaw)):
            raise refusal("kind", kind, "LuGre, Dahl or another class of bristle laws", TypeError)
        self.kind = kind
        self.parameters = dict(parameters or {})

    @property
    def units(self) -> dict[str, str]:
        """Those of the mechanism; the deflections are in metres."""
        return self.mechanism.units

    def _law(self, name: str, law: AbstractFrictionLaw) -> AbstractFrictionLaw:
        if law.num_states or not law.set_valued:
            return law
        try:
            return self.kind(law, **self.parameters)
        except (TypeError, ValueError) as refused:
            what = f"the law of contact {name!r}, in {self.kind.__name__}"
            raise DeclarationError(f"{what}: {refused}") from None

    def start(self, y: Any, t: Numeric = 0.0, args: Any = None) -> BristleState:
        """The state `y` of the mechanism with bristles that are not deflected."""
        contacts = self.mechanism.instant(t, y, args).contacts
        pairs = zip(self.mechanism.contact_directions, contacts, strict=True)
        counts = [self._law(name, c.law).num_states for name, c in pairs]
        return BristleState(y, tuple((jnp.zeros(()),) * n for n in counts))

    def _friction(self, at: Instant, z: tuple) -> tuple[list[Any], tuple]:
        forces, rates = [], []
        planes = Planes(self.mechanism, at)
        those = zip(planes.names, planes.contacts, z, strict=True)
        for c, (name, contact, deflection) in enumerate(those):
            law = self._law(name, contact.law)
            load = _load(self.mechanism, name, contact)
            force, rate = planes.bristles(c, law, load, tuple(deflection))
            forces.append(_friction_under_load(self.mechanism, name, contact, force))
            rates.append(rate)
        return forces, tuple(rates)

    def bare(self, y: PyTree) -> Any:
        """The state without the bristles."""
        return y.y

    def vector_field(self, t, y, mode, args):
        at = self.mechanism.instant(t, y.y, args)
        friction, rates = self._friction(at, y.z)
        return BristleState(self.mechanism.from_coordinates(*self._motion(at, friction)), rates)

    def energy(self, y):
        """Kinetic and potential energy [J], without that in the bristles."""
        return self.mechanism.energy(y.y)

    def powers(self, t, y, mode, args):
        """As `AbstractMechanism.powers` [W]; friction counts what the bristles take and give back."""
        at = self.mechanism.instant(t, y.y, args)
        return self.mechanism.smooth_powers(at, self._friction(at, y.z)[0])


def _without_stops(mechanism: Any) -> AbstractWithObservables:
    check_type("mechanism", mechanism, AbstractWithObservables, "an AbstractMechanism")
    if mechanism.stops:
        those = ", ".join(map(repr, mechanism.stops))
        why = "of the event-driven form only: a smooth form has no impacts"
        raise DeclarationError(str(refusal("stops", those, why)))
    return mechanism


def _load(machine: AbstractWithObservables, name: str, contact: Any) -> Any:
    return pressing(contact.normal_force) if name in machine.opening else contact.normal_force


def _friction_under_load(machine: AbstractWithObservables, name: str, contact: Any, force: Any) -> Any:
    """Friction of a contact that may be open: its drag ends with the normal force too."""
    if name not in machine.opening or not drags(contact.law):
        return force
    return where(jnp.asarray(contact.normal_force, jnp.float64) > 0.0, force, 0.0)
