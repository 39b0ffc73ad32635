"""The machine with regularised friction on belts and ground: one smooth vector field."""

from typing import Any, ClassVar, Literal, NamedTuple, cast

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

import stickslip as ss
from stickslip import Integrator, SaveAt
from stickslip.checks import (
    Given,
    Numeric,
    as_parameter,
    check_arguments,
    check_between,
    check_in,
    check_positive,
    check_type,
    modes,
    one_number,
    reals,
    refusal,
    whole_number,
    with_components,
)
from stickslip.derived import WithIntegrals
from stickslip.fastmath import side_of, where
from stickslip.friction import LuGre, Regularised, Stribeck
from stickslip.systems import AbstractMechanicalSystem

from ._arguments import the_integrator
from ._contacts import (
    NUM_CONTACTS,
    kinetic_limits,
    line_force,
    line_masses,
    sliding_speeds,
    static_limits,
)
from ._parameters import CoreXYParameters
from ._simulate import prepared
from ._solution import Accelerations, CoreXYSolution, Ledger
from ._system import LOSS_NAMES, STATE_UNITS, CoreXY, CoreXYState
from ._tanh_weakening import TanhWeakening
from ._transitions import number_of
from ._voltage import AbstractVoltage

LATEST = 1e12  # [s]; sines of much greater arguments have no digit left
VARIANTS = ("tanh", "stribeck", "bristle")
REFERENCE_SPEED = 0.1  # [m/s], so that the default Stribeck speed is sqrt(width * REFERENCE_SPEED)
RESTS_BELOW = 3.0  # widths: what is slower is reported at rest


class SmoothedState(NamedTuple):
    """State `y` of the machine, deflections [m] of the eight bristles (0 but for `"bristle"`)."""

    y: CoreXYState
    bristles: tuple[Any, ...]


class Friction(NamedTuple):
    """Force on a contact along its speed [N] and rate of its bristle [m/s]."""

    force: Any
    rate: Any


def tanh_friction(v: Any, z: Any, kinetic: Any, static: Any, width: Any, speed: Any) -> Friction:
    r"""$-[K + (R-K)\,(1-\tanh^2(v/v_s))]\tanh(v/\varepsilon)$."""
    law = Regularised(TanhWeakening(static, kinetic, speed), width, "tanh")
    return Friction(law.force(v, 1.0), jnp.zeros_like(v))


def stribeck_friction(v: Any, z: Any, kinetic: Any, static: Any, width: Any, speed: Any) -> Friction:
    r"""$-[K + (R-K)\,e^{-(v/v_s)^2}]\,v/\sqrt{v^2+\varepsilon^2}$."""
    law = Regularised(Stribeck(static, kinetic, speed), width, "sqrt")
    return Friction(law.force(v, 1.0), jnp.zeros_like(v))


def bristle_friction(v: Any, z: Any, kinetic: Any, static: Any, width: Any, speed: Any) -> Friction:
    r"""LuGre: $\dot z = v - \sigma|v|z/g(v)$, force $-\sigma z$, $g = K + (R-K)e^{-(v/v_s)^2}$.

    The stiffness $\sigma = R/\ell$ lets a contact give by $\ell = \varepsilon\cdot$ 0.01 s before it
    slides; $|v|$ is smoothed by the width.
    """
    law = LuGre(Stribeck(static, kinetic, speed), static / (0.01 * width))
    size = v * v * lax.rsqrt(v * v + 1e-6 * width * width)
    rate = v - law.sigma_0 * size * z / law.steady_magnitude(v, side_of(v))
    return Friction(-law.sigma_0 * z, rate)


_LAWS = (tanh_friction, stribeck_friction, bristle_friction)


def _of_machine(owner: Any, name: str, value: Any) -> Any:
    """A state of the machine."""
    return with_components(name, value, CoreXYState._fields)


def _times(owner: Any, name: str, value: Any) -> Any:
    """Times at which the voltages are numbers."""
    return check_between(name, reals(owner, name, value), -LATEST, LATEST)


def _smoothed(owner: Any, name: str, value: Any) -> Any:
    """A state of the machine with its bristles."""
    check_type(name, value, SmoothedState, "a SmoothedState, as `state` makes it")
    bristles = value.bristles
    if not isinstance(bristles, tuple) or len(bristles) != NUM_CONTACTS:
        raise refusal(f"{name}.bristles", bristles, f"a tuple of {NUM_CONTACTS} deflections")
    _of_machine(owner, f"{name}.y", value.y)
    return value


