"""DC motor with a worm gear and a belt pulley; dry friction of its own at rest."""

from typing import Any, ClassVar, Literal, NamedTuple, cast, get_args

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float, PyTree

from .._argument_checks import (
    OBSERVABLE,
    Rule,
    check_arguments,
    choice,
    guard_numbers,
    modes,
    or_none,
    parameters,
    reals,
    state,
)
from .._fastmath import where
from .._types import Given, Numeric, Whole
from .._validation import check_at_least, check_in
from ..friction.law import Number
from ..hybrid import AbstractHybridSystem
from ._mechanical import slip_sense, with_scaled

Sign = Literal["consistent", "printed"]

TURNING_BACKWARD, RESTING, TURNING_FORWARD = range(3)  # numbers of the modes

# Constructed: the paper prints no parameters.
DRIVE_A = {
    "L_w": 2e-3, "R_w": 2.0, "k_e": 0.05, "k_m": 0.05, "J_dc": 5e-5, "b": 2e-5, "T_k": 5e-3,
    "rho": 20.0, "eta": 0.6, "J_bp": 1e-4, "r_bp": 0.03,
}  # fmt: skip
# Voltages [V] at which the belt of the coupled model, set A and k3 = 85 N/m, runs at 0.12 m/s on
# average from 100 s to 200 s after a start from rest: what `voltage_for_belt_speed` finds.
U_IN_A: dict[Sign, float] = {"consistent": 4.33807376846, "printed": 4.18995053541}

PARAMETERS: dict[str, Rule] = {
    **dict.fromkeys(("L_w", "R_w", "J_dc", "rho", "eta", "r_bp"), "positive"),
    **dict.fromkeys(("k_e", "k_m", "b", "T_k", "J_bp"), "not negative"),
    "U_in": "finite", "T_st": or_none("finite"),
}  # fmt: skip
# Torques, inertias and the force constant: with the block's parameters, what one factor may multiply.
SCALED = ("k_m", "J_dc", "J_bp", "b", "T_k", "T_st")


class DriveState(NamedTuple):
    """Rotor and winding."""

    omega: Any  # speed of the rotor [rad/s]
    i_w: Any  # current of the winding [A]


