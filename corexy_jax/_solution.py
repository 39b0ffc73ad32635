"""What a simulation of the machine returns, by whichever method."""

from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from stickslip import RESULTS
from stickslip.checks import is_concrete
from stickslip.hybrid import EventLog

from ._parameters import CoreXYParameters
from ._system import CoreXYState
from ._voltage import AbstractVoltage

if TYPE_CHECKING:
    from typing import Any as MaybeNone  # as in `Solution`
else:
    MaybeNone = None


class Accelerations(NamedTuple):
    """`x`, `y` [m/s²], motor pulleys `alpha_1`, `alpha_2` [rad/s²]."""

    x: Any
    y: Any
    alpha_1: Any
    alpha_2: Any


class Ledger(NamedTuple):
    """Energies since the start [J].

    - `motor_1`, `motor_2`: work of the motors on their shafts.
    - `friction`: energy into the mechanism at each of `CONTACT_NAMES`, negative where it is lost,
      last axis the contact.
    - `slip`: slip distance of the two belts [m], last axis the belt.
    """

    motor_1: Any
    motor_2: Any
    friction: Any
    slip: Any


class CoreXYSolution(eqx.Module):
    """Motion at the output times; the same for `consistent`, `as_printed` and `smoothed`.

    **Attributes** (leading axes those of a batch, then the output times; NaN, -1 past a failure):

    - `t` [s], `y` a `CoreXYState`, `a` its `Accelerations`.
    - `dmn`: dynamic model number, 1 RR, 2 SR, 3 RS, 4 SS.
    - `senses`: of every contact, -1, 0 (at rest), 1, last axis the contact.
    - `ledger`: a `Ledger`.
    - `events`: the transitions of `consistent`, else `None`; `flags`: its bits where a derivative does
      not exist, else 0.
    - `result`: `stickslip.RESULTS`. `method`: which of the three.
    """

    parameters: CoreXYParameters
    voltage: AbstractVoltage
    t: Float[Array, "*batch time"]
    y: CoreXYState
    a: Accelerations
    dmn: Int[Array, "*batch time"]
    senses: Float[Array, "*batch time 8"]
    ledger: Ledger
    events: EventLog | MaybeNone
    flags: Int[Array, "*batch"]
    result: Any
    method: str = eqx.field(static=True)

    def __repr__(self) -> str:
        if not is_concrete(self):
            return f"CoreXYSolution(traced, of shape {self.t.shape})"
        if self.t.ndim > 1:
            return f"CoreXYSolution: {self.method}, runs of shape {self.t.shape[:-1]}: {self.result}"
        seen = "" if self.events is None else f", {int(self.events.count):,} events"
        flags = "none" if int(self.flags) == 0 else f"{int(self.flags)}"
        span = f"t = {float(self.t[0]):g} to {float(jnp.nanmax(self.t)):g} s"
        return (
            f"CoreXYSolution: {self.method}, {span} in {self.t.size:,} rows{seen}; {self.result}; "
            f"derivative flags: {flags}"
        )

    @property
    def successful(self) -> Bool[Array, "*batch"]:
        """Whether the run reached its end."""
        return self.result == RESULTS.successful

    def kinetic_energy(self) -> Float[Array, "*batch time"]:
        r"""$\tfrac12(m + 8J'/r^2)\dot x^2 + \tfrac12(M + m + 4J'/r^2)\dot y^2 +
        \tfrac12 J(\omega_1^2 + \omega_2^2)$ [J]."""
        p, y = self.parameters, self.y
        pulley = p.J_passive / p.r**2
        expand = (..., None) if jnp.ndim(p.r) else ...
        m_x, m_y, J = (
            jnp.asarray(a)[expand] for a in (p.m + 8.0 * pulley, p.M + p.m + 4.0 * pulley, p.J)
        )
        return 0.5 * (m_x * y.vx**2 + m_y * y.vy**2 + J * (y.omega_1**2 + y.omega_2**2))

    def energy_error(self) -> Float[Array, "*batch time"]:
        """Kinetic energy gained minus work of the motors and of friction [J]; 0 if all is accounted."""
        energy, ledger = self.kinetic_energy(), self.ledger
        work = ledger.motor_1 + ledger.motor_2 + jnp.sum(ledger.friction, axis=-1)
        return energy - energy[..., :1] - work + work[..., :1]
