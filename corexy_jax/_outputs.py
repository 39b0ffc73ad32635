"""Everything the paper's figures show, as one labelled dataset."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from stickslip.checks import check_type, refusal
from stickslip.hybrid import jit_by_code

from ._arguments import the_errata
from ._contacts import CONTACT_NAMES, MOTOR_1
from ._dead_zone import axis_dead_zones, motor_dead_zone, voltage_dead_zone
from ._errata import Errata
from ._friction_torques import belt_friction
from ._kinematics import virtual_pulleys
from ._motors import motor_torque, voltage_for_torque
from ._solution import CoreXYSolution
from ._transitions import available_coefficients, needed_friction

_CORRECTED = Errata.corrected()


def outputs(solution: CoreXYSolution, errata: Errata | None = None) -> xr.Dataset:
    r"""Motion, friction, torques, voltages and energies over time, with units.

    Along `time` [s]:

    - `x`, `y`, `vx`, `vy`, `ax`, `ay`; by `motor`: `theta`, `omega`, `alpha` of the pulleys and
      `theta_v`, `omega_v`, `alpha_v` of the virtual ones, Eqs. (12)-(15); `dmn`; `sense` by `contact`.
    - `mu_needed`, `mu_available`: coefficients of the belts, Eqs. (77)-(84), needed only while rolling
      (NaN in slip). A motor pulley at rest takes from its belt what the ground does not hold.
    - `tau_motor`: $\tau^E$; `tau_belt`: torque that each side feeds into the belt, $\tau_i^E$ rolling,
      $-f_{ik}^b r$ slipping; `tau_x`, `tau_y`: their sum and difference, with the dead-zone bounds
      `dead_x`, `dead_y`; `dead_motor`: bound of each motor pulley.
    - `v`: voltages; `v_low`, `v_high`: the dead zone of each motor in its voltage, Eq. (3) at its
      present speed; `v_corner`: corners of the dead zone of the machine at rest in the plane.
    - `work` by `motor`, `friction` by `contact`, `slip` by `motor` (distance), `energy` (kinetic),
      `energy_error`.

    **Arguments:** one `CoreXYSolution`; `errata`, those with which an `as_printed` run was made.
    **Raises** `TypeError` for anything else, `ValueError` for a batch.
    """
    check_type("solution", solution, CoreXYSolution, "a CoreXYSolution")
    if jnp.ndim(solution.t) != 1:
        raise refusal("solution", solution, "one run, not a batch", but=f"of shape {solution.t.shape}")
    errata = _CORRECTED if errata is None else the_errata(errata)
    columns = jax.tree.map(np.asarray, _columns(solution, errata))
    by = {"motor": ("time", "motor"), "contact": ("time", "contact"), "time": ("time",)}
    data = {
        name: (by[axis], values, {"units": unit, "long_name": text})
        for name, (axis, unit, text) in _TABLE.items()
        for values in [columns[name]]
    }
    corners = np.asarray(voltage_dead_zone(solution.parameters))
    data["v_corner"] = (
        ("corner", "motor"), corners, {"units": "V", "long_name": "dead zone of the machine at rest"}
    )  # fmt: skip
    return xr.Dataset(
        data,
        {
            "time": ("time", np.asarray(solution.t), {"units": "s"}),
            "motor": [1, 2],
            "contact": list(CONTACT_NAMES),
        },
        {"method": solution.method},
    )


_TABLE = {
    "x": ("time", "m", "position x"),
    "y": ("time", "m", "position y"),
    "vx": ("time", "m/s", "velocity x"),
    "vy": ("time", "m/s", "velocity y"),
    "ax": ("time", "m/s2", "acceleration x"),
    "ay": ("time", "m/s2", "acceleration y"),
    "theta": ("motor", "rad", "angle of the motor pulley"),
    "omega": ("motor", "rad/s", "speed of the motor pulley"),
    "alpha": ("motor", "rad/s2", "acceleration of the motor pulley"),
    "theta_v": ("motor", "rad", "angle of the virtual pulley"),
    "omega_v": ("motor", "rad/s", "speed of the virtual pulley"),
    "alpha_v": ("motor", "rad/s2", "acceleration of the virtual pulley"),
    "dmn": ("time", "1", "dynamic model number: 1 RR, 2 SR, 3 RS, 4 SS"),
    "sense": ("contact", "1", "sense of sliding, 0 at rest"),
    "mu_needed": ("motor", "1", "coefficient that rolling needs"),
    "mu_available": ("motor", "1", "coefficient up to which the belt holds"),
    "tau_motor": ("motor", "N m", "torque of the motor"),
    "tau_belt": ("motor", "N m", "torque fed into the belt"),
    "tau_x": ("time", "N m", "torque along x"),
    "tau_y": ("time", "N m", "torque along y"),
    "dead_x": ("time", "N m", "bound of the dead zone along x"),
    "dead_y": ("time", "N m", "bound of the dead zone along y"),
    "dead_motor": ("motor", "N m", "bound of the dead zone of the motor pulley"),
    "v": ("motor", "V", "voltage"),
    "v_low": ("motor", "V", "lower end of the mapped dead zone"),
    "v_high": ("motor", "V", "upper end of the mapped dead zone"),
    "work": ("motor", "J", "work of the motor"),
    "friction": ("contact", "J", "friction energy"),
    "slip": ("motor", "m", "slip distance of the belt"),
    "energy": ("time", "J", "kinetic energy"),
    "energy_error": ("time", "J", "kinetic energy not accounted for"),
}


@jit_by_code
def _columns(s: CoreXYSolution, errata: Errata) -> dict[str, Any]:
    p, y, a = s.parameters, s.y, s.a
    motors = slice(MOTOR_1, MOTOR_1 + 2)

    def pair(one, two):
        return jnp.stack(jnp.broadcast_arrays(one, two), axis=-1)

    volts = jax.vmap(s.voltage)(s.t)
    omega, alpha = pair(y.omega_1, y.omega_2), pair(a.alpha_1, a.alpha_2)
    virtual = pair(*virtual_pulleys(a.x, a.y, p.r))
    v = pair(*volts)
    tau = motor_torque(p, v, omega)
    sense = s.senses
    # By the model, not by the sense: a belt that has only just begun to slip has no speed yet.
    slips = pair((s.dmn == 2) | (s.dmn == 4), (s.dmn == 3) | (s.dmn == 4))
    static = pair(*motor_dead_zone(p))[None, :] + jnp.zeros_like(tau)
    kinetic = static * (p.mu_k / jnp.where(p.mu_s > 0, p.mu_s, 1.0))
    kinetic = jnp.where(p.mu_s > 0, kinetic, 2.0 * p.mu_k * pair(p.P1, p.P2)[None, :] * p.r_f)
    turning, belt_sense = sense[:, motors], sense[:, 6:]
    holding = jnp.where(alpha == 0.0, -jnp.clip(tau, -static, static), -static * jnp.sign(alpha))
    ground = jnp.where(turning == 0.0, holding, -kinetic * turning)
    needed = needed_friction(
        p, (virtual[:, 0], virtual[:, 1]), (tau[:, 0], tau[:, 1]), (ground[:, 0], ground[:, 1]), errata
    )
    rolls = 1.0 - slips.astype(jnp.float64)
    belts = pair(*belt_friction(p, belt_sense[:, 0], belt_sense[:, 1])) * p.r
    back = belts if not errata.A2 else -belts
    tau_belt = jnp.where(slips, back, tau)
    dead_x, dead_y = axis_dead_zones(p, rolls[:, 0], rolls[:, 1])
    available = pair(*available_coefficients(p, errata))[None, :] + jnp.zeros_like(tau)
    return {
        "x": y.x, "y": y.y, "vx": y.vx, "vy": y.vy, "ax": a.x, "ay": a.y,
        "theta": pair(y.theta_1, y.theta_2), "omega": omega, "alpha": alpha,
        "theta_v": pair(*virtual_pulleys(y.x, y.y, p.r)),
        "omega_v": pair(*virtual_pulleys(y.vx, y.vy, p.r)),
        "alpha_v": virtual,
        "dmn": s.dmn, "sense": sense,
        "mu_needed": jnp.where(slips, jnp.nan, pair(needed.mu_1s, needed.mu_2s)),
        "mu_available": available,
        "tau_motor": tau, "tau_belt": tau_belt,
        "tau_x": tau_belt[:, 0] + tau_belt[:, 1], "tau_y": tau_belt[:, 0] - tau_belt[:, 1],
        "dead_x": dead_x, "dead_y": dead_y, "dead_motor": static,
        "v": v,
        "v_low": voltage_for_torque(p, -static, omega),
        "v_high": voltage_for_torque(p, static, omega),
        "work": pair(s.ledger.motor_1, s.ledger.motor_2),
        "friction": s.ledger.friction, "slip": s.ledger.slip,
        "energy": s.kinetic_energy(), "energy_error": s.energy_error(),
    }  # fmt: skip
