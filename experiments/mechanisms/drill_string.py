r"""A drill string: a driven table turns a long shaft, and rock rubs on the bit at its end.

$$J_t\dot\omega_t = D\,(\Omega - \omega_t) - k\theta - c\,(\omega_t - \omega_b), \qquad
  J_b\dot\omega_b = k\theta + c\,(\omega_t - \omega_b) - T(\omega_b), \qquad
  \dot\theta = \omega_t - \omega_b$$

with $T(\omega) = T_k + \Delta T\,e^{-\omega/\omega_s}$, and between $-T_s$ and $T_s$ at rest. Steady
drilling at the speed $\omega$ of both, $D(\Omega - \omega) = T(\omega)$, loses its stability (Hopf)
where the slope $f = T'(\omega)$ makes $p_1 p_2 = p_0 p_3$ of the characteristic polynomial
$\sum p_i\lambda^i$. That is a quadratic equation for $f$, and the law gives the speed in closed form:
$\omega_H = \omega_s\ln(-\Delta T/\omega_s f_H)$; the frequency there is $\sqrt{p_1/p_3}$.

Below $\omega_H$ the bit sticks and slips; so it does in some range above, where steady drilling is
stable too. Without damping of the shaft and with a table that turns evenly this range has no end; what
ends it here is found by sweeping the speed, and by an integration that shares nothing with the package
(tests).

The parameters are constructed, of the size of a rig: a shaft of kilometres, turned by a table of the
inertia of a few tonnes. N. Mihajlović, *Torsional and Lateral Vibrations in Flexible Rotor Systems with
Friction*, Eindhoven University of Technology, 2005, treats drill strings with friction beside
measurements on a rig in the laboratory.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.friction import AbstractFrictionLaw, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact

from .._experiment import Context, Experiment
from .._statement import Verdict, judge_all, statement
from .._thresholds import Machines
from ._shared import FAST, flow_matrix, verdict

RPM = 2.0 * np.pi / 60.0
INERTIA, BIT = 2000.0, 400.0  # [kg m²]
STIFFNESS, DAMPING, DRIVE = 500.0, 25.0, 4000.0  # [N m], [N m s], [N m s]
STATIC, KINETIC, FALL = 12000.0, 7500.0, 1.2  # [N m], [N m], [rad/s]


class DrillString(AbstractMechanism):
    """Table and bit, with the shaft between them as a spring."""

    inertia: Any
    bit_inertia: Any
    stiffness: Any
    damping: Any
    drive: Any
    law: AbstractFrictionLaw  # its coefficients are torques [N m]
    speed: Any  # that the drive aims at [rad/s]
    coordinates: ClassVar = {"table": "rad", "bit": "rad"}
    contact_directions: ClassVar = {"rock": {"bit": 1}}

    def mass_matrix(self, q):
        return {"table": self.inertia, "bit": self.bit_inertia}

    def forces(self, t, q, v, args):
        shaft = self.stiffness * (q.table - q.bit) + self.damping * (v.table - v.bit)
        return {"table": self.drive * (self.speed - v.table) - shaft, "bit": shaft}

    def contacts(self, t, q, v, args):
        return {"rock": Contact(self.law)}

    def potential_energy(self, q):
        return 0.5 * self.stiffness * (q.table - q.bit) ** 2

    def steady(self, speed: Any) -> Any:
        """The state in which both turn at `speed`, the shaft twisted as the bit needs it."""
        twist = self.law.kinetic(speed, 1.0) / self.stiffness
        return self.state(table=twist, v_table=speed, v_bit=speed)


def rig(speed: Any) -> DrillString:
    """The constructed rig; `speed` of the drive [rad/s]."""
    law = Stribeck(STATIC, KINETIC, FALL, 1)
    return DrillString(INERTIA, BIT, STIFFNESS, DAMPING, DRIVE, law, speed)


def polynomial(slope: Any) -> np.ndarray:
    """Coefficients of the characteristic polynomial, that of the cube first."""
    c, d = DAMPING, DRIVE
    return np.array(
        [
            INERTIA * BIT,
            INERTIA * (c + slope) + BIT * (c + d),
            (INERTIA + BIT) * STIFFNESS + c * d + (c + d) * slope,
            STIFFNESS * (d + slope),
        ]
    )


def torque(speed: Any) -> Any:
    """Torque of the sliding bit [N m]."""
    return KINETIC + (STATIC - KINETIC) * np.exp(-speed / FALL)


def aimed(speed: Any) -> Any:
    """Speed that the drive aims at [rad/s] where the bit turns evenly at `speed`."""
    return speed + torque(speed) / DRIVE


def hopf() -> tuple[float, float]:
    """Speed of the bit at which steady drilling loses its stability, and frequency there [rad/s]."""
    c, d = DAMPING, DRIVE
    # p1 p2 - p0 p3 = a f² + b f + e
    p2, p1 = INERTIA * c + BIT * (c + d), (INERTIA + BIT) * STIFFNESS + c * d
    a = INERTIA * (c + d)
    b = p2 * (c + d) + INERTIA * p1 - INERTIA * BIT * STIFFNESS
    e = p2 * p1 - INERTIA * BIT * STIFFNESS * d
    slope = (-b + np.sqrt(b * b - 4.0 * a * e)) / (2.0 * a)
    p = polynomial(slope)
    return FALL * np.log(-(STATIC - KINETIC) / (FALL * slope)), np.sqrt(p[2] / p[0])


def border_of(growth: np.ndarray, speed: np.ndarray) -> float:
    """Speed at which the growth falls through zero, by the inverse polynomial through all points."""
    size = np.abs(growth).max()
    return float(np.polyval(np.polyfit(growth / size, speed, min(8, len(speed) - 1)), 0.0))


def settled(speed: Any, start: Any, seconds: float) -> tuple[Any, Any, Any]:
    """Least and greatest speed of the bit over the last 60 s of `seconds`, time stuck, success."""
    machine = rig(speed)
    run = ss.simulate(
        machine, 0.0, seconds, start(machine), integrator=FAST, throw=False,
        saveat=ss.SaveAt(ts=seconds - 60.0 + jnp.linspace(0.0, 60.0, 1201), max_events=None),
    )  # fmt: skip
    v = run.outputs.y.v_bit
    stuck = jnp.mean(jnp.asarray(run.outputs.mode == 1, jnp.float64))
    return jnp.stack([jnp.min(v), jnp.max(v)]), stuck, run.successful


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Growth at steady speeds; end of motions begun at rest and in steady drilling; a motion."""
    q = parameters
    known, _ = hopf()
    bit = known * np.linspace(0.9, 1.13, q["fine"])
    tau = 2.0
    matrices = ss.map_lanes(
        lambda w: flow_matrix(rig(w + _torque(w) / DRIVE), rig(0.0).steady(w), tau),
        executor="portable",
    )(jnp.asarray(bit))
    # The angle of the whole string is free: one factor is 1 and says nothing.
    growth = np.array([_without_one(m, tau) for m in np.asarray(matrices)])
    aim = RPM * np.linspace(q["v_min"], q["v_max"], q["points"])
    rest = ss.map_lanes(lambda s: settled(s, lambda m: m.state(v_table=s), q["duration"]))
    # Steady drilling, disturbed by a hundredth of its speed.
    even = np.array([_steady_speed(s) for s in aim])
    steady = ss.map_lanes(
        lambda s, w: settled(s, lambda m: m.steady(w)._replace(v_bit=1.01 * w), q["duration"])
    )
    (range_rest, stuck_rest, fine), (range_even, stuck_even, fine_even) = (
        jax.tree.map(np.asarray, found)
        for found in (rest(jnp.asarray(aim)), steady(jnp.asarray(aim), jnp.asarray(even)))
    )
    shown = np.linspace(0.0, 60.0, 1201)
    machine = rig(40.0 * RPM)
    run = ss.simulate(
        machine, 0.0, 60.0, machine.state(v_table=40.0 * RPM),
        saveat=ss.SaveAt(ts=jnp.asarray(shown), max_events=None),
    )  # fmt: skip
    log: Any = run.outputs
    return xr.Dataset(
        {
            "growth": ("bit_speed", growth, {"units": "1/s"}),
            "range": (("start", "speed", "end"), np.array([range_rest, range_even])),
            "stuck": (("start", "speed"), np.array([stuck_rest, stuck_even]), {"units": "1"}),
            "motion": (
                ("quantity", "time"),
                np.stack([log.y.v_table, log.y.v_bit, np.asarray(log.mode) == 1]),
            ),
        },
        {
            "bit_speed": ("bit_speed", bit, {"units": "rad/s"}),
            "speed": ("speed", aim, {"units": "rad/s"}),
            "start": ["rest", "steady"], "end": ["least", "greatest"],
            "quantity": ["table", "bit", "stick"], "time": ("time", shown, {"units": "s"}),
        },
        attrs={"failed": int((~fine).sum() + (~fine_even).sum())},
    )  # fmt: skip