class DCDrive(AbstractHybridSystem):
    r"""DC motor that drives the belt through a worm gear, Eqs. (1)-(7).

    $$L_w\dot i_w = U_\mathrm{in} - k_e\omega - R_w i_w \tag{1}$$
    $$\left(J_\mathrm{dc} + \frac{J_\mathrm{bp}}{\eta\rho^2}\right)\dot\omega = k_m i_w
      + \frac{r_\mathrm{bp}}{\eta\rho}T_s - b\,\omega - T_k\,\mathrm{sgn}\,\omega,\qquad
      V_b = \frac{r_\mathrm{bp}}{\rho}\omega \tag{7}$$

    $T_s$ is the friction force of the belt on the block, as in (11); the block pulls the belt with
    $+T_s$. At $\omega = 0$ dry friction holds any torque up to $T_\mathrm{st}$ (3): the modes are
    `"turning backward"`, `"resting"`, `"turning forward"`. A rest that cannot be held is left in the
    sense of the torque.

    **Where the paper contradicts itself**, `"consistent"` is the default and `"printed"` takes the
    paper's sign:

    - `motor_friction` (B-E1): (2), (3) and (7) print $-T_C$ with $T_C = -T_k\,\mathrm{sgn}\,\omega$,
      which accelerates; consistent is $-T_k\,\mathrm{sgn}\,\omega$.
    - `belt_reaction` (B-E2): (4) and (7) print $-T_s$ with the $T_s$ of (11); consistent is $+T_s$, the
      reaction to $-T_s$ on the block. As printed, the pair creates energy.

    A constant efficiency $\eta < 1$ divides the load whatever the direction of the power: it is a loss
    while the motor drives ($T_s\omega < 0$) and a source while it is driven.

    **Stiffness.** The electrical time constant $L_w/R_w$ (1 ms for set A) is far below those of the
    mechanics: explicit methods need steps of about three of it at most, or an implicit diffrax solver
    such as `diffrax.Kvaerno5()`.

    **Parameters** (SI): `L_w` [H], `R_w` [ohm], `J_dc` [kg m^2], `rho`, `eta` [-], `r_bp` [m] positive;
    `k_e` [V s], `k_m` [N m/A], `b` [N m s], `T_k` [N m], `J_bp` [kg m^2] not negative; `T_st` [N m],
    at least `T_k`, which it is if left out; `U_in` [V] finite. The state is `DriveState(omega, i_w)`.

    Alone, the drive turns under the belt force `args` [N] ($T_s$, 0 for `None`).
    `DCDrive.constructed()` has **constructed** parameters; the paper prints none.

    Errors: `ValueError` naming a parameter, its value and what is allowed.

    ??? cite "Reference"

        *Influence of Frequency of Excitation on Bifurcational Behaviour of an Experimental 2-DoF
        Mechanical System with Stick-Slip Friction*, Eqs. (1)-(7).
    """

    L_w: Float[Array, "..."]
    R_w: Float[Array, "..."]
    k_e: Float[Array, "..."]
    k_m: Float[Array, "..."]
    J_dc: Float[Array, "..."]
    b: Float[Array, "..."]
    T_k: Float[Array, "..."]
    T_st: Float[Array, "..."]
    rho: Float[Array, "..."]
    eta: Float[Array, "..."]
    J_bp: Float[Array, "..."]
    r_bp: Float[Array, "..."]
    U_in: Float[Array, "..."]
    motor_friction: Sign = eqx.field(static=True)
    belt_reaction: Sign = eqx.field(static=True)

    parameter_units: ClassVar = {
        "L_w": "H", "R_w": "ohm", "k_e": "V s", "k_m": "N m/A", "J_dc": "kg m2", "b": "N m s",
        "T_k": "N m", "T_st": "N m", "rho": "1", "eta": "1", "J_bp": "kg m2", "r_bp": "m",
        "U_in": "V",
    }  # fmt: skip

    mode_names: ClassVar = ("turning backward", "resting", "turning forward")
    guard_names: ClassVar = (
        "rotor comes to rest",
        "torque reaches the upper static limit",
        "torque reaches the lower static limit",
    )
    guard_scales: ClassVar = (1.0, 1e-3, 1e-3)
    units: ClassVar = {"omega": "rad/s", "i_w": "A"}

    @check_arguments(
        motor_friction=choice(get_args(Sign)), belt_reaction=choice(get_args(Sign))
    )  # fmt: skip
    @parameters(**PARAMETERS)
    def __init__(
        self,
        *,
        L_w: Number,
        R_w: Number,
        k_e: Number,
        k_m: Number,
        J_dc: Number,
        b: Number,
        T_k: Number,
        rho: Number,
        eta: Number,
        J_bp: Number,
        r_bp: Number,
        U_in: Number,
        T_st: Number | None = None,
        motor_friction: Sign = "consistent",
        belt_reaction: Sign = "consistent",
    ):
        if T_st is None:
            self.T_st = self.T_k
        else:
            check_at_least("T_st", T_st, "T_k", T_k)
        self.motor_friction, self.belt_reaction = motor_friction, belt_reaction

    @classmethod
    def constructed(cls, **changes: Given[ArrayLike | str]) -> "DCDrive":
        """**Constructed** drive; `changes` replace single parameters.

        `U_in` is such that the belt of `BlockOnDrivenBelt.constructed(k3=85.0)` runs at 0.12 m/s on
        average, for the sign `belt_reaction` in use.
        """
        sign = check_in("belt_reaction", changes.get("belt_reaction", "consistent"), get_args(Sign))
        return cls(**{**DRIVE_A, "U_in": U_IN_A[cast("Sign", sign)], **changes})

    @property
    def inertia(self) -> Float[Array, "..."]:
        """Inertia seen by the rotor [kg m^2]."""
        return self.J_dc + self.J_bp / (self.eta * self.rho * self.rho)

    @property
    def transmission(self) -> Float[Array, "..."]:
        """Belt velocity per speed of the rotor [m]."""
        return self.r_bp / self.rho

    @property
    def reaction(self) -> Float[Array, "..."]:
        """Torque on the rotor per $T_s$ [m], signed by `belt_reaction`."""
        sign = 1.0 if self.belt_reaction == "consistent" else -1.0
        return sign * self.transmission / self.eta

    @property
    def kinetic_torque(self) -> Float[Array, "..."]:
        """Dry friction of the turning rotor [N m], positive if it brakes: `motor_friction`."""
        return self.T_k if self.motor_friction == "consistent" else -self.T_k

    @check_arguments(y=state)
    def belt_velocity(self, y: PyTree) -> Float[Array, "..."]:
        """Velocity of the belt $V_b$ [m/s]."""
        return self.transmission * y.omega

    @check_arguments(y=state, T_s=reals)
    def torque(self, y: PyTree, T_s: Numeric) -> Float[Array, "..."]:
        """Torque on the rotor without its dry friction and inertia [N m]."""
        return self.k_m * y.i_w + self.reaction * T_s - self.b * y.omega

    @check_arguments(y=state)
    def current_rate(self, y: PyTree) -> Float[Array, "..."]:
        """Rate of the current, Eq. (1) [A/s]."""
        return (self.U_in - self.k_e * y.omega - self.R_w * y.i_w) / self.L_w

    @check_arguments(y=state, T_s=reals, mode=modes)
    def slope(self, y: PyTree, T_s: Numeric, mode: Whole) -> DriveState:
        """Time derivative of rotor and winding under the belt force `T_s`, in a mode of the drive."""
        braked = self.torque(y, T_s) - slip_sense(mode) * self.kinetic_torque
        return DriveState(
            omega=where(mode == RESTING, 0.0, braked / self.inertia), i_w=self.current_rate(y)
        )

    @check_arguments(y=state, T_s=reals, mode=modes)
    def drive_guards(self, y: PyTree, T_s: Numeric, mode: Whole) -> tuple:
        """Guards of the drive under the belt force `T_s`."""
        rest, torque = mode == RESTING, self.torque(y, T_s)
        return (
            where(rest, 1.0, slip_sense(mode) * y.omega),
            where(rest, self.T_st - torque, 1.0),
            where(rest, self.T_st + torque, 1.0),
        )

    @check_arguments(y=state, T_s=reals)
    def mode_at_rest(self, y: PyTree, T_s: Numeric) -> Any:
        """Mode that a rotor at rest takes under the belt force `T_s`."""
        torque = self.torque(y, T_s)
        turning = where(torque > 0, TURNING_FORWARD, TURNING_BACKWARD)
        return where(jnp.abs(torque) <= self.T_st, RESTING, turning)

    @check_arguments(y=state, T_s=reals, guard=guard_numbers)
    def mode_after(self, y: PyTree, T_s: Numeric, guard: Whole) -> Any:
        """Mode after guard 0, 1 or 2 of the drive, with `omega` already set to zero."""
        turning = where(guard == 1, TURNING_FORWARD, TURNING_BACKWARD)
        return where(guard == 0, self.mode_at_rest(y, T_s), turning)

    def vector_field(self, t, y, mode, args):
        return self.slope(y, _belt_force(args), mode)

    def guards(self, t, y, mode, args):
        return self.drive_guards(y, _belt_force(args), mode)

    def transition(self, t, y, mode, guard, args):
        landed = y._replace(omega=jnp.zeros_like(y.omega))
        return landed, self.mode_after(landed, _belt_force(args), guard)

    @check_arguments(t=reals, y=state, args=or_none(reals))
    def initial_mode(self, t, y, args):
        turning = where(y.omega > 0, TURNING_FORWARD, TURNING_BACKWARD)
        return where(y.omega == 0, self.mode_at_rest(y, _belt_force(args)), turning)

    @check_arguments(**OBSERVABLE)
    def stored_energy(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Energy of the winding and of the turning parts, as the rotor sees them [J]."""
        return 0.5 * (self.L_w * y.i_w * y.i_w + self.inertia * y.omega * y.omega)

    @check_arguments(**OBSERVABLE)
    def electrical_power(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Power drawn from the supply [W]."""
        return self.U_in * y.i_w

    @check_arguments(**OBSERVABLE)
    def loss_power(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Power of resistance, bearing and dry friction, and of `k_m` unequal `k_e` [W].

        Not positive for `k_m = k_e` and the consistent sign of `motor_friction`.
        """
        bearing = self.b * y.omega * y.omega + self.kinetic_torque * jnp.abs(y.omega)
        unequal = (self.k_m - self.k_e) * y.i_w * y.omega
        return unequal - self.R_w * y.i_w * y.i_w - bearing

    @check_arguments(y=state, T_s=reals)
    def load_power(self, y: PyTree, T_s: Numeric) -> Float[Array, "..."]:
        """Power that the belt force `T_s` feeds into the rotor through the gear [W]."""
        return self.reaction * T_s * y.omega

    def scaled(self, factor: Number) -> "DCDrive":
        """Inertias, torques and `k_m` times `factor`: the same motion under `factor` times the load."""
        return with_scaled(self, SCALED, factor)


def _belt_force(args: Any) -> Any:
    return 0.0 if args is None else args