class SmoothedCoreXY(AbstractMechanicalSystem):
    r"""CoreXY with friction that is a function of the sliding speed, or of a bristle's deflection.

    Every contact has its kinetic friction $K$, and its static friction $R = \max(\mu_s,\mu_k)N$ at
    speeds between the width $\varepsilon$ of the law and its Stribeck speed $v_s$. As
    $\varepsilon \to 0$ with $v_s \to 0$, $\varepsilon/v_s \to 0$, it becomes the law of `CoreXY`; both
    scales are needed, because contacts that start together slide with different speeds and must
    reach their static limits together. With the default $v_s$ the distance to `CoreXY` should fall as
    $\sqrt\varepsilon$. Measured over 2 s of scenario 1, from $\varepsilon$ = 5 to 1.25 mm/s: order 0.64
    (tanh), 0.40 (Stribeck), 0.14 (bristle; 0.48 from 20 to 5 mm/s), distance 2.6, 5.3 and 3.5 mm.

    **Arguments:** `parameters`, `voltage`; `variant`, one of `VARIANTS` or its number (traced numbers
    select by `lax.switch`); `width` $\varepsilon$ [m/s]; `stribeck_speed` $v_s$ [m/s], by default
    $\sqrt{0.1\,\varepsilon}$. **Raises** `ValueError` for an unknown variant and a number that is
    not positive.
    """

    machine: CoreXY
    variant: Int[Array, "..."]
    width: Float[Array, "..."]
    stribeck_speed: Float[Array, "..."]

    parameter_units: ClassVar = {"width": "m/s", "stribeck_speed": "m/s"}

    mode_names: ClassVar = ("smooth",)
    guard_names: ClassVar = ("input jumps",)
    units: ClassVar = STATE_UNITS

    def __init__(
        self,
        parameters: Given[CoreXYParameters],
        voltage: Given[AbstractVoltage],
        *,
        variant: Given[Literal["tanh", "stribeck", "bristle"] | int | Array] = "tanh",
        width: Numeric = 1e-2,
        stribeck_speed: Numeric | None = None,
    ):
        self.machine = CoreXY(parameters, voltage)
        if isinstance(variant, str):
            variant = VARIANTS.index(check_in("variant", variant, VARIANTS))
        self.variant = jnp.asarray(whole_number("variant", variant, 0, len(VARIANTS) - 1), jnp.int32)
        self.width = as_parameter(check_positive("width", width))
        default = jnp.sqrt(REFERENCE_SPEED * self.width)
        given = default if stribeck_speed is None else check_positive("stribeck_speed", stribeck_speed)
        self.stribeck_speed = as_parameter(given)

    @check_arguments(y=_of_machine)
    def state(self, y: CoreXYState) -> SmoothedState:
        """The machine's state with all bristles undeflected."""
        return SmoothedState(y, (jnp.zeros(()),) * NUM_CONTACTS)

    @check_arguments(s=_smoothed)
    def friction(self, s: SmoothedState) -> Friction:
        """Friction and bristle rates of all contacts, each a tuple."""
        p = self.machine.parameters
        speeds = jnp.stack(sliding_speeds(self.machine.line_velocities(s.y)))
        kinetic, static = jnp.stack(kinetic_limits(p)), jnp.stack(static_limits(p))
        operands = (speeds, jnp.stack(s.bristles), kinetic, static, self.width, self.stribeck_speed)
        return lax.switch(jnp.clip(self.variant, 0, len(_LAWS) - 1), _LAWS, *operands)

    def vector_field(self, t, y, mode, args):
        p, found = self.machine.parameters, self.friction(y)
        force = line_force(tuple(found.force))
        one, two = self.machine.line_drive(t, y.y)
        mass = line_masses(p)
        dy = CoreXYState(
            x=y.y.vx,
            y=y.y.vy,
            vx=force.x / mass.x,
            vy=force.y / mass.y,
            theta_1=y.y.omega_1,
            theta_2=y.y.omega_2,
            omega_1=(force.one + one) / (mass.one * p.r),
            omega_2=(force.two + two) / (mass.two * p.r),
            piece=jnp.zeros_like(y.y.piece),
        )
        return SmoothedState(dy, tuple(found.rate[c] for c in range(NUM_CONTACTS)))

    def guards(self, t, y, mode, args):
        voltage = self.machine.voltage
        return (voltage.piece_end(y.y.piece) - t if voltage.has_breaks else jnp.ones_like(t),)

    def transition(self, t, y, mode, guard, args):
        return y._replace(y=y.y._replace(piece=y.y.piece + 1.0)), mode

    @check_arguments(t=reals, y=_smoothed)
    def initial_mode(self, t, y, args):
        return jnp.zeros((), jnp.int32)

    @check_arguments(y=_smoothed)
    def energy(self, y):
        """Kinetic energy [J]; the bristles' energy is counted as friction."""
        return self.machine.energy(y.y)

    @check_arguments(t=_times, y=_smoothed, mode=modes)
    def powers(self, t, y, mode, args):
        """As `CoreXY.powers` [W]."""
        names = list(self.machine.powers(t, y.y, jnp.zeros((), jnp.int32), args))
        one, two = self.machine.torques(t, y.y)
        friction = self.friction(y).force
        speeds = sliding_speeds(self.machine.line_velocities(y.y))
        work = [one * y.y.omega_1, two * y.y.omega_2]
        work += [friction[c] * speeds[c] for c in range(NUM_CONTACTS)]
        return dict(zip(names, work, strict=True))