def _torque(speed):
    return rig(0.0).law.kinetic(speed, 1.0)


def _without_one(matrix: np.ndarray, tau: float) -> float:
    factors = np.linalg.eigvals(matrix)
    others = np.delete(factors, np.argmin(np.abs(factors - 1.0)))
    return float(np.log(np.abs(others).max()) / tau)


def _steady_speed(aim: float) -> float:
    """The greatest speed of the bit at which the drive's torque is that of the rock; 0 if none."""
    speed = np.linspace(1e-3, aim, 20001)
    surplus = aim - aimed(speed)
    held = np.flatnonzero(surplus >= 0.0)
    return float(speed[held[-1]]) if held.size else 0.0


def draw(dataset: xr.Dataset) -> Figure:
    """A stick-slip motion, growth rates of steady drilling, and what the rig settles to."""
    figure, axes = plt.subplot_mosaic([["motion", "motion"], ["growth", "range"]], figsize=(10.5, 6.4))
    table, bit, stick = np.asarray(dataset.motion) / np.array([[RPM], [RPM], [1.0]])
    time = np.asarray(dataset.time)
    plot.shade(time, stick > 0.5, label="bit sticks", ax=axes["motion"])
    axes["motion"].plot(time, table, color="#b7791f", label="table")
    axes["motion"].plot(time, bit, color="#1f4e9c", label="bit")
    axes["motion"].set(xlabel="$t$ [s]", ylabel="speed [1/min]", title="aiming at 40 1/min, from rest")
    known, _ = hopf()
    axes["growth"].axhline(0.0, color="0.7", lw=0.6)
    axes["growth"].axvline(known / RPM, color="0.5", lw=0.8, ls=":", label="closed form")
    axes["growth"].plot(dataset.bit_speed / RPM, dataset.growth, ".", color="#1f4e9c")
    axes["growth"].set(xlabel="steady speed of the bit [1/min]", ylabel="growth rate [1/s]")
    aim = np.asarray(dataset.speed) / RPM
    for start, colour, style in (("rest", "#c0392b", "v"), ("steady", "#1f4e9c", ".")):
        for end in ("least", "greatest"):
            values = dataset["range"].sel(start=start, end=end) / RPM
            axes["range"].plot(
                aim,
                values,
                style,
                color=colour,
                ms=3,
                label=f"from {start}" if end == "least" else None,
            )
    axes["range"].axvline(aimed(known) / RPM, color="0.5", lw=0.8, ls=":", label="closed form")
    axes["range"].set(
        xlabel="speed of the drive [1/min]", ylabel="least and greatest speed of the bit [1/min]"
    )
    for axis in axes.values():
        axis.legend(frameon=False, fontsize=7)
    return figure


