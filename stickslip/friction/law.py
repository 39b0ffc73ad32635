"""Interface of every friction law to a mechanism, whatever its form."""

import abc
from typing import TYPE_CHECKING, Any, cast

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, ArrayLike, Float, Real

from stickslip._argument_checks import Check, check_arguments, check_own_methods, reals, senses
from stickslip._fastmath import side_of, where
from stickslip._show import AbstractShown
from stickslip._validation import check_type, refusal

Number = Real[ArrayLike, "..."]
State = tuple[Float[Array, "..."], ...]
GivenState = tuple[Number, ...]


def in_dtype_of(v: Number, *values: Number) -> tuple[Float[Array, "..."], ...]:
    """All arguments in the floating-point type of `v`, so that the type of the motion is kept."""
    v = jnp.asarray(v)
    dtype = v.dtype if jnp.issubdtype(v.dtype, jnp.floating) else jnp.dtype(jnp.float64)
    return tuple(lax.convert_element_type(x, dtype) for x in (v, *values))


def shaped_like(v: Float[Array, "..."], value: Float[Array, "..."]) -> Float[Array, "..."]:
    """`value` in the common shape of both, for laws that do not depend on `v`."""
    return jnp.broadcast_to(value, lax.broadcast_shapes(v.shape, value.shape))


def deformation(law: "AbstractFrictionLaw", name: str, value: Any) -> Any:
    """The internal state of a law: as many numbers, or arrays of them, as it has states."""
    count = law.num_states
    if not isinstance(value, tuple | list) or len(value) != count:
        raise refusal(name, value, f"the internal state of {type(law).__name__}, a tuple of {count}")
    return tuple(reals(law, f"{name}[{i}]", item) for i, item in enumerate(value))


# Arguments of the methods that a law defines, in order.
_CHECKED: dict[str, dict[str, Check]] = {
    "kinetic": {"v": reals, "sense": senses},
    "static_coefficient": {"sense": senses},
    "drag": {"v": reals},
    "steady_state": {"v": reals},
    "steady_magnitude": {"v": reals, "sense": senses},
    "state_rate": {"v": reals, "state": deformation},
    "coefficient_from_state": {"v": reals, "state": deformation},
}