def _account(system, t, y, mode, args):
    speeds = sliding_speeds(system.machine.line_velocities(y.y))
    slip = {"slip_1": jnp.abs(speeds[6]), "slip_2": jnp.abs(speeds[7])}
    return {**system.powers(t, y, mode, args), **slip}


def simulate_smoothed(
    parameters: CoreXYParameters,
    voltage: AbstractVoltage,
    t1: Numeric = 6.0,
    *,
    rows: int = 601,
    y0: CoreXYState | None = None,
    variant: Given[Literal["tanh", "stribeck", "bristle"] | int | Array] = "tanh",
    width: Numeric = 1e-2,
    stribeck_speed: Numeric | None = None,
    integrator: Integrator | None = None,
    throw: bool = True,
) -> CoreXYSolution:
    """Motion of `SmoothedCoreXY`; `simulate` says what the first arguments are.

    By default with Tsit5 and tolerance 1e-7, whose steps the width limits to about
    `width / 2000` s per m/s; for a small width give an implicit method, e.g.
    `Integrator(method=diffrax.Kvaerno5(), ...)`. A contact slower than three widths is reported at
    rest, and a motor as rolling.
    """
    machine, t1, y0 = prepared(parameters, voltage, t1, rows, y0)
    one_number("width", width, "positive")
    if stribeck_speed is not None:
        one_number("stribeck_speed", stribeck_speed, "positive")
    system = SmoothedCoreXY(
        machine.parameters, machine.voltage, variant=variant, width=width, stribeck_speed=stribeck_speed
    )
    the_integrator(integrator)
    if integrator is None:
        step = ss.AdaptiveStep(1e-7, 1e-7)
        integrator = Integrator(method="tsit5", step=step, max_steps=10_000_000)
    ledger = WithIntegrals(system, _account)
    ts = jnp.linspace(0.0, 1.0, rows) * t1
    solution = ss.simulate(
        ledger, 0.0, t1, ledger.start(system.state(cast("CoreXYState", y0))), integrator=integrator,
        saveat=SaveAt(ts=ts, max_events=None), throw=throw,
    )  # fmt: skip
    found = solution.outputs
    assert found is not None
    y, dy, sums = found.y.y.y, found.dy.y.y, found.y.integrals
    friction = jnp.stack([sums[f"friction_{name}"] for name in LOSS_NAMES], axis=-1)
    slip = jnp.stack([sums["slip_1"], sums["slip_2"]], axis=-1)
    speeds = jnp.stack(jax.vmap(lambda y: sliding_speeds(machine.line_velocities(y)))(y), axis=-1)
    senses = where(jnp.abs(speeds) < RESTS_BELOW * system.width, 0.0, jnp.sign(speeds))
    dmn = jnp.where(found.mode < 0, -1, number_of(senses[:, 6] != 0.0, senses[:, 7] != 0.0))
    return CoreXYSolution(
        machine.parameters, machine.voltage, found.t, y,
        Accelerations(dy.vx, dy.vy, dy.omega_1, dy.omega_2), dmn.astype(jnp.int32), senses,
        Ledger(sums["motor_1"], sums["motor_2"], friction, slip), None, solution.flags,
        solution.result, "smoothed",
    )  # fmt: skip