def _sticks_up_to(dataset: xr.Dataset, start: str) -> float:
    """Greatest speed of the drive at which motions from `start` end in stick-slip [rad/s]."""
    return np.asarray(dataset.speed)[np.asarray(dataset.stuck.sel(start=start)) > 0.0].max()


def _spacing(dataset: xr.Dataset) -> float:
    """Step of the grid of speeds [rad/s]."""
    return np.diff(np.asarray(dataset.speed))[0]


@statement("M2.1", "Disturbances of steady drilling grow as the characteristic polynomial says.")
def grows_as_the_polynomial_says(dataset: xr.Dataset) -> Verdict:
    """Largest difference of the growth rates."""
    slopes = -(STATIC - KINETIC) / FALL * np.exp(-np.asarray(dataset.bit_speed) / FALL)
    roots = np.array([np.roots(polynomial(f)).real.max() for f in slopes])
    return verdict(
        float(np.abs(dataset.growth - roots).max() / np.abs(roots).max()), Machines.ROOTS,
        f"{len(roots)} speeds; relative to the largest",
    )  # fmt: skip


@statement("M2.2", "Steady drilling loses its stability at the speed of the Hopf bifurcation.")
def loses_stability_as_known(dataset: xr.Dataset) -> Verdict:
    """Difference of the critical speeds."""
    known, frequency = hopf()
    found = border_of(np.asarray(dataset.growth), np.asarray(dataset.bit_speed))
    return verdict(
        abs(found / known - 1.0), Machines.HOPF,
        f"{found / RPM:.4f} 1/min, closed form {known / RPM:.4f}, {frequency:.4f} rad/s",
    )  # fmt: skip


@statement("M2.3", "Motions begun beside steady drilling end in stick-slip below that speed only.")
def steady_drilling_is_left_below(dataset: xr.Dataset) -> Verdict:
    """Difference of the speeds of the drive."""
    leaves, critical = _sticks_up_to(dataset, "steady"), float(aimed(hopf()[0]))
    return verdict(
        abs(leaves - critical), Machines.STEPS * _spacing(dataset),
        f"up to {leaves / RPM:.2f} 1/min of the drive, closed form {critical / RPM:.2f}; in rad/s",
    )  # fmt: skip


@statement("M2.4", "Stick-slip begun at rest goes on above that speed.")
def stick_slip_goes_on_above(dataset: xr.Dataset) -> Verdict:
    """The speed of the drive up to which motions from rest end in stick-slip."""
    ends = _sticks_up_to(dataset, "rest")
    return (
        ends > _sticks_up_to(dataset, "steady") + _spacing(dataset),
        f"up to {ends / RPM:.2f} 1/min of the drive, looked at up to "
        f"{float(dataset.speed[-1]) / RPM:g}",
    )


judge = judge_all("M2.")


EXPERIMENT = Experiment(
    name="mechanism-drill-string",
    title="Drill string: stick-slip of the bit, and the speed above which drilling is steady",
    parameters={
        "v_min": 30.0, "v_max": 300.0, "points": 271, "fine": 41, "duration": 1500.0,
    },
    quick={"points": 46, "fine": 9, "duration": 600.0},
    compute=compute,
    draw=draw,
    judge=judge,
)  # fmt: skip
