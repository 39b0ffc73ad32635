"""Beam jointed by a spring to an oscillator that a belt drags along."""

import math
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, PyTree

from .._argument_checks import (
    OBSERVABLE,
    check_arguments,
    choice,
    count,
    instance,
    one_real,
    or_none,
    parameters,
    state,
)
from .._fastmath import where
from .._types import Given, Numeric, Whole
from .._validation import as_parameter, check_finite, check_type, is_concrete, refusal, shown_value
from ..friction import AbstractFrictionLaw, HyperbolicWeakening
from ..friction.law import Number, check_law
from ..mechanism import AbstractMechanism, Contact
from ._jointed_beam_scales import PARAMETER_UNITS, BeamScales, times_scale
from ._printed_weakening import PrintedWeakening

Word: TypeAlias = Given[Literal["consistent", "printed"]]
WORDS = ("consistent", "printed")
A_SCALE = "a BeamScales, or None for dimensionless numbers"

# Constructed: the paper's table of parameters is missing. The period of x and the frequency of the
# mass on its joint are those the text names, 0.54 and 0.25.
CONSTRUCTED = {
    "m": 0.1, "k1": 0.25, "k2": 7.6, "k3": 22.8, "mu_s": 0.30, "gamma": 10.0, "z_A": 0.4,
}  # fmt: skip
# The constant $\sqrt2$ that makes sin(i pi z) orthonormal on [0, 1].
NORMAL = math.sqrt(2.0)


class JointedBeamState(NamedTuple):
    """Mass and beam. Numbers without a unit where the system is dimensionless."""

    x: Any  # displacement of the mass across the belt, into it positive [m]
    vx: Any  # its velocity [m/s]
    y: Any  # displacement of the mass along the belt [m]
    vy: Any  # its velocity [m/s]
    q: Any  # modal coordinates of the beam, shape [modes] [m]
    p: Any  # their velocities, shape [modes] [m/s]


def _one_state(owner: Any, name: str, value: Any) -> Any:
    """One state of the beam: sums over its modes would go over the rows of a log too."""
    state(owner, name, value)
    if np.shape(value.q) != (owner.modes,) or np.shape(value.p) != (owner.modes,):
        row = f"one state, with one row of {owner.modes} in q and in p (for a log, use jax.vmap)"
        shapes = f"of shapes {np.shape(value.q)} and {np.shape(value.p)}"
        raise refusal(name, value, row, but=shapes)
    return value


_OF_ONE = {**OBSERVABLE, "y": _one_state}


