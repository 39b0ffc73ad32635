r"""The double pendulum as a declared mechanism in the parameters that a motion shows, and a problem.

With the links $l_1$ and the motors behind gears known, the motion depends on five inertial parameters
only: the moments $m_1r_1 + m_2l_1$ and $m_2r_2$, the inertias $I_1 + m_2l_1^2 + I_r(g_r^2 + 1)$ and
$I_2$, and that of a motor, $I_r$. Friction in each joint is dry and viscous.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import Observed, Problem, Record, Signal, Unknown
from stickslip.mechanism import AbstractMechanism, Contact

from ._record import STEP, Motion, low_passed

LINK, GEAR, GRAVITY = 0.2, 6.0, 9.81  # first link [m], ratio of the gears, [m/s²]
UNITS = {
    "moment_1": "kg m", "moment_2": "kg m", "inertia_1": "kg m²", "inertia_2": "kg m²",
    "inertia_motor": "kg m²", "viscous_1": "N m s", "dry_1": "N m", "viscous_2": "N m s",
    "dry_2": "N m",
}  # fmt: skip
INERTIAL = tuple(UNITS)[:5]
DRY = ("dry_1", "dry_2")
ZEROS = ("zero_1", "zero_2")
LEAST = {"kg m": 1e-3, "kg m²": 1e-6, "N m s": 1e-5, "N m": 1e-4}  # where a fit may begin
SIGMA = 0.01  # of an angle: what the residuals show [rad]
CUT_OFF, KNOTS = 25.0, 5  # of the filter of the torque [Hz]; a knot in so many samples


class State(NamedTuple):
    """Angles [rad] and their velocities [rad/s]."""

    q1: Any
    q2: Any
    v_q1: Any
    v_q2: Any


class DoublePendulum(AbstractMechanism):
    """Two links with a motor in each joint, under torques [N m]; `values` by the names of `UNITS`."""

    values: dict[str, Any]
    tau_1: Any
    tau_2: Any
    zeros: tuple = (0.0, 0.0)  # what the encoders show where it hangs [rad]
    gain: Any = 1.0  # torque of the second motor in units of what is told

    state_class: ClassVar = State
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
            self.gain * self.tau_2(t) - p["viscous_2"] * v.q2 - lower - turned * v.q1**2,
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
    smooth = low_passed(motion.tau[joint], CUT_OFF)
    last = motion.time.size - 1
    knots = np.unique(np.append(np.arange(0, last, KNOTS), last))
    return Signal(motion.time[knots], smooth[knots], "cubic")


def arm(values: dict[str, Any], inputs: dict[str, Any]) -> DoublePendulum:
    """The pendulum under values by name and the two torques."""
    named = {name: values[name] for name in UNITS}
    zeros = tuple(values[name] for name in ZEROS)
    return DoublePendulum(named, inputs["tau_1"], inputs["tau_2"], zeros, values["gain"])


def start(values: dict[str, Any], inputs: dict[str, Any]) -> Any:
    """At rest, where the encoders show `at_1` and `at_2` [rad]."""
    at = [values[name] - values[zero] for name, zero in zip(("at_1", "at_2"), ZEROS, strict=True)]
    return arm(values, inputs).state(q1=at[0], q2=at[1])


def shot(t: float, values: dict[str, float], slopes: dict[str, float]) -> Any:
    """A state from what was measured near the time `t` [s], for multiple shooting."""
    return State(values["q1"], values["q2"], slopes["q1"], slopes["q2"])


def first_shown(t: Any, y: Any, system: Any) -> Any:
    """What the first encoder shows [rad]."""
    return y.q1 + system.zeros[0]


def second_shown(t: Any, y: Any, system: Any) -> Any:
    """What the second encoder shows [rad]."""
    return y.q2 + system.zeros[1]


def problem(
    motions: Sequence[Motion], starts: dict[str, float], every: int, *, zeros: bool = True,
    gain: bool = False, known: dict[str, float] | None = None, last: float = np.inf,
) -> Problem:  # fmt: skip
    """All of `UNITS` from every `every`-th angle up to the time `last` [s], and with `zeros` what the
    encoders show where the pendulum hangs; each record begins at rest, at its first angles.

    The encoders count from where friction held the pendulum. With `gain` the torque of the second motor
    may differ from that of its current, in units of the first: a motion says nothing on the unit of
    both. With `known` values only the zeros are unknown.
    """
    records = []
    for i, motion in enumerate(motions):
        time = motion.time[::every]
        numbers = {"at_1": motion.q[0, 0], "at_2": motion.q[1, 0]} | (known or {})
        numbers |= {} if zeros else dict.fromkeys(ZEROS, 0.0)
        numbers |= {} if gain or known else {"gain": 1.0}
        records.append(
            Record(
                time, {"q1": motion.q[0, ::every], "q2": motion.q[1, ::every]},
                inputs={"tau_1": torque(motion, 0), "tau_2": torque(motion, 1)},
                missing=dict.fromkeys(("q1", "q2"), time > last), known=numbers,
                units={"q1": "rad", "q2": "rad"}, name=str(i + 1),
            )
        )  # fmt: skip
    unknowns = {} if known else {
        name: Unknown(max(starts[name], LEAST[unit]), bounds=(0.0, None), unit=unit)
        for name, unit in UNITS.items()
    }  # fmt: skip
    if gain and not known:
        unknowns["gain"] = Unknown(1.0, bounds=(0.0, None), unit="1")
    if zeros:
        unknowns |= {name: Unknown(0.0, unit="rad", per_record=True, scale=0.01) for name in ZEROS}
    return Problem(
        system=arm,
        initial_state=start,
        unknowns=unknowns,
        observed={
            # Functions of the module, so that problems of one kind share what is traced.
            "q1": Observed(first_shown, SIGMA, "rad"),
            "q2": Observed(second_shown, SIGMA, "rad"),
        },
        records=records,
        integrator=ss.Integrator("rk4", ss.FixedStep(5e-3), max_steps=50_000),
    )


def errors(task: Problem, values: dict[str, Any], motions: Sequence[Motion]) -> list[np.ndarray]:
    """Both angles as computed less those measured [rad] at the stamps of each record, hidden or not."""
    found = []
    for i, motion in enumerate(motions):
        computed = task.simulate(values, i).observed
        every = round((task.records[i].times[1] - task.records[i].times[0]) / STEP)
        found.append(np.stack([np.asarray(computed[n]) for n in ("q1", "q2")]) - motion.q[:, ::every])
    return found
