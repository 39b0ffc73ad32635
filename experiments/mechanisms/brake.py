r"""A brake pad on a turning disc: two modes that friction couples, and that squeal where they meet.

A pad of mass $m$ hangs in springs that join its motion along the disc, $x$, and towards it, $y$. The
disc is a spring $k_3$ to it, so the normal force $N = N_0 + k_3 y$ depends on the motion, and friction
$\mu N$ makes the stiffness matrix unsymmetric:

$$m\ddot x + k_{xx}x + (k_{xy} - \mu k_3)\,y = \mu N_0, \qquad
  m\ddot y + k_{xy}x + k_{yy}y = 0$$

with $k_{yy}$ holding $k_3$. Friction does not fall with the speed here, and nothing is damped. The
frequencies meet at

$$\mu_c = \frac{k_{xy}}{k_3} + \frac{(k_{xx} - k_{yy})^2}{4\,k_{xy}k_3}$$

and beyond it one mode grows at the rate $\sigma = \operatorname{Im}\sqrt{s + i d}$,
$s = (k_{xx} + k_{yy})/2m$, $d^2 = k_{xy}k_3(\mu - \mu_c)/m^2$. What grows ends in a cycle in which the
pad sticks, slips and lifts off: there no closed form is known; energy is accounted for instead.

N. Hoffmann, M. Fischer, R. Allgaier, L. Gaul, *A minimal model for studying properties of the
mode-coupling type instability in friction induced oscillations*, Mechanics Research Communications 29,
2002. The numbers here are constructed.
"""

from typing import Any, ClassVar

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.analysis import energy_ledger
from stickslip.friction import AbstractFrictionLaw, Coulomb
from stickslip.mechanism import AbstractMechanism, Contact

from .._experiment import Context, Experiment
from .._statement import Verdict, judge_all, statement
from .._thresholds import Machines
from ._shared import FAST, flow_matrix, rates_of, verdict

MASS, PAD = 1.0, 1.0  # [kg], stiffness of the disc [N/m]
ALONG, ACROSS, TOWARDS = 1.6, 0.4, 1.2  # k_xx, k_xy and k_yy [N/m]
PRESSED, DISC = 1.0, 0.8  # normal force [N], speed of the disc [m/s]


class Brake(AbstractMechanism):
    """A pad on a disc: it opens where its normal force vanishes."""

    along: Any
    across: Any
    towards: Any  # without the disc
    disc: Any  # stiffness [N/m]
    pressed: Any
    law: AbstractFrictionLaw
    speed: Any
    damping: Any = 0.0
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"pad": {"x": 1}}
    opening: ClassVar = ("pad",)

    def mass_matrix(self, q):
        return {"x": MASS, "y": MASS}

    def forces(self, t, q, v, args):
        return {
            "x": -self.along * q.x - self.across * q.y - self.damping * v.x,
            "y": self.pressed - self.across * q.x - self.towards * q.y - self.damping * v.y,
        }

    def contacts(self, t, q, v, args):
        load = self.pressed + self.disc * q.y
        return {"pad": Contact(self.law, load, self.speed, normal_direction={"y": -1})}

    def potential_energy(self, q):
        springs = 0.5 * (self.along * q.x**2 + self.towards * q.y**2) + self.across * q.x * q.y
        return springs - self.pressed * q.y

    def steady(self) -> Any:
        """The state in which the pad slips and nothing moves."""
        mu, k_yy = self.law.kinetic(self.speed, 1.0), self.towards + self.disc
        both = self.along * k_yy - self.across * (self.across - mu * self.disc)
        pull = mu * self.pressed
        return self.state(x=pull * k_yy / both, y=-self.across * pull / both)


def brake(mu: Any, static: Any = 0.0, damping: Any = 0.0) -> Brake:
    """The constructed brake; `static` is added to the coefficient at rest."""
    law = Coulomb(mu + static, mu)
    return Brake(ALONG, ACROSS, TOWARDS - PAD, PAD, PRESSED, law, DISC, damping)