class JointedBeam(AbstractMechanism):
    r"""Simply supported Euler-Bernoulli beam, jointed by a spring to a mass on a running belt.

    The mass $m$ moves by $x$ across the belt, which it touches for $x > 0$, and by $y$ along it; the
    joint $k_1$ pulls the beam $w(z, t)$ at $z_A$; $V = \dot y - v$.

    $$EI\,w'''' + \rho A\,\ddot w = k_1[y - w(z_A)]\,\delta(z - z_A) \tag{2.1}$$
    $$m\ddot x + k_2 x + N = 0, \qquad N = k_3 \max(x, 0) \tag{2.2, 2.3}$$
    $$\text{stick: } \ddot y = 0 \text{ while } |k_1(y - w(z_A))| < \mu_s N \tag{2.4, 2.5}$$
    $$\text{slip: } m\ddot y + k_1(y - w(z_A)) = T_d, \qquad
      T_d = -\frac{\mu_s N}{1 + \gamma|V|}\,\mathrm{sgn}\,V \tag{2.7, 2.8}$$

    With $w = \sum_i \phi_i(z) q_i$, $\phi_i = \sqrt2\sin(i\pi z/L)$, $\omega_i =
    (i\pi/L)^2\sqrt{EI/\rho A}$ and the damping ratio $\zeta$ (none in the paper), for $j = 1 \dots n$

    $$\rho A L\,(\ddot q_j + 2\zeta\omega_j\dot q_j + \omega_j^2 q_j) =
      k_1\phi_j(z_A)\Bigl[y - \sum_i\phi_i(z_A) q_i\Bigr] \tag{2.21}$$

    **Modes:** `"slip backward"` ($V < 0$), `"stick"`, `"slip forward"` ($V > 0$), `"no contact"`
    ($x \le 0$, no friction). **Guards:** $x$ reaches 0; $V$ reaches 0 in slip; the force of the joint
    reaches $\mu_s N$ in stick, in either sense. Without relative velocity the mass sticks if the
    static limit can hold it, else it slips the way the joint pulls.

    **State** `JointedBeamState(x, vx, y, vy, q, p)`, `q` and `p` of shape `[n]`.

    **Arguments:**

    - `m` [kg], `k1`, `k2` [N/m], positive; `k3` [N/m], `mu_s` [-], `gamma` [s/m], `damping` ($\zeta$,
      [-]) not negative; `v` [m/s], speed of the belt, finite; `z_A` [m], inside the beam.
    - `modes`: $n$, at least 1.
    - `law`: a set-valued friction law in place of (2.4), (2.8), with its own units; `mu_s` and `gamma`
      are then not used.
    - `scales`: `BeamScales` of the beam. Without it everything is dimensionless, Eqs. (2.10)-(2.21):
      $EI = L = \rho A = 1$. `dimensionless()`, `dimensional(scales)` convert by Eq. (2.9).
    - Where the paper contradicts itself, `"consistent"` (default) or `"printed"`:

    | argument | printed | consistent |
    |---|---|---|
    | `joint` (C-E1) | the beam feels $k_2$ in (2.10), (2.21) | $k_1$ |
    | `friction` (C-E2) | $1 + \gamma V$ in (2.8), (2.16): a pole | $1 + \gamma\lvert V\rvert$ |
    | `shape` (C-E3) | $\phi_i = \sin(i\pi z/L)$ in (2.18) | $\sqrt2\sin(i\pi z/L)$ |
    | `coupling` (C-E4) | only $i = j$ of the sum in (2.21) | the full sum |

      (C-E5, no damping, is the default `damping=0`.) As printed the joint is not conservative:
      `powers` then has an entry `"inconsistency"` that is not zero.

    `JointedBeam.constructed(v=5e-4)` has **constructed** parameters, the paper's table is lost.
    **Errors** `ValueError`/`TypeError` naming the argument, its value and what is allowed.

    ??? cite "Reference"

        *Non-linear Dynamics of Jointed Systems Under Dry Friction Forces*, Eqs. (2.1)-(2.23).
    """

    m: Float[Array, "..."]
    k1: Float[Array, "..."]
    k2: Float[Array, "..."]
    k3: Float[Array, "..."]
    mu_s: Float[Array, "..."]
    gamma: Float[Array, "..."]
    v: Float[Array, "..."]
    z_A: Float[Array, "..."]
    damping: Float[Array, "..."]
    law: AbstractFrictionLaw | None
    scales: BeamScales
    modes: int = eqx.field(static=True)
    is_dimensionless: bool = eqx.field(static=True)
    joint: Word = eqx.field(static=True)
    friction: Word = eqx.field(static=True)
    shape: Word = eqx.field(static=True)
    coupling: Word = eqx.field(static=True)

    coordinates: ClassVar = {"x": "m", "y": "m", "q": "m"}
    velocities: ClassVar = {"x": "vx", "y": "vy", "q": "p"}
    contact_directions: ClassVar = {"belt": {"y": 1.0}}
    opening: ClassVar = ("belt",)
    state_class: ClassVar = JointedBeamState
    mode_names: ClassVar = ("slip backward", "stick", "slip forward", "no contact")

    @check_arguments(
        modes=count(1), scales=or_none(instance(BeamScales, A_SCALE)),
        **dict.fromkeys(("joint", "friction", "shape", "coupling"), choice(WORDS)),
    )  # fmt: skip
    @parameters(
        m="positive", k1="positive", k2="positive", k3="not negative", mu_s="not negative",
        gamma="not negative", v="finite", damping="not negative", z_A="finite",
    )  # fmt: skip
    def __init__(
        self,
        *,
        m: Number,
        k1: Number,
        k2: Number,
        k3: Number,
        mu_s: Number,
        gamma: Number,
        v: Number,
        z_A: Number,
        modes: Given[int] = 5,
        damping: Number = 0.0,
        law: Given[AbstractFrictionLaw | None] = None,
        scales: Given[BeamScales | None] = None,
        joint: Word = "consistent",
        friction: Word = "consistent",
        shape: Word = "consistent",
        coupling: Word = "consistent",
    ):
        self.law = None if law is None else check_law("law", law, "set-valued")
        self.modes, self.joint, self.friction = modes, joint, friction
        self.shape, self.coupling = shape, coupling
        self.is_dimensionless = scales is None
        self.scales = BeamScales() if scales is None else scales
        inside = "inside the beam: above 0 and below 1"
        if is_concrete((z_A, self.scales)):
            share = np.asarray(z_A) / np.asarray(self.scales.L)
            if not np.all((share > 0) & (share < 1)):
                raise refusal("z_A", z_A, f"{inside} times its length L = {shown_value(self.scales.L)}")

    @classmethod
    def constructed(cls, v: Number, **changes: Given[ArrayLike | str | BeamScales]) -> "JointedBeam":
        """Dimensionless system with **constructed** parameters; `changes` replace some of them."""
        return cls(**{**CONSTRUCTED, "v": v, **changes})

    @classmethod
    def printed(cls, v: Number, **changes: Given[ArrayLike | str | BeamScales]) -> "JointedBeam":
        """As `constructed`, with all equations as the paper prints them (C-E1 to C-E4)."""
        words = dict.fromkeys(("joint", "friction", "shape", "coupling"), "printed")
        return cls.constructed(v, **{**words, **changes})

    @property
    def parameter_units(self) -> dict[str, str]:
        """Units of the parameters; none where the system is dimensionless."""
        return {} if self.is_dimensionless else PARAMETER_UNITS

    @property
    def units(self) -> dict[str, str]:
        """Units of the state; `"1"` where the system is dimensionless."""
        length, speed = ("1", "1") if self.is_dimensionless else ("m", "m/s")
        return {"x": length, "vx": speed, "y": length, "vy": speed, "q": length, "p": speed}

    @property
    def friction_law(self) -> AbstractFrictionLaw:
        """The friction law: the one that was given, else that of Eqs. (2.4), (2.8)."""
        if self.law is not None:
            return self.law
        kind = HyperbolicWeakening if self.friction == "consistent" else PrintedWeakening
        return kind(self.mu_s, self.gamma)

    def mass_matrix(self, q):
        return {"x": self.m, "y": self.m, "q": self.scales.mass}

    def forces(self, t, q, v, args):
        shapes, omega = self.shapes(self.z_A), self.frequencies()
        w = jnp.sum(shapes * q.q)
        inner = self.scales.mass * omega * (omega * q.q + 2.0 * self.damping * v.q)
        return {
            "x": -self.k2 * q.x,
            "y": -self.k1 * (q.y - w),
            "q": self._modal_forces(q, shapes, w) - inner,
        }

    def contacts(self, t, q, v, args):
        N = self.k3 * q.x
        return {
            "belt": Contact(self.friction_law, N, surface_speed=self.v, normal_direction={"x": -1.0})
        }

    @property
    def guard_scales(self) -> tuple:
        """Guards are small if the belt is slow: its speed, and a force that belongs to it."""
        speed = where(self.v == 0.0, self.scales.speed, abs(self.v))
        force = where(self.k3 > 0.0, self.k3, self.k2) * speed * jnp.sqrt(self.m / self.k2)
        return (*[speed] * (1 + len(self.two_sided_contacts)), force)

    def start(self, x: Number | None = None) -> JointedBeamState:
        """State (2.6): the mass moves with the belt at `y = 0`, the beam rests; `x` is its depth [m].

        Without `x` it is the constructed 9.2e-4 (times the length of the beam).
        """
        x = 9.2e-4 * self.scales.length if x is None else as_parameter(check_finite("x", x))
        zero = jnp.zeros_like(x + self.v)
        still = jnp.zeros(self.modes)
        return JointedBeamState(x=x + zero, vx=zero, y=zero, vy=self.v + zero, q=still, p=still)

    @check_arguments(z=one_real)
    def shapes(self, z: Numeric) -> Float[Array, " modes"]:
        r"""Values $\phi_i(z)$ of the eigenfunctions, Eq. (2.18); `z` [m]."""
        factor = NORMAL if self.shape == "consistent" else 1.0
        return factor * jnp.sin(math.pi * self._numbers() * (z / self.scales.L))

    def frequencies(self) -> Float[Array, " modes"]:
        r"""Angular frequencies $\omega_i$ of the beam alone, Eq. (2.19) [rad/s]."""
        return (math.pi * self._numbers()) ** 2 / self.scales.time

    def _numbers(self) -> Float[Array, " modes"]:
        return jnp.arange(1, self.modes + 1, dtype=jnp.float64)

    @check_arguments(y=_one_state, z=one_real)
    def deflection(self, y: JointedBeamState, z: Numeric) -> Float[Array, "..."]:
        """Deflection of the beam at `z`, Eq. (2.17) [m]."""
        return jnp.sum(self.shapes(z) * y.q)

    @check_arguments(**_OF_ONE)
    def w(self, t: Numeric, y: JointedBeamState, mode: Whole = 0, args: PyTree = None) -> Any:
        """Deflection of the beam at the joint [m]."""
        return self.deflection(y, self.z_A)

    @check_arguments(**_OF_ONE)
    def w_rate(self, t: Numeric, y: JointedBeamState, mode: Whole = 0, args: PyTree = None) -> Any:
        """Velocity of the beam at the joint [m/s]."""
        return jnp.sum(self.shapes(self.z_A) * y.p)

    @check_arguments(**OBSERVABLE)
    def relative_velocity(
        self, t: Numeric, y: JointedBeamState, mode: Whole = 0, args: PyTree = None
    ) -> Any:
        """Velocity of the mass against the belt [m/s]."""
        return y.vy - self.v

    @check_arguments(**OBSERVABLE)
    def normal_force(self, t: Numeric, y: JointedBeamState, mode: Whole, args: PyTree = None) -> Any:
        """Normal force $N$, Eq. (2.2) [N]."""
        return self.normal_forces(t, y, mode, args)["belt"]

    @check_arguments(**_OF_ONE)
    def friction_force(self, t: Numeric, y: JointedBeamState, mode: Whole, args: PyTree = None) -> Any:
        """Force of the belt on the mass along the belt [N]; in stick what holds it."""
        return self.friction_forces(t, y, mode, args)["belt"]

    @check_arguments(**_OF_ONE)
    def friction_power(self, t: Numeric, y: JointedBeamState, mode: Whole, args: PyTree = None) -> Any:
        r"""$W_f = T\,V$: power of the friction in the contact [W], zero in stick, never positive."""
        return self.friction_force(t, y, mode) * (y.vy - self.v)

    @check_arguments(**_OF_ONE)
    def beam_power(self, t: Numeric, y: JointedBeamState, mode: Whole, args: PyTree = None) -> Any:
        r"""$W_b = k_1(y - w_A)\dot w_A$: power from the mass to the beam through the joint [W]."""
        return self._joint_force(y) * self.w_rate(t, y)

    def _joint_force(self, y: JointedBeamState) -> Any:
        return self.k1 * (y.y - self.w(0.0, y))

    def _modal_forces(self, y: Any, shapes: Any, w: Any) -> Float[Array, " modes"]:
        """Right-hand sides of (2.21) [N]."""
        stiffness = self.k1 if self.joint == "consistent" else self.k2
        if self.coupling == "consistent":
            return stiffness * shapes * (y.y - w)
        return stiffness * shapes * (y.y - shapes * y.q)

    @check_arguments(y=_one_state)
    def energy(self, y: JointedBeamState) -> Any:
        """Energy of mass, springs and beam [J]; the contact spring counts while pressed."""
        depth = where(y.x > 0.0, y.x, 0.0)
        mass = self.m * (y.vx * y.vx + y.vy * y.vy)
        stretch = y.y - self.w(0.0, y)
        springs = self.k2 * y.x * y.x + self.k3 * depth * depth + self.k1 * stretch * stretch
        beam = jnp.sum(y.p * y.p + (self.frequencies() * y.q) ** 2)
        return 0.5 * (mass + springs + self.scales.mass * beam)

    @check_arguments(**_OF_ONE)
    def powers(self, t: Numeric, y: JointedBeamState, mode: Whole, args: PyTree) -> dict[str, Any]:
        """Powers into `energy` [W]: `belt` (drive), `friction` (loss), `damping` (loss in the beam).

        With equations as printed also `inconsistency`: what the joint gives the beam beyond what it
        takes from the mass.
        """
        force = self.friction_force(t, y, mode)
        powers = {
            "belt": force * self.v,
            "friction": force * (y.vy - self.v),
            "damping": -2.0 * self.damping * self.scales.mass * jnp.sum(self.frequencies() * y.p * y.p),
        }
        if "printed" in (self.joint, self.coupling):
            shapes = self.shapes(self.z_A)
            given = jnp.sum(self._modal_forces(y, shapes, jnp.sum(shapes * y.q)) * y.p)
            powers["inconsistency"] = given - self._joint_force(y) * jnp.sum(shapes * y.p)
        return powers

    def dimensional(self, scales: BeamScales) -> "JointedBeam":
        """The same system in SI units for a beam of these `scales`, Eq. (2.9).

        Errors: `ValueError` if the system is dimensional already.
        """
        if not self.is_dimensionless:
            raise refusal("the system", self, "a dimensionless one: it has SI units already")
        check_type("scales", scales, BeamScales, "a BeamScales")
        return self._in_units(scales, scales)

    def dimensionless(self) -> "JointedBeam":
        """The same system in dimensionless numbers, Eq. (2.9)."""
        s = self.scales
        inverse = BeamScales(1.0 / s.EI, 1.0 / s.L, 1.0 / s.rhoA)
        return self._in_units(inverse, None)

    def _in_units(self, by: BeamScales, scales: BeamScales | None) -> "JointedBeam":
        if self.law is not None:
            raise refusal("law", self.law, "None: the speeds that a law of its own holds are not known")
        return JointedBeam(
            m=self.m * by.mass,
            k1=self.k1 * by.stiffness,
            k2=self.k2 * by.stiffness,
            k3=self.k3 * by.stiffness,
            mu_s=self.mu_s,
            gamma=self.gamma / by.speed,
            v=self.v * by.speed,
            z_A=self.z_A * by.length,
            modes=self.modes,
            damping=self.damping,
            scales=scales,
            joint=self.joint,
            friction=self.friction,
            shape=self.shape,
            coupling=self.coupling,
        )

    @check_arguments(y=state)
    def state_in_units(self, y: JointedBeamState) -> JointedBeamState:
        """A dimensionless state in the units of this system."""
        return times_scale(y, self.scales, 1)

    @check_arguments(y=state)
    def state_dimensionless(self, y: JointedBeamState) -> JointedBeamState:
        """A state of this system in dimensionless numbers."""
        return times_scale(y, self.scales, -1)
