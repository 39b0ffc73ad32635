"""What a machine does under the voltages of a feedforward."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip import Integrator
from stickslip.checks import Given, check_type

from ._arguments import the_integrator, the_machine
from ._modes import MODE_DMN
from ._parameters import CoreXYParameters
from ._plan import Feedforward
from ._simulate import simulate_consistent
from ._solution import CoreXYSolution
from ._system import CoreXY
from ._voltage import AbstractVoltage

AFTER = 0.25  # part of the plan for which a check goes on behind its end


class RollingCheck(eqx.Module):
    """What the machine does under the voltages of a plan; `print` says it in words.

    - `slip` [m]: distance that each belt slips. `first_slip` [s]: when, infinite if never.
    - `deviation` [m]: greatest distance from the planned place. `end_error` [m]: distance of the collar
      from the last point at the end of the check. `at_rest`: whether it rests there.
    - `solution`: the `CoreXYSolution`.
    """

    slip: Float[Array, "2"]
    first_slip: Float[Array, "2"]
    deviation: Float[Array, ""]
    end_error: Float[Array, ""]
    at_rest: Array
    solution: CoreXYSolution

    @property
    def rolls(self) -> Array:
        """Whether each motor rolls all the time."""
        return jnp.isinf(self.first_slip)

    def __str__(self):
        slips = [
            f"belt {i + 1} slips from {self.first_slip[i]:.4g} s on, {1e3 * self.slip[i]:.3g} mm in all"
            for i in np.flatnonzero(~np.asarray(self.rolls))
        ]
        word = "at rest" if self.at_rest else "still moving"
        end = f"the collar ends {1e3 * self.end_error:.3g} mm off, {word}"
        return "; ".join([*(slips or ["both motors roll all the time"]), end])


def check_rolling(
    plan: Given[Feedforward],
    parameters: Given[CoreXYParameters | None] = None,
    *,
    voltage: Given[AbstractVoltage | None] = None,
    rows: int = 401,
    integrator: Integrator | None = None,
) -> RollingCheck:
    """Simulate a plan with all its events, on the machine it was made for or on another one.

    **Arguments:** `plan`; `parameters` of another machine, e.g. with wrong tensions; `voltage` in place
    of the plan's, e.g. sampled; `rows` at which the deviation is computed, until a quarter of the plan
    after its end; `integrator` as for `simulate`. **Returns** a `RollingCheck`. **Raises** `TypeError`,
    `ValueError` for an argument of another kind, and where the run fails.
    """
    check_type("plan", plan, Feedforward, "a Feedforward")
    p = plan.parameters if parameters is None else the_machine(parameters, "parameters")
    if voltage is None:
        voltage = plan.voltage
    check_type("voltage", voltage, AbstractVoltage | None, "an AbstractVoltage or None")
    the_integrator(integrator)
    t1 = (1.0 + AFTER) * plan.end
    start = CoreXY(p, voltage).state(x=plan.points[0, 0], y=plan.points[0, 1])
    found = simulate_consistent(p, voltage, t1, rows=rows, y0=start, integrator=integrator)
    return _checked(plan, found)


@eqx.filter_jit
def _checked(plan: Feedforward, found: CoreXYSolution) -> RollingCheck:
    log = found.events
    assert log is not None
    happened = jnp.arange(log.t.shape[0], dtype=jnp.int32) < log.count
    dmn = jnp.asarray(MODE_DMN)[jnp.maximum(log.mode_after, 0)]
    times, models = jnp.append(log.t, 0.0), jnp.append(jnp.where(happened, dmn, 1), found.dmn[0])
    slips = jnp.stack([(models == 2) | (models == 4), models >= 3])
    first = jnp.min(jnp.where(slips, times[None], jnp.inf), axis=1)
    place = jnp.stack([found.y.x, found.y.y], axis=-1)
    off = jnp.linalg.norm(place - plan.at(found.t), axis=-1)
    still = jnp.all(found.senses[-1] == 0.0)
    return RollingCheck(found.ledger.slip[-1], first, jnp.max(off), off[-1], still, found)
