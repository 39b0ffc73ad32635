r"""Froude's pendulum: its bearing sits on a shaft that turns, and the friction there sets it swinging.

$$J\ddot\varphi + c\,\dot\varphi + mgl\,\sin\varphi = -T(\dot\varphi - \Omega)$$

Where the friction torque falls with the sliding speed, faster than the damper takes, the pendulum does
not stay where the torque holds it. With the Gaussian Stribeck law
$T(u) = T_k + \Delta T\,e^{-(u/u_s)^2}$ and $\Omega = u_s/\sqrt2$, where it falls fastest,
$T'(\Omega) = -\sqrt{2/e}\,\Delta T/u_s$ and $T''' = 4\sqrt{2/e}\,\Delta T/u_s^3$, known are

- the rate at which small swings grow, $-(c + T')/2J$;
- the amplitude of their velocity by averaging, $W = u_s\sqrt{2(1 - r)}$ with $r = c/|T'|$, exact as
  $r \to 1$;
- where the swings reach the shaft's speed and the bearing begins to stick: where the averaged torque
  $\overline{T(\Omega - W\cos\theta)\cos\theta} = cW/2$ has $W = \Omega$, near $r = 3/4$.
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
from ._shared import FAST, flow_matrix, rates_of, verdict


class FroudePendulum(AbstractMechanism):
    """A pendulum whose bearing rubs on a turning shaft."""

    inertia: Any  # [kg m²]
    weight: Any  # m g l [N m]
    damping: Any  # [N m s]
    law: AbstractFrictionLaw  # its coefficients are torques [N m]
    shaft_speed: Any  # [rad/s]
    coordinates: ClassVar = {"phi": "rad"}
    contact_directions: ClassVar = {"bearing": {"phi": 1}}

    def mass_matrix(self, q):
        return {"phi": self.inertia}

    def forces(self, t, q, v, args):
        return {"phi": -self.weight * jnp.sin(q.phi) - self.damping * v.phi}

    def contacts(self, t, q, v, args):
        return {"bearing": Contact(self.law, surface_speed=self.shaft_speed)}

    def potential_energy(self, q):
        return -self.weight * jnp.cos(q.phi)

    def held(self) -> Any:
        """Angle at which the friction torque balances the weight [rad]."""
        return jnp.arcsin(self.law.kinetic(self.shaft_speed, 1.0) / self.weight)


STEEPEST = np.sqrt(2.0 / np.e)  # of the Gaussian law, in units of its drop over its velocity


def pendulum(ratio: Any, drop: float = 0.4, speed: float = 1.0) -> FroudePendulum:
    """A pendulum of 1 kg m² and 2π rad/s whose damper takes `ratio` of what friction gives.

    `drop` is that of the torque [N m], `speed` the shaft's [rad/s], where the torque falls fastest.
    """
    u_s = np.sqrt(2.0) * speed
    law = Stribeck(0.2 + drop, 0.2, u_s, 2)
    return FroudePendulum(1.0, (2.0 * np.pi) ** 2, ratio * STEEPEST * drop / u_s, law, speed)


def averaged_ratio(size: np.ndarray) -> np.ndarray:
    """`ratio` at which averaging gives swings of the velocity amplitude `size` in shaft speeds."""
    angle = 2.0 * np.pi * (np.arange(4096) + 0.5) / 4096
    u = (1.0 - np.asarray(size)[..., None] * np.cos(angle)) / np.sqrt(2.0)
    torque = np.exp(-(u**2))  # over the drop
    given = np.mean(torque * np.cos(angle), axis=-1)
    return 2.0 * given * np.sqrt(2.0) / (STEEPEST * np.asarray(size))


def border() -> float:
    """`ratio` at which the averaged swings reach the speed of the shaft."""
    return float(averaged_ratio(np.array(1.0)))


def swings(ratio: Any, drop: float, periods: int) -> tuple[Any, Any, Any]:
    """Amplitude of the velocity [rad/s] over the last two of `periods`, time stuck in them, success."""
    machine = pendulum(ratio, drop)
    # From the averaged amplitude, so that little is left to settle; one second is about a period.
    first = jnp.sqrt(4.0 * jnp.maximum(1.0 - ratio, 1e-4))
    y0 = machine.state(phi=machine.held(), v_phi=jnp.minimum(first, 0.98))
    times = periods - 2.0 + jnp.linspace(0.0, 2.0, 801)
    run = ss.simulate(
        machine, 0.0, float(periods), y0, integrator=FAST, throw=False,
        saveat=ss.SaveAt(ts=times, max_events=None),
    )  # fmt: skip
    v = run.outputs.y.v_phi
    stuck = jnp.mean(jnp.asarray(run.outputs.mode == 1, jnp.float64))
    return 0.5 * (jnp.max(v) - jnp.min(v)), stuck, run.successful


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Growth of small swings over the damping, the swings that they end in, and two motions."""
    q = parameters
    ratio = np.linspace(0.3, 1.3, q["points"])
    tau = 1.0

    def disturbed(r):
        machine = pendulum(r, q["drop"])
        return flow_matrix(machine, machine.state(phi=machine.held()), tau)

    matrices = ss.map_lanes(disturbed, executor="portable")(jnp.asarray(ratio))
    machines = jax.vmap(lambda r: pendulum(r, q["drop"]).damping)(jnp.asarray(ratio))
    slope = -STEEPEST * q["drop"] / np.sqrt(2.0)
    near = 1.0 - 0.2 * 0.5 ** np.arange(4)
    lanes = np.concatenate([ratio, near])
    size, stuck, fine = (
        np.asarray(x)
        for x in ss.map_lanes(lambda r: swings(r, q["drop"], q["periods"]))(jnp.asarray(lanes))
    )
    shown = np.linspace(0.0, 12.0, 1201)
    motions = []
    for r in (0.9, 0.4):
        machine = pendulum(r, q["drop"])
        y0 = machine.state(phi=float(machine.held()), v_phi=0.9)
        run = ss.simulate(
            machine, 0.0, 212.0, y0, saveat=ss.SaveAt(ts=jnp.asarray(200.0 + shown), max_events=None),
        )  # fmt: skip
        log: Any = run.outputs
        motions.append(np.stack([log.y.phi, log.y.v_phi, log.mode == 1]))
    count = len(ratio)
    return xr.Dataset(
        {
            "growth": ("ratio", rates_of(matrices, tau)[:, 0], {"units": "1/s"}),
            "known": ("ratio", -(np.asarray(machines) + slope) / 2.0, {"units": "1/s"}),
            "size": ("ratio", size[:count], {"units": "rad/s"}),
            "stuck": ("ratio", stuck[:count], {"units": "1"}),
            "near_size": ("near", size[count:], {"units": "rad/s"}),
            "motion": (("shown", "quantity", "time"), np.array(motions)),
        },
        {
            "ratio": ratio, "near": near, "shown": [0.9, 0.4],
            "quantity": ["angle", "rate", "stick"], "time": ("time", shown, {"units": "s"}),
        },
        attrs={"failed": int((~fine).sum())},
    )  # fmt: skip


