"""Block on a belt of constant speed, its normal force intensified by a pendulum."""

from typing import TYPE_CHECKING, Any, ClassVar

from jax.typing import ArrayLike
from jaxtyping import Array, Float, PyTree

from .._argument_checks import OBSERVABLE, check_arguments, parameters, state
from .._types import Given, Numeric, Whole
from ..friction import AbstractFrictionLaw
from ..friction.law import Number
from ..hybrid import AbstractSmoothSystem
from ..mechanism import AbstractMechanism, Contact, Instant
from ._block_mechanics import (
    BLOCK,
    AbstractBlockOnBelt,
    Block,
    BlockState,
    check_law,
    check_rim,
    set_a,
)
from ._mechanical import SLIP_MODES


class AbstractBlockOnSteadyBelt(AbstractBlockOnBelt):
    """Simplified model: a belt of constant speed `V_b` [m/s] under the block."""

    V_b: Float[Array, "..."]

    parameter_units: ClassVar = {**AbstractBlockOnBelt.parameter_units, "V_b": "m/s"}

    @parameters(**BLOCK, V_b="finite")
    def __init__(
        self,
        *,
        m: Number,
        M: Number,
        J: Number,
        k1: Number,
        k2: Number,
        k3: Number,
        c1: Number,
        c2: Number,
        r: Number,
        Q: Number,
        V_b: Number,
        law: AbstractFrictionLaw,
        g: Number = 9.81,
    ):
        check_rim(J, r)
        self.law = check_law(law, self.set_valued)

    @classmethod
    def constructed(
        cls: type[Block], k3: Number, **changes: Given[ArrayLike | AbstractFrictionLaw]
    ) -> Block:
        """Set A of **constructed** parameters at the bifurcation parameter `k3` [N/m].

        `changes` replace single parameters; `J` and `Q` follow `M`, `g` and `r` unless they are given.
        """
        return cls(**{"V_b": 0.12, **set_a(k3, changes, cls.set_valued)})

    @check_arguments(y=state)
    def belt_velocity(self, y: BlockState) -> Numeric:
        """Velocity of the belt, constant [m/s]."""
        return self.V_b

    @check_arguments(y=state)
    def energy(self, y: BlockState) -> Any:
        """Kinetic and potential energy of block and pendulum [J]."""
        return self.kinetic_energy(0.0, y) + self.potential_energy(0.0, y)

    @check_arguments(**OBSERVABLE)
    def powers(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> dict[str, Any]:
        """Powers into `energy` [W]; friction and dampers are not positive."""
        return {
            "belt": self.belt_power(t, y, mode, args),
            "friction": self.friction_power(t, y, mode, args),
            "dampers": self.damper_power(t, y, mode, args),
        }


class BlockOnBelt(AbstractBlockOnSteadyBelt, AbstractSmoothSystem):
    r"""Simplified model, Eqs. (8)-(12): the belt runs at a constant speed $V_b$; smooth friction.

    `AbstractBlockOnBelt` has the equations and the parameters. The state is
    `BlockState(x, vx, y, vy)`. There is one mode and no guard: with the smooth law (12) the block
    creeps instead of sticking.

    The contact is stiff: near rest the friction acts like a damper with the rate
    $\mu_0\alpha(1+\beta)N/m$, about 2,000 1/s for set A, which bounds the step of explicit methods.

    `BlockOnBelt.constructed(k3=85.0)` is set A; its parameters are **constructed**, the paper prints
    none. Errors: `ValueError` naming a parameter, its value and what is allowed.

    ??? cite "Reference"

        *Influence of Frequency of Excitation on Bifurcational Behaviour of an Experimental 2-DoF
        Mechanical System with Stick-Slip Friction*, Eqs. (8)-(12), first case.
    """

    if TYPE_CHECKING:  # which would take the fields for the arguments
        __init__ = AbstractBlockOnSteadyBelt.__init__

    set_valued: ClassVar = False
    units: ClassVar = {"x": "m", "vx": "m/s", "y": "m", "vy": "m/s"}

    def vector_field(self, t, y, mode, args):
        loads = self.loads(y)
        return self.slope(y, loads, self.sliding_force(y, loads))


class BlockOnBeltSetValued(AbstractBlockOnSteadyBelt, AbstractMechanism):
    r"""Simplified model, Eqs. (8)-(11), with a set-valued law: the block sticks and slips.

    `AbstractBlockOnBelt` has the equations and the parameters. The state is
    `BlockState(x, vx, y, vy)`. Modes:

    | mode | holds | left when |
    |---|---|---|
    | `"stick"` | $\dot x = V_b$, by whatever $T_s$ | $T_s/N$ leaves the law's static interval |
    | `"slip backward"` | $V_r < 0$ | $V_r$ reaches 0 |
    | `"slip forward"` | $V_r > 0$ | $V_r$ reaches 0 |

    At $V_r = 0$ the block sticks if the static interval can hold the load, and otherwise slips the way
    the load pulls (Filippov). The run ends with `RESULTS.no_admissible_mode` where $N$ falls to zero.

    `BlockOnBeltSetValued.constructed(k3=85.0)` is set A (**constructed**) with the set-valued limit of
    law (12), i.e. $\alpha \to \infty$. Errors as for `BlockOnBelt`.

    ??? cite "Reference"

        Equations as for `BlockOnBelt`. A. F. Filippov, *Differential Equations with Discontinuous
        Righthand Sides*, Kluwer, 1988.
    """

    if TYPE_CHECKING:  # which would take the fields for the arguments
        __init__ = AbstractBlockOnSteadyBelt.__init__

    set_valued: ClassVar = True
    coordinates: ClassVar = {"x": "m", "y": "m"}
    velocities: ClassVar = {"x": "vx", "y": "vy"}
    contact_directions: ClassVar = {"belt": {"x": 1.0}}
    state_class: ClassVar = BlockState
    mode_names: ClassVar = SLIP_MODES

    def mass_matrix(self, q):
        return {"x": self.m, "y": self.J / (self.r * self.r)}

    def forces(self, t, q, v, args):
        loads = self.loads(self.from_coordinates(q, v))
        return {"x": -loads.on_block, "y": -loads.on_rim}

    def contacts(self, t, q, v, args):
        N = self.loads(self.from_coordinates(q, v)).normal
        return {"belt": Contact(self.law, N, surface_speed=self.V_b)}

    def declared_power(self, at: Instant, states: list) -> Any:
        """That of the dampers: all other forces have a potential [W]."""
        return self.damper_power(0.0, self.from_coordinates(at.q, at.v))

    @check_arguments(**OBSERVABLE)
    def friction_force(self, t: Numeric, y: BlockState, mode: Whole, args: PyTree = None) -> Any:
        """Friction force $T_s$ [N] as in (11); the block feels $-T_s$. At rest, what holds it."""
        return -self.friction_forces(t, y, mode, args)["belt"]