class AbstractFrictionLaw(AbstractShown):
    r"""Dry friction between two bodies in contact.

    With the relative velocity $v$ [m/s] of the body and the normal force $N \ge 0$ [N], the force
    on the body is

    $$T = -\mu(v)\,N - d(v)$$

    with the signed friction coefficient $\mu$ (`coefficient`) and the part $d$ [N] that does not
    scale with the normal force (`drag`). The same object serves four uses:

    - **Set-valued**, for event-driven simulation (`set_valued` is true). At rest the coefficient is
      any number in `static_interval()`. A slip mode knows its sense, +1 or -1, and takes
      `kinetic(v, sense)`: the branch of that sense, continued smoothly a little beyond $v = 0$, so
      that the vector field of the mode is smooth where its guard $v$ changes sign. For trial steps
      that land far beyond, the continuation is bounded wherever the law is.
    - **Smooth**, for ordinary solvers: `coefficient(v)`, continuous through $v = 0$.
    - **Bristle**, with internal states (`num_states` > 0): `coefficient_from_state(v, state)` and
      `state_rate(v, state)`; then `coefficient` is that of steady sliding. These methods exist for
      every law, with an empty state where there is none.
    - **Approximated or not**: `set_valued_limit()` is the set-valued law that a smooth or bristle law
      approximates.

    Claims (`is_odd`, `is_dissipative`) hold for all parameters the constructor accepts;
    `check_friction_law` verifies them. Parameters are float64 arrays: batch, trace and
    differentiate them as any leaf of a pytree. The result has the floating-point type of `v`.

    **Raises**, in all methods and in those of subclasses: `TypeError` or `ValueError` naming the
    argument, its value and what is allowed. Infinite and NaN velocities are allowed, as logs have them.

    Velocities come one alone or as a row or any other array of them: a method takes each by itself and
    returns the same shape. A function of one number, as a network, is made so by `jnp.vectorize`;
    otherwise `jnp.dot` says that shapes differ (`dot_general requires contracting dimensions ...`).

    To write your own law, subclass `AbstractDryFrictionLaw`: three properties and three methods.
    """

    def __init_subclass__(cls, **kwargs: Any):
        super().__init_subclass__(**kwargs)
        check_own_methods(cls, _CHECKED)

    if TYPE_CHECKING:
        # A type checker lets a subclass have either properties or attributes of the class in place of
        # what is annotated here; without annotations it lets it have both.
        set_valued = is_odd = is_dissipative = cast("bool", False)
        num_states = cast("int", 0)
    else:

        @property
        @abc.abstractmethod
        def set_valued(self) -> bool:
            """Whether the coefficient at rest is an interval."""

        @property
        @abc.abstractmethod
        def is_odd(self) -> bool:
            """Whether friction is the same in both directions."""

        @property
        @abc.abstractmethod
        def is_dissipative(self) -> bool:
            """Whether steady sliding never feeds energy into the motion."""

        @property
        @abc.abstractmethod
        def num_states(self) -> int:
            """Number of internal states."""

    @abc.abstractmethod
    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        """Signed coefficient of the branch that slips in `sense` (+1 or -1), smooth through v = 0.

        Equal to `coefficient(v)` wherever `v` has the sign of `sense`.
        """

    @abc.abstractmethod
    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        """Magnitude that the coefficient must exceed to start slip in `sense`.

        Never below `kinetic_limit(sense)`: where a law states a static coefficient below the
        kinetic one, slip could start only to be stopped at once, and sticking goes on up to the
        kinetic one (Filippov's sliding mode). For a smooth law, that of its set-valued limit.
        """

    @abc.abstractmethod
    def drag(self, v: Number) -> Float[Array, "..."]:
        """Part of the resistance that does not depend on the normal force [N], signed as `v`."""

    @abc.abstractmethod
    def set_valued_limit(self) -> "AbstractFrictionLaw":
        """The law this one tends to as its regularisation vanishes; itself where there is none."""

    @abc.abstractmethod
    def steady_state(self, v: Number) -> State:
        """Internal state of steady sliding at `v`; zero, undeformed, at rest."""

    @abc.abstractmethod
    def state_rate(self, v: Number, state: GivenState) -> State:
        """Time derivative of the internal state."""

    @abc.abstractmethod
    def coefficient_from_state(self, v: Number, state: GivenState) -> Float[Array, "..."]:
        """Signed coefficient for the internal state; `coefficient(v)` where there is none."""

    @check_arguments(v=reals)
    def coefficient(self, v: Number) -> Float[Array, "..."]:
        """Signed friction coefficient at relative velocity `v` [m/s], of steady sliding.

        Exactly 0 at v = 0: for a set-valued law that is one choice out of `static_interval()`.
        The derivative there is that of the smooth curve, or 0 where the law jumps.
        """
        (v,) = in_dtype_of(v)
        jumps = self.set_valued or self.num_states > 0
        return self.kinetic(v, lax.sign(v) if jumps else side_of(v))

    @check_arguments(sense=senses)
    def kinetic_limit(self, sense: Number = 1) -> Float[Array, "..."]:
        """Magnitude of the coefficient as slip in `sense` begins, the limit v -> 0; 0 if smooth."""
        zero, sense = in_dtype_of(0.0, sense)
        return sense * self.kinetic(zero, sense)

    @check_arguments(sense=senses)
    def breakaway_jump(self, sense: Number = 1) -> Float[Array, "..."]:
        """How far the static coefficient lies above the coefficient as slip in `sense` begins."""
        return self.static_coefficient(sense) - self.kinetic_limit(sense)

    def static_interval(self) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
        """Coefficients at rest, lowest and highest; the body slips forward above the highest."""
        return -self.static_coefficient(-1), self.static_coefficient(1)

    @check_arguments(v=reals, normal_force=reals)
    def force(self, v: Number, normal_force: Number) -> Float[Array, "..."]:
        """Friction force on the body [N], from `coefficient` and `drag`."""
        v, normal_force = in_dtype_of(v, normal_force)
        return -(self.coefficient(v) * normal_force + self.drag(v))

    @check_arguments(v=reals, normal_force=reals, sense=senses)
    def slip_force(self, v: Number, normal_force: Number, sense: Number) -> Float[Array, "..."]:
        """Friction force on the body [N] in the mode slipping in `sense`, smooth through v = 0."""
        v, normal_force = in_dtype_of(v, normal_force)
        return -(self.kinetic(v, sense) * normal_force + self.drag(v))

    @check_arguments(v=reals, normal_force=reals, state=deformation)
    def force_from_state(
        self, v: Number, normal_force: Number, state: GivenState
    ) -> Float[Array, "..."]:
        """Friction force on the body [N] for an internal state."""
        v, normal_force = in_dtype_of(v, normal_force)
        return -(self.coefficient_from_state(v, state) * normal_force + self.drag(v))


def jump_in(law: AbstractFrictionLaw, sense: Float[Array, "..."]) -> Float[Array, "..."]:
    """`law.breakaway_jump(sense)` evaluated once per direction instead of once per lane."""
    forward = law.breakaway_jump(1)
    return forward if law.is_odd else where(sense < 0, law.breakaway_jump(-1), forward)


class AbstractMemorylessLaw(AbstractFrictionLaw):
    """Friction that depends on the present velocity alone."""

    @property
    def num_states(self) -> int:
        return 0

    def steady_state(self, v: Number) -> State:
        return ()

    def state_rate(self, v: Number, state: GivenState) -> State:
        return ()

    def coefficient_from_state(self, v: Number, state: GivenState) -> Float[Array, "..."]:
        return self.coefficient(v)


class AbstractDryFrictionLaw(AbstractMemorylessLaw):
    """Memoryless friction proportional to the normal force."""

    def drag(self, v: Number) -> Float[Array, "..."]:
        (v,) = in_dtype_of(v)
        return lax.full_like(v, 0.0)


class AbstractSmoothedLaw(AbstractFrictionLaw):
    """A smooth stand-in for a set-valued law: its static coefficient, its drag, its symmetry."""

    law: eqx.AbstractVar[AbstractFrictionLaw]

    @property
    def set_valued(self) -> bool:
        return False

    @property
    def is_odd(self) -> bool:
        return self.law.is_odd

    @property
    def is_dissipative(self) -> bool:
        return self.law.is_dissipative

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return self.law.static_coefficient(sense)

    def drag(self, v: Number) -> Float[Array, "..."]:
        return self.law.drag(v)

    def set_valued_limit(self) -> AbstractFrictionLaw:
        return self.law


def check_law(name: str, law: Any, kind: str = "") -> Any:
    """A friction law; of a `kind`, `"set-valued"` or `"smooth"`, and without state if given."""
    check_type(name, law, AbstractFrictionLaw, "a friction law of stickslip.friction")
    if kind and (law.num_states > 0 or law.set_valued != (kind == "set-valued")):
        raise refusal(name, law, f"a {kind} law without internal state")
    return law