def critical() -> float:
    """Coefficient of friction at which the frequencies meet."""
    return (ACROSS + (ALONG - TOWARDS) ** 2 / (4.0 * ACROSS)) / PAD


def growth_of(mu: Any) -> Any:
    """Growth rate [1/s] in closed form."""
    middle = 0.5 * (ALONG + TOWARDS) / MASS
    apart = ACROSS * PAD * (np.asarray(mu) - critical()) / MASS**2
    return np.imag(np.sqrt(middle + 1j * np.sqrt(np.maximum(apart, 0.0))))


def ends(mu: Any, seconds: float) -> tuple[Any, Any, Any]:
    """Greatest |x - steady x| over the last 60 s, time in each of the four states, success."""
    machine = brake(mu, damping=0.02)
    y0 = machine.steady()
    run = ss.simulate(
        machine, 0.0, seconds, y0._replace(x=y0.x + 0.05), integrator=FAST,
        saveat=ss.SaveAt(ts=seconds - 60.0 + jnp.linspace(0.0, 60.0, 2401), max_events=None),
        throw=False,
    )  # fmt: skip
    share = [jnp.mean(jnp.asarray(run.outputs.mode == m, jnp.float64)) for m in range(4)]
    return jnp.max(jnp.abs(run.outputs.y.x - y0.x)), jnp.stack(share), run.successful


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Growth rates over the coefficient, what they end in, and a motion with its energy account."""
    q, tau = parameters, 2.0
    # From both sides of the critical value; at it the modes are one and numbers lose half their digits.
    mu = critical() * np.linspace(0.5, 1.5, q["points"])
    matrices = ss.map_lanes(
        lambda m: flow_matrix(brake(m), brake(m).steady(), tau), executor="portable"
    )(jnp.asarray(mu))
    size, share, fine = (
        np.asarray(x) for x in ss.map_lanes(lambda m: ends(m, q["duration"]))(jnp.asarray(mu))
    )
    machine = brake(1.2 * critical(), damping=0.02)
    shown = np.linspace(0.0, 150.0, 3001)
    y0 = machine.steady()
    y0 = y0._replace(x=y0.x + 0.05)
    run = ss.simulate(
        machine,
        0.0,
        150.0,
        y0,
        saveat=ss.SaveAt(ts=jnp.asarray(shown), max_events=None),
    )
    log: Any = run.outputs
    ledger = energy_ledger(machine, y0, shown[:: len(shown) // 50])
    return xr.Dataset(
        {
            "growth": ("mu", rates_of(matrices, tau)[:, 0], {"units": "1/s"}),
            "known": ("mu", growth_of(mu), {"units": "1/s"}),
            "size": ("mu", size, {"units": "m"}),
            "share": (("mu", "state"), share, {"units": "1"}),
            "motion": (("quantity", "time"), np.stack([log.y.x, log.y.v_x, log.y.y, log.mode])),
        },
        {
            "mu": ("mu", mu, {"units": "1"}),
            "state": ["backward", "stick", "forward", "open"],
            "quantity": ["x", "v_x", "y", "mode"], "time": ("time", shown, {"units": "s"}),
        },
        attrs={
            "failed": int((~fine).sum()),
            "imbalance": float(np.abs(ledger.imbalance).max()),
            "work": float(ledger["work_drive of pad"][-1]),
        },
    )  # fmt: skip


def draw(dataset: xr.Dataset) -> Figure:
    """Growth over friction, what it ends in, and a motion from the steady state to its cycle."""
    figure, axes = plt.subplot_mosaic([["growth", "size"], ["motion", "motion"]], figsize=(10.5, 6.4))
    axes["growth"].plot(dataset.mu, dataset.known, color="0.6", lw=3.0, label="closed form")
    axes["growth"].plot(
        dataset.mu, dataset.growth, ".", color="#1f4e9c", label="derivative of the motion"
    )
    axes["growth"].set(xlabel=r"coefficient $\mu$", ylabel="growth rate [1/s], not damped")
    axes["size"].plot(dataset.mu, dataset["size"], ".", color="#1f4e9c", label="greatest $|x - x_0|$")
    for state, colour in (("stick", "#b7791f"), ("open", "#c0392b")):
        axes["size"].plot(
            dataset.mu, dataset.share.sel(state=state), color=colour, label=f"share of time: {state}"
        )
    axes["size"].set(xlabel=r"coefficient $\mu$", ylabel="lightly damped, settled: [m], [1]")
    for name in ("growth", "size"):
        axes[name].axvline(critical(), color="0.5", lw=0.8, ls=":")
    x, _, y, mode = np.asarray(dataset.motion)
    time = np.asarray(dataset.time)
    plot.shade(time, mode == 1, label="stick", ax=axes["motion"])
    plot.shade(time, mode == 3, label="open", color="#f5d0cc", ax=axes["motion"])
    axes["motion"].plot(time, x, color="#1f4e9c", lw=0.8, label="$x$ [m]")
    axes["motion"].plot(time, y, color="#3d7a4b", lw=0.8, label="$y$ [m]")
    axes["motion"].set(xlabel="$t$ [s]", title=rf"$\mu$ = {1.2 * critical():.3g}")
    for axis in axes.values():
        axis.legend(frameon=False, fontsize=7, loc="upper left")
    return figure


def _grows_between(dataset: xr.Dataset) -> tuple[float, float]:
    """The greatest coefficient at which nothing grows, and the least at which a mode grows."""
    mu, growth = np.asarray(dataset.mu), np.asarray(dataset.growth)
    return mu[growth <= Machines.GROWS].max(), mu[growth > Machines.GROWS].min()


def _begin_of_growth(dataset: xr.Dataset) -> float:
    """Coefficient at which growth begins, by the rates above it.

    With (ω + iσ)² = s + i d it is d² = 4 σ² (s + σ²), a straight line over the coefficient.
    """
    mu, growth = np.asarray(dataset.mu), np.asarray(dataset.growth)
    above = mu > _grows_between(dataset)[1]
    s = 0.5 * (ALONG + TOWARDS) / MASS
    squares = 4.0 * growth**2 * (s + growth**2)
    return float(np.polyfit(squares[above], mu[above], 1)[1])


@statement("M4.1", "One mode grows at the rate of the closed form, and none below.")
def grows_as_known(dataset: xr.Dataset) -> Verdict:
    """Largest difference of the growth rates, but close to the border."""
    mu, growth = np.asarray(dataset.mu), np.asarray(dataset.growth)
    apart = np.abs(mu / critical() - 1.0) > Machines.FLUTTER_APART
    off = np.abs(growth - dataset.known.values)[apart].max() / growth.max()
    return verdict(
        float(off), Machines.FLUTTER,
        f"{len(mu)} coefficients, the largest rate {growth.max():.4g} 1/s; relative",
    )  # fmt: skip


@statement("M4.2", "Growth begins at the closed form's coefficient.")
def growth_begins_as_known(dataset: xr.Dataset) -> Verdict:
    """Difference of the coefficients."""
    (below, above), line = _grows_between(dataset), _begin_of_growth(dataset)
    return verdict(
        abs(line - critical()), Machines.BORDER,
        f"between {below:.4f} and {above:.4f}, by the line through the squares {line:.8f}, "
        f"closed form {critical():.8f}",
    )  # fmt: skip


@statement("M4.3", "Energy is accounted for through stick, slip and lift-off.")
def energy_is_accounted_for(dataset: xr.Dataset) -> Verdict:
    """Imbalance of the energy against the work of the disc."""
    attrs = dataset.attrs
    return verdict(
        attrs["imbalance"] / attrs["work"], Machines.ENERGY,
        f"{attrs['imbalance']:.1e} J of {attrs['work']:.3g} J that the disc gave; relative",
    )  # fmt: skip


judge = judge_all("M4.")


EXPERIMENT = Experiment(
    name="mechanism-brake",
    title="Brake pad on a disc: two modes that friction couples",
    parameters={"points": 61, "duration": 2000.0},
    quick={"points": 11, "duration": 600.0},
    compute=compute,
    draw=draw,
    judge=judge,
)
