"""Supply voltage at which the drive moves the belt at a wanted speed."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from .._validation import as_parameter, check_type, one_number
from ..derived import WithIntegrals
from ..hybrid import FixedStep, Integrator, SaveAt, simulate
from ._driven_belt import AbstractBlockOnDrivenBelt, DrivenBlockState


def mean_belt_speed(
    system: AbstractBlockOnDrivenBelt,
    *,
    transient: float = 100.0,
    duration: float = 100.0,
    integrator: Integrator | None = None,
) -> Any:
    """Mean of the belt velocity [m/s] over `duration` [s] after `transient` [s], started at rest.

    By default with steps of 1 ms of Tsit5, which the winding and the contact of set A allow. Errors:
    `ValueError`/`TypeError` naming the argument.
    """
    _check_system(system)
    check_type("integrator", integrator, Integrator | None, "an Integrator or None")
    if integrator is None:
        integrator = Integrator(method="tsit5", step=FixedStep(1e-3), max_steps=10**9)
    lasts = as_parameter(one_number("duration", duration, "positive"))
    dropped = as_parameter(one_number("transient", transient, "positive"))
    travelling = WithIntegrals(system, _belt_velocity, units={"travel": "m"})
    start = travelling.start(DrivenBlockState(*(jnp.zeros(()),) * 6))
    ts = jnp.stack([dropped, dropped + lasts])
    solution = simulate(
        travelling, 0.0, dropped + lasts, start, integrator=integrator,
        saveat=SaveAt(ts=ts, max_events=None),
    )  # fmt: skip
    assert solution.outputs is not None
    travel = solution.outputs.y.integrals["travel"]
    return (travel[1] - travel[0]) / lasts


def voltage_for_belt_speed(
    system: AbstractBlockOnDrivenBelt, speed: float, *, tolerance: float = 1e-9, **options: Any
) -> float:
    """Voltage `U_in` [V] at which the mean belt speed is `speed` [m/s].

    The secant method on `mean_belt_speed(system, **options)`, from the system's own voltage. The mean
    is smooth in the voltage as long as the motion is periodic; where it is chaotic, do not ask for
    more than its scatter.

    Errors: `ValueError` for a speed or tolerance that is not positive; `RuntimeError` if the speed
    does not come within `tolerance` [m/s] after 20 evaluations, e.g. because the drive stays at rest.
    """
    _check_system(system)
    one_number("speed", speed, "positive")
    one_number("tolerance", tolerance, "positive")

    @jax.jit
    def error(U_in):
        changed = eqx.tree_at(lambda s: s.drive.U_in, system, U_in)
        return mean_belt_speed(changed, **options) - speed

    drive = system.drive
    U, last_U = float(drive.U_in), None
    # Without coupling, the speed grows by this much per volt.
    slope = float(drive.transmission / (drive.k_e + drive.R_w * drive.b / drive.k_m))
    last_error = 0.0
    evaluations = 20
    for _ in range(evaluations):
        now = float(error(jnp.asarray(U)))
        if abs(now) <= tolerance:
            return U
        if last_U is not None and now != last_error:
            slope = (now - last_error) / (U - last_U)
        U, last_U, last_error = U - now / slope, U, now
    raise RuntimeError(
        f"the mean belt speed is {last_error + speed:.6g} m/s at U_in = {last_U} V, not {speed} m/s; "
        f"{evaluations} evaluations were made."
    )


def _check_system(system: Any) -> None:
    allowed = "a BlockOnDrivenBelt or a BlockOnDrivenBeltSetValued"
    check_type("system", system, AbstractBlockOnDrivenBelt, allowed)


def _belt_velocity(system, t, y, mode, args):
    return {"travel": system.belt_velocity(y)}
