r"""The double pendulum as a declared mechanism in the parameters that a motion tells, and a problem.

With the links $l_1$ and the motors behind gears known, the motion depends on five inertial parameters
only: the moments $m_1r_1 + m_2l_1$ and $m_2r_2$, the inertias $I_1 + m_2l_1^2 + I_r(g_r^2 + 1)$ and
$I_2$, and that of a motor, $I_r$. Friction in each joint is dry and viscous.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import scipy.signal

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import Observed, Problem, Record, Signal, Unknown
from stickslip.mechanism import AbstractMechanism, Contact

from ._record import STEP, Motion

LINK, GEAR, GRAVITY = 0.2, 6.0, 9.81  # first link [m], ratio of the gears, [m/s²]
UNITS = {
    "moment_1": "kg m", "moment_2": "kg m", "inertia_1": "kg m²", "inertia_2": "kg m²",
    "inertia_motor": "kg m²", "viscous_1": "N m s", "dry_1": "N m", "viscous_2": "N m s",
    "dry_2": "N m",
}  # fmt: skip
INERTIAL = tuple(UNITS)[:5]
DRY = ("dry_1", "dry_2")
SIGMA = 0.01  # of an angle: what the residuals show [rad]
CUT_OFF, ORDER, KNOTS = 25.0, 4, 5  # of the filter of the torque [Hz]; a knot in so many samples


class DoublePendulum(AbstractMechanism):
    """Two links with a motor in each joint, under torques [N m]; `values` by the names of `UNITS`."""

    values: dict[str, Any]
    tau_1: Any
    tau_2: Any

    coordinates: ClassVar = {"q1": "rad", "q2": "rad"}
    contact_directions: ClassVar = {"shoulder": (1, 0), "elbow": (0, 1)}

    def mass_matrix(self, q):
        p = self.values
        across = LINK * p["moment_2"] * jnp.cos(q.q2)
        both = p["inertia_2"] + across - GEAR * p["inertia_motor"]
        return (
            (p["inertia_1"] + p["inertia_2"] + 2.0 * across, both),
            (both, p["inertia_2"] + GEAR**2 * p["inertia_motor"]),
        )

    def forces(self, t, q, v, args):
        p = self.values
        turned = LINK * p["moment_2"] * jnp.sin(q.q2)
        lower = GRAVITY * p["moment_2"] * jnp.sin(q.q1 + q.q2)
        upper = GRAVITY * p["moment_1"] * jnp.sin(q.q1)
        return (
            self.tau_1(t) - p["viscous_1"] * v.q1 - upper - lower + turned * (2.0 * v.q1 + v.q2) * v.q2,
            self.tau_2(t) - p["viscous_2"] * v.q2 - lower - turned * v.q1**2,
        )

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(self.values[name])) for name in DRY]

    def time_scale(self, args):
        return 0.01

    def potential_energy(self, q):
        p = self.values
        return -GRAVITY * (p["moment_1"] * jnp.cos(q.q1) + p["moment_2"] * jnp.cos(q.q1 + q.q2))


def torque(motion: Motion, joint: int) -> Signal:
    """Torque of a joint as a spline, without what the pendulum is too slow for."""
    parts = scipy.signal.butter(ORDER, 2.0 * CUT_OFF * STEP)
    smooth = scipy.signal.filtfilt(*parts, motion.tau[joint])
    last = motion.time.size - 1
    knots = np.unique(np.append(np.arange(0, last, KNOTS), last))
    return Signal(motion.time[knots], smooth[knots], "cubic")


def arm(values: dict[str, Any], inputs: dict[str, Any]) -> DoublePendulum:
    """The pendulum under values by name and the two torques."""
    return DoublePendulum({name: values[name] for name in UNITS}, inputs["tau_1"], inputs["tau_2"])


def problem(motions: Sequence[Motion], starts: dict[str, float], every: int) -> Problem:
    """All of `UNITS` from every `every`-th angle; each record begins at rest, at its first angles."""
    records = [
        Record(
            motion.time[::every],
            {"q1": motion.q[0, ::every], "q2": motion.q[1, ::every]},
            inputs={"tau_1": torque(motion, 0), "tau_2": torque(motion, 1)},
            known={"at_1": motion.q[0, 0], "at_2": motion.q[1, 0]},
            units={"q1": "rad", "q2": "rad"}, name=str(i + 1),
        )
        for i, motion in enumerate(motions)
    ]  # fmt: skip
    return Problem(
        system=arm,
        initial_state=lambda p, inputs: arm(p, inputs).state(q1=p["at_1"], q2=p["at_2"]),
        unknowns={
            name: Unknown(start, bounds=(0.0, None), unit=UNITS[name]) for name, start in starts.items()
        },
        observed={
            "q1": Observed(lambda t, y, system: y.q1, SIGMA, "rad"),
            "q2": Observed(lambda t, y, system: y.q2, SIGMA, "rad"),
        },
        records=records,
        integrator=ss.Integrator("rk4", ss.FixedStep(5e-3), max_steps=50_000),
    )