def draw(dataset: xr.Dataset) -> Figure:
    """Growth rate, amplitudes, and two motions with the phases in which the bearing sticks."""
    figure, axes = plt.subplots(2, 2, figsize=(10.5, 6.4))
    (grows, ends), (small, large) = axes
    grows.plot(dataset.ratio, dataset.known, color="0.6", lw=3.0, label="closed form")
    grows.plot(dataset.ratio, dataset.growth, ".", color="#1f4e9c", label="derivative of the motion")
    grows.set(xlabel="damper over falling friction, $r$", ylabel="growth rate [1/s]")
    sizes = np.linspace(0.02, 1.0, 200)
    ends.plot(averaged_ratio(sizes), sizes, color="0.6", lw=3.0, label="averaged")
    ends.plot(dataset.ratio, dataset["size"], ".", color="#1f4e9c", label="simulated")
    ends.axvline(border(), color="0.6", ls=":", lw=0.8)
    ends.set(xlabel="damper over falling friction, $r$", ylabel=r"amplitude of $\dot\varphi$ [rad/s]")
    for axis, r in zip((small, large), dataset.shown.values, strict=True):
        angle, rate, stick = np.asarray(dataset.motion.sel(shown=r))
        time = np.asarray(dataset.time)
        plot.shade(time, stick > 0.5, label="stick", ax=axis)
        axis.plot(time, rate, color="#1f4e9c", label=r"$\dot\varphi$ [rad/s]")
        axis.plot(time, angle, color="#b7791f", label=r"$\varphi$ [rad]")
        axis.axhline(1.0, color="0.4", lw=0.6, ls="--")
        axis.set(xlabel="$t$ [s], after 200 s", title=f"$r$ = {r:g}")
    for axis in (grows, ends, large):
        axis.legend(frameon=False, fontsize=7)
    return figure


@statement("M3.1", "Small swings grow at the rate -(c + T')/2J.")
def grows_as_known(dataset: xr.Dataset) -> Verdict:
    """Largest difference of the growth rates."""
    size = float(np.abs(dataset.known).max())
    return verdict(
        float(np.abs(dataset.growth - dataset.known).max()) / size, Machines.SWINGS,
        f"{dataset.sizes['ratio']} dampings, the largest rate {size:.4g} 1/s; relative",
    )  # fmt: skip


@statement("M3.2", "Near the border their velocity is u_s sqrt(2 (1 - r)).")
def swings_as_far_as_known(dataset: xr.Dataset) -> Verdict:
    """Difference of the velocity at the border from the closed form.

    The closed form is the first term of a series in 1 - r; what follows it halves with 1 - r.
    """
    near = np.asarray(dataset.near)
    ratio = np.asarray(dataset.near_size) / np.sqrt(4.0 * (1.0 - near))
    limit = 2.0 * ratio[-1] - ratio[-2]
    return verdict(
        abs(limit - 1.0), Machines.AMPLITUDE,
        f"over it {', '.join(f'{x:.4f}' for x in ratio)} at r = "
        f"{', '.join(f'{x:g}' for x in near)}, in the limit {limit:.5f}",
    )  # fmt: skip


@statement("M3.3", "The bearing sticks from where averaged swings reach the shaft's speed.")
def sticks_from(dataset: xr.Dataset) -> Verdict:
    """Difference of the dampings at which sticking begins."""
    over, stuck = np.asarray(dataset.ratio), np.asarray(dataset.stuck)
    between = (over[stuck > 0.0].max(), over[stuck == 0.0].min())
    known, step = border(), float(dataset.ratio[1] - dataset.ratio[0])
    return verdict(
        abs(sum(between) / 2.0 - known), Machines.HALF_STEP * step + Machines.AVERAGING,
        f"it begins between r = {between[0]:.3f} and {between[1]:.3f}, averaged {known:.4f}",
    )  # fmt: skip


judge = judge_all("M3.")


EXPERIMENT = Experiment(
    name="mechanism-froude",
    title="Froude's pendulum: growth, amplitude and sticking over the damping",
    parameters={"points": 41, "drop": 0.4, "periods": 2000},
    quick={"points": 11, "periods": 600},
    compute=compute,
    draw=draw,
    judge=judge,
)
