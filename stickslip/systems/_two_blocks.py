"""Two coupled blocks on one moving belt."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip._fastmath import where
from stickslip._looks_at import OBSERVABLE, looks_at, modes, reals, state
from stickslip._types import Whole
from stickslip._validation import as_parameter, check_finite, check_nonnegative, check_positive
from stickslip.systems._mechanical import (
    SLIP_MODES,
    AbstractMechanicalSystem,
    Number,
    contact_mode,
    holding_force,
    mode_at_rest,
    slip_sense,
)


class PairMotion(NamedTuple):
    """State of two points: positions `x_1`, `x_2` [m] and velocities `v_1`, `v_2` [m/s]."""

    x_1: Any
    v_1: Any
    x_2: Any
    v_2: Any


class TwoBlocksOnBelt(AbstractMechanicalSystem):
    r"""Two stick-slip oscillators on one belt, coupled by a spring.

    $$m_i\ddot x_i = q_i + T_i, \qquad q_i = -k_i x_i - k_c\,(x_i - x_j)$$

    with Coulomb friction $T_i$ between block and belt as in `CoulombOscillator`: $-F_{k,i}$ times
    the sense of the slip, or $-q_i$ in stick as long as $|q_i| \le \max(F_{s,i}, F_{k,i})$.

    - State `PairMotion`: `x_1`, `x_2` [m] from the unloaded springs, `v_1`, `v_2` [m/s].
    - Modes: nine, the mode of block 1 and the mode of block 2, numbered `3 * first + second`.
    - Guards: for each block the distance of its load to the limits of static friction [N], which the
      other block can drive in either sense, and its relative speed [m/s].
    - Closed form: linear with constant coefficients in every mode. Without coupling two
      `CoulombOscillator`s; alike and alike started, both blocks have their events at one instant.

    **Arguments:**

    - `mass_1`, `mass_2` [kg], positive; `stiffness_1`, `stiffness_2` and `coupling` $k_c$ [N/m], not
      negative.
    - `static_force_1`, `static_force_2`, `kinetic_force_1`, `kinetic_force_2` [N], not negative.
    - `belt_speed` [m/s], of either sign.

    ??? cite "Reference"

        U. Galvanetto, S. R. Bishop, "Dynamics of a simple damped oscillator undergoing stick-slip
        vibrations", Meccanica 34, 1999, and U. Galvanetto, "Some discontinuous bifurcations in a
        two-block stick-slip system", Journal of Sound and Vibration 248, 2001.
    """

    mass_1: Float[Array, "..."]
    mass_2: Float[Array, "..."]
    stiffness_1: Float[Array, "..."]
    stiffness_2: Float[Array, "..."]
    coupling: Float[Array, "..."]
    static_force_1: Float[Array, "..."]
    static_force_2: Float[Array, "..."]
    kinetic_force_1: Float[Array, "..."]
    kinetic_force_2: Float[Array, "..."]
    belt_speed: Float[Array, "..."]

    mode_names: ClassVar = tuple(f"{one} / {two}" for one in SLIP_MODES for two in SLIP_MODES)
    guard_names: ClassVar = (
        "friction of block 1 reaches its limit",
        "block 1 reaches the speed of the belt",
        "friction of block 2 reaches its limit",
        "block 2 reaches the speed of the belt",
    )
    units: ClassVar = {"x_1": "m", "v_1": "m/s", "x_2": "m", "v_2": "m/s"}

    def __init__(
        self,
        *,
        mass_1: Number,
        mass_2: Number,
        stiffness_1: Number,
        stiffness_2: Number,
        coupling: Number,
        static_force_1: Number,
        static_force_2: Number,
        kinetic_force_1: Number,
        kinetic_force_2: Number,
        belt_speed: Number,
    ):
        self.mass_1 = as_parameter(check_positive("mass_1", mass_1))
        self.mass_2 = as_parameter(check_positive("mass_2", mass_2))
        self.stiffness_1 = as_parameter(check_nonnegative("stiffness_1", stiffness_1))
        self.stiffness_2 = as_parameter(check_nonnegative("stiffness_2", stiffness_2))
        self.coupling = as_parameter(check_nonnegative("coupling", coupling))
        self.static_force_1 = as_parameter(check_nonnegative("static_force_1", static_force_1))
        self.static_force_2 = as_parameter(check_nonnegative("static_force_2", static_force_2))
        self.kinetic_force_1 = as_parameter(check_nonnegative("kinetic_force_1", kinetic_force_1))
        self.kinetic_force_2 = as_parameter(check_nonnegative("kinetic_force_2", kinetic_force_2))
        self.belt_speed = as_parameter(check_finite("belt_speed", belt_speed))

    @looks_at(y=state)
    def loads(self, y: PairMotion) -> tuple[Any, Any]:
        """Force of the springs on each block [N]."""
        between = self.coupling * (y.x_1 - y.x_2)
        return -self.stiffness_1 * y.x_1 - between, -self.stiffness_2 * y.x_2 + between

    def limits(self) -> tuple[Any, Any]:
        """Largest friction force at rest of each block [N]."""
        return (
            holding_force(self.static_force_1, self.kinetic_force_1),
            holding_force(self.static_force_2, self.kinetic_force_2),
        )

    @looks_at(y=state, mode=modes)
    def frictions(self, y: PairMotion, mode: Whole) -> tuple[Any, Any]:
        """Force of the belt on each block [N]."""
        kinetic = (self.kinetic_force_1, self.kinetic_force_2)
        pairs = zip(_each(mode), self.loads(y), kinetic, strict=True)
        one, two = (where(m == 1, -load, -slip_sense(m) * force) for m, load, force in pairs)
        return one, two

    def vector_field(self, t, y, mode, args):
        one, two = _each(mode)
        (load_1, load_2), (friction_1, friction_2) = self.loads(y), self.frictions(y, mode)
        return PairMotion(
            x_1=y.v_1,
            v_1=where(one == 1, 0.0, (load_1 + friction_1) / self.mass_1),
            x_2=y.v_2,
            v_2=where(two == 1, 0.0, (load_2 + friction_2) / self.mass_2),
        )

    def guards(self, t, y, mode, args):
        values = ()
        contacts = zip(_each(mode), self.loads(y), self.limits(), (y.v_1, y.v_2), strict=True)
        for m, load, limit, v in contacts:
            reserve = where(m == 1, limit - jnp.abs(load), 1.0)
            speed = where(m == 1, 1.0, slip_sense(m) * (v - self.belt_speed))
            values = (*values, reserve, speed)
        return values

    def transition(self, t, y, mode, guard, args):
        # At a limit the load equals it up to rounding, which must not decide that the block stays.
        moves = [where(load > 0.0, 2, 0) for load in self.loads(y)]
        stays = [
            mode_at_rest(load, limit) for load, limit in zip(self.loads(y), self.limits(), strict=True)
        ]
        old = _each(mode)
        one = where(guard == 0, moves[0], where(guard == 1, stays[0], old[0]))
        two = where(guard == 2, moves[1], where(guard == 3, stays[1], old[1]))
        return y._replace(
            v_1=where(guard <= 1, self.belt_speed, y.v_1),
            v_2=where(guard >= 2, self.belt_speed, y.v_2),
        ), 3 * one + two

    @looks_at(t=reals, y=state)
    def initial_mode(self, t, y, args):
        contacts = zip((y.v_1, y.v_2), self.loads(y), self.limits(), strict=True)
        one, two = (contact_mode(v - self.belt_speed, load, limit) for v, load, limit in contacts)
        return 3 * one + two

    @looks_at(y=state)
    def energy(self, y):
        """Kinetic energy and energy of the three springs [J]."""
        return 0.5 * (
            self.mass_1 * y.v_1**2
            + self.mass_2 * y.v_2**2
            + self.stiffness_1 * y.x_1**2
            + self.stiffness_2 * y.x_2**2
            + self.coupling * (y.x_1 - y.x_2) ** 2
        )

    @looks_at(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """`belt`: work of the drive; `friction_1`, `friction_2`: losses in the contacts [W]."""
        one, two = self.frictions(y, mode)
        return {
            "belt": (one + two) * self.belt_speed,
            "friction_1": one * (y.v_1 - self.belt_speed),
            "friction_2": two * (y.v_2 - self.belt_speed),
        }


def _each(mode: Any) -> tuple[Any, Any]:
    """Modes of block 1 and block 2."""
    first = where(mode >= 6, 2, where(mode >= 3, 1, 0))
    return first, jnp.asarray(mode, first.dtype) - 3 * first
