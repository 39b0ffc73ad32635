"""Mechanics of the block on a belt and of its pendulum, whatever moves the belt."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Array, Float, PyTree

from .._argument_checks import OBSERVABLE, Rule, check_arguments, instance, reals, state
from .._types import Numeric, Whole
from .._validation import is_concrete, refusal
from ..friction import AbstractFrictionLaw, SmoothHyperbolicWeakening
from ..friction.law import Number
from ..friction.law import check_law as is_law
from ..hybrid import Section
from ._mechanical import AbstractMechanicalSystem, with_scaled

if TYPE_CHECKING:
    # By this name in this file, or type checkers take class attributes for fields.
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar

# Set A. Constructed: the paper prints no parameters; found by random search and rounded by hand.
# J = 3 M r^2 and Q = -3/4 M g r, which balances the pendulum's weight at y = 0.
SET_A = {
    "m": 0.20, "M": 0.21, "k1": 17.0, "k2": 11.0, "c1": 0.9965, "c2": 0.035, "r": 0.25, "g": 9.81,
}  # fmt: skip
LAW_A = {"mu_0": 0.26, "alpha": 190.0, "beta": 0.9, "gamma": 1.75}

# lam(0) = sqrt(2) l / (2 r) with l = (3 sqrt(2) / 4) r.
LEVER = 0.75

SCALED = ("m", "M", "J", "k1", "k2", "k3", "c1", "c2", "Q")


class BlockState(NamedTuple):
    """Block and pendulum."""

    x: Any  # displacement of the block [m]
    vx: Any  # its velocity [m/s]
    y: Any  # displacement of the pendulum's rim, r times its angle [m]
    vy: Any  # its velocity [m/s]


class Loads(NamedTuple):
    """Forces on block and rim besides inertia and friction, and the normal force."""

    on_block: Any  # left-hand side of (8) without inertia [N]
    on_rim: Any  # left-hand side of (9) without inertia, plus Q/r [N]
    normal: Any  # normal force [N]


class AbstractBlockOnBelt(AbstractMechanicalSystem):
    r"""Block (mass $m$) on a belt, held by springs and pressed down by a pendulum ($M$, $J$).

    With the rim displacement $y = r\varphi$, $z = x + y$, the stretch $q = y + x^2/(2r)$ of spring
    $k_3$ and $V_r = \dot x - V_b$:

    $$m\ddot x + c_1\dot z + (k_1 + k_2)x + k_2 y + \frac{k_3 x}{r}q = -T_s \tag{8}$$
    $$\frac{J}{r^2}\ddot y + c_1\dot z + c_2\dot y + k_2 z + k_3 q + M g\lambda(y) = -Q/r \tag{9}$$
    $$\lambda(y) = \frac34\left(1 + \frac yr - \frac{y^2}{2r^2} - \frac{y^3}{6r^3}\right) \tag{10}$$
    $$N = m g + M g\lambda - k_3 q - c_2\dot y, \qquad T_s = \mu(V_r)N \tag{11}$$

    The elastic terms are the gradient of $\frac12k_1x^2 + \frac12k_2(x+y)^2 + \frac12k_3q^2$. The
    damping $c_1\dot z$ stands in (8) and in (9) (B-E3: as printed, and consistent: its power is
    $-c_1\dot z^2$). A negative $N$ (lift-off) is outside the model; monitor `normal_force`.

    **Parameters** (SI): `m`, `M` [kg], `J` [kg m^2], `r` [m], `g` [m/s^2] positive; `k1`, `k2`, `k3`
    [N/m], `c1`, `c2` [N s/m] not negative; `Q` [N m], resistance torque of the pivot, finite; `law`, a
    friction law. Each may be a number per lane under `jax.vmap`. Multiplying `m`, `M`, `J`, all `k`,
    all `c` and `Q` by one factor (`scaled`) leaves the motion unchanged.

    Observables take `(t, y, mode, args)`. Between events `energy(y)` grows at the rate of the sum of
    `powers(t, y, mode, args)`: belt, friction, dampers.
    """

    m: Float[Array, "..."]
    M: Float[Array, "..."]
    J: Float[Array, "..."]
    k1: Float[Array, "..."]
    k2: Float[Array, "..."]
    k3: Float[Array, "..."]
    c1: Float[Array, "..."]
    c2: Float[Array, "..."]
    r: Float[Array, "..."]
    Q: Float[Array, "..."]
    g: Float[Array, "..."]
    law: AbstractFrictionLaw

    parameter_units: ClassVar = {
        "m": "kg", "M": "kg", "J": "kg m2", "k1": "N/m", "k2": "N/m", "k3": "N/m", "c1": "N s/m",
        "c2": "N s/m", "r": "m", "Q": "N m", "g": "m/s2",
    }  # fmt: skip

    set_valued: AbstractClassVar[bool]  # whether the block sticks

    @abc.abstractmethod
    def belt_velocity(self, y: PyTree) -> Numeric:
        """Velocity of the belt [m/s]."""

    @check_arguments(**OBSERVABLE)
    def friction_force(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Friction force $T_s$ [N] as in (11); the block feels $-T_s$."""
        return self.sliding_force(y, self.loads(y))

    @check_arguments(y=state, loads=instance(Loads, "what `loads` returns"))
    def sliding_force(self, y: PyTree, loads: Loads) -> Any:
        """$T_s$ [N] by the relative velocity alone, as a smooth law has it."""
        v = y.vx - self.belt_velocity(y)
        return self.law.coefficient(v) * loads.normal + self.law.drag(v)

    @check_arguments(y=state)
    def loads(self, y: PyTree) -> Loads:
        """Forces of springs, dampers and weight; one reciprocal, so that compiled loops stay fast."""
        per_r = 1.0 / self.r
        x = y.x
        stretched = self.k3 * (y.y + (0.5 * per_r) * x * x)
        angle = y.y * per_r
        weight = (LEVER * self.M * self.g) * (
            1.0 + angle * (1.0 + angle * (-0.5 + angle * (-1.0 / 6.0)))
        )
        damping = self.c1 * (y.vx + y.vy)
        on_rim = self.c2 * y.vy + stretched
        return Loads(
            on_block=damping + self.k1 * x + self.k2 * (x + y.y) + stretched * (x * per_r),
            on_rim=damping + on_rim + self.k2 * (x + y.y) + weight + self.Q * per_r,
            normal=self.m * self.g + weight - on_rim,
        )

    @check_arguments(y=state, loads=instance(Loads, "what `loads` returns"), T_s=reals)
    def slope(self, y: PyTree, loads: Loads, T_s: Numeric) -> BlockState:
        """Time derivative of block and pendulum under the friction force `T_s`."""
        return BlockState(
            x=y.vx,
            vx=(-1.0 / self.m) * (loads.on_block + T_s),
            y=y.vy,
            vy=(-self.r * self.r / self.J) * loads.on_rim,
        )

    @check_arguments(**OBSERVABLE)
    def relative_velocity(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Velocity of the block over the belt, $V_r$ [m/s]."""
        return y.vx - self.belt_velocity(y)

    @check_arguments(**OBSERVABLE)
    def normal_force(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Normal force $N$ between block and belt [N], Eq. (11); below zero outside the model."""
        return self.loads(y).normal

    @check_arguments(**OBSERVABLE)
    def friction_coefficient(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """$T_s/N$ [-]; while the block sticks, the part of the static interval that is in use."""
        return self.friction_force(t, y, mode, args) / self.normal_force(t, y, mode, args)

    @check_arguments(**OBSERVABLE)
    def elastic_energy(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Energy of the three springs [J]."""
        stretch = y.y + y.x * y.x / (2.0 * self.r)
        z = y.x + y.y
        return 0.5 * (self.k1 * y.x * y.x + self.k2 * z * z + self.k3 * stretch * stretch)

    @check_arguments(**OBSERVABLE)
    def potential_energy(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Energy of the springs, of the pendulum's weight and of the torque `Q` [J]; 0 at x = y = 0."""
        angle = y.y / self.r
        raised = angle * (1.0 + angle * (0.5 - angle * (1.0 / 6.0 + angle / 24.0)))
        weight = LEVER * self.M * self.g * self.r * raised
        return self.elastic_energy(t, y, mode, args) + weight + self.Q * angle

    @check_arguments(**OBSERVABLE)
    def kinetic_energy(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Kinetic energy of block and pendulum [J]."""
        spin = y.vy / self.r
        return 0.5 * (self.m * y.vx * y.vx + self.J * spin * spin)

    @check_arguments(**OBSERVABLE)
    def belt_power(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Power that the belt feeds into block and contact [W]: $-T_s V_b$."""
        return -self.friction_force(t, y, mode, args) * self.belt_velocity(y)

    @check_arguments(**OBSERVABLE)
    def friction_power(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Power of friction on block and belt together [W]: $-T_s V_r$, not positive while N >= 0."""
        return -self.friction_force(t, y, mode, args) * self.relative_velocity(t, y, mode, args)

    @check_arguments(**OBSERVABLE)
    def damper_power(self, t: Numeric, y: PyTree, mode: Whole = 0, args: PyTree = None) -> Any:
        """Power of the dampers [W], not positive: $-c_1\\dot z^2 - c_2\\dot y^2$."""
        zd = y.vx + y.vy
        return -self.c1 * zd * zd - self.c2 * y.vy * y.vy

    def scaled(self: "Block", factor: Number) -> "Block":
        """All masses, stiffnesses, dampings and `Q` times `factor`: the motion is the same."""
        return with_scaled(self, SCALED, factor)

    def zero_acceleration_section(self) -> Section:
        """The paper's Poincaré map: the acceleration of `m` crosses zero from positive to negative.

        With a set-valued law it also fires where the block comes to stick, because the acceleration
        falls from a positive value to zero there; the smooth law does the same within a short time.
        """
        return Section(_acceleration, "falling", name="zero acceleration of the block")


def _acceleration(system, t, y, dy, mode, args):
    return dy.vx


# The mechanical parameters of a block.
BLOCK: dict[str, Rule] = {
    **dict.fromkeys(("m", "M", "J", "r", "g"), "positive"),
    **dict.fromkeys(("k1", "k2", "k3", "c1", "c2"), "not negative"),
    "Q": "finite",
}


def check_rim(J: Any, r: Any) -> None:
    """Raise where the inertia of the rim is rounded to nothing."""
    if is_concrete((J, r)):
        J_, r_ = np.asarray(J), np.asarray(r)
        with np.errstate(over="ignore", under="ignore"):
            light = not J_.min() / (r_ * r_).max() > 0.0
        if light:
            raise refusal("r", r, "so small that the rim's inertia J / r^2 is above 0")


def check_law(law: Any, set_valued: bool) -> AbstractFrictionLaw:
    """`law` if it is memoryless and of the kind that the model's modes are made for."""
    is_law("law", law)
    kind = "set-valued" if set_valued else "smooth"
    if law.num_states or law.set_valued != set_valued:
        other = "its set_valued_limit()" if set_valued else "the class whose name ends in SetValued"
        raise refusal("law", law, f"a {kind} law without internal state (otherwise take {other})")
    return law


def set_a(k3: Number, changes: dict[str, Any], set_valued: bool) -> dict[str, Any]:
    """Keyword arguments of a block with set A and `changes`; `J` and `Q` follow `M`, `g`, `r`."""
    given = {**SET_A, "k3": k3, **changes}
    given.setdefault("J", 3.0 * given["M"] * given["r"] ** 2)
    given.setdefault("Q", -LEVER * given["M"] * given["g"] * given["r"])
    if "law" not in given:
        law = SmoothHyperbolicWeakening(**LAW_A)
        given["law"] = law.set_valued_limit() if set_valued else law
    return given


Block = TypeVar("Block", bound=AbstractBlockOnBelt)
