r"""A chain of blocks on a belt: the model of an earthquake fault of Burridge and Knopoff.

$$m\ddot x_i = k_c\,(x_{i+1} - 2x_i + x_{i-1}) - k_p x_i + \lambda_i, \qquad u_i = \dot x_i - V$$

with free ends. Known are

- where all slip, as on a fast belt: $N$ linear oscillators of the squared frequencies
  $(k_p + 2k_c(1 - \cos(j\pi/N)))/m$, $j = 0 \dots N - 1$, about the place where friction holds them;
- where all are equal and begin alike: each moves as a single block. Under Coulomb friction it sticks
  for $2d/V$ and slips for $(\pi + 2\arctan(V/\omega d))/\omega$, $d = (F_s - F_k)/k_p$;
- otherwise: the motion of time stepping in the limit of short steps. Its error falls with the step.

R. Burridge, L. Knopoff, *Model and theoretical seismicity*, Bulletin of the Seismological Society of
America 57, 1967; J. M. Carlson, J. S. Langer, *Mechanical model of an earthquake fault*, Physical
Review A 40, 1989.
"""

import itertools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.friction import AbstractFrictionLaw, Coulomb, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact

from .._experiment import Context, Experiment
from .._statement import Verdict, judge_all, statement
from .._thresholds import Machines
from ._shared import verdict

MASS, PULL, COUPLING = 1.0, 1.0, 4.0  # [kg], [N/m], [N/m]
STATIC, KINETIC, FALL = 1.0, 0.5, 0.5  # [N], [N], [m/s]
STARTS = 16  # motions that are compared with time stepping
SLOW = 0.05  # speed of the belt in the picture [m/s]
CLOSE = ss.Integrator("dop853", ss.AdaptiveStep(1e-11, 1e-12), max_steps=1_000_000)


class Chain(AbstractMechanism):
    """Blocks in a row on a belt, each held back by a spring and joined to its neighbours."""

    mass: Any
    pull: Any
    coupling: Any
    law: AbstractFrictionLaw
    belt_speed: Any
    blocks: int = eqx.field(static=True)

    @property
    def coordinates(self):
        return {f"x_{i + 1}": "m" for i in range(self.blocks)}

    @property
    def contact_directions(self):
        return {f"block {i + 1}": {f"x_{i + 1}": 1} for i in range(self.blocks)}

    def mass_matrix(self, q):
        return (self.mass,) * self.blocks

    def forces(self, t, q, v, args):
        between = [self.coupling * (b - a) for a, b in itertools.pairwise(q)]
        return tuple(
            right - left - self.pull * x
            for x, left, right in zip(q, (0.0, *between), (*between, 0.0), strict=True)
        )

    def contacts(self, t, q, v, args):
        return [Contact(self.law, surface_speed=self.belt_speed) for _ in range(self.blocks)]

    def potential_energy(self, q):
        pulled = sum(0.5 * self.pull * x**2 for x in q)
        return pulled + sum(0.5 * self.coupling * (b - a) ** 2 for a, b in itertools.pairwise(q))

    def at(self, places: Any, rate: Any) -> Any:
        """The state with the blocks at `places`, all of them moving at `rate`."""
        names = [f"x_{i + 1}" for i in range(self.blocks)]
        rates = {f"v_{name}": rate for name in names}
        return self.state(**dict(zip(names, places, strict=True)), **rates)


def chain(blocks: int, law: AbstractFrictionLaw, belt_speed: Any) -> Chain:
    """The constructed chain."""
    return Chain(MASS, PULL, COUPLING, law, belt_speed, blocks)


def weakening() -> Stribeck:
    """Friction that falls with the speed from its value at rest on."""
    return Stribeck(STATIC, KINETIC, FALL, 1)


def uneven(*shape: int) -> np.ndarray:
    """Places without any order, the same ones each time [m]."""
    return 0.4 * np.random.default_rng(1).uniform(-1.0, 1.0, shape)


def slipping(blocks: int, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Places after `seconds` on a fast belt, simulated and by the modes of the chain [m]."""
    machine = chain(blocks, Coulomb(STATIC, KINETIC), 50.0)
    first = uneven(blocks)
    run = ss.simulate(
        machine,
        0.0,
        seconds,
        machine.at(first, 0.0),
        integrator=CLOSE,
        saveat=ss.SaveAt(max_events=None),
    )
    places = np.array([float(x) for x in run.y1[:blocks]])
    j, i = np.meshgrid(np.arange(blocks), np.arange(blocks))
    modes = np.cos(j * np.pi * (i + 0.5) / blocks)
    modes /= np.linalg.norm(modes, axis=0)
    omega = np.sqrt((PULL + 2.0 * COUPLING * (1.0 - np.cos(np.arange(blocks) * np.pi / blocks))) / MASS)
    held = KINETIC / PULL
    known = held + modes @ (np.cos(omega * seconds) * (modes.T @ (first - held)))
    return places, known


def alike(blocks: int, belt_speed: float = 0.2) -> tuple[float, float, np.ndarray]:
    """Period of equal blocks that begin alike, simulated and known [s]; their release times."""
    machine = chain(blocks, Coulomb(STATIC, KINETIC), belt_speed)
    run = ss.simulate(
        machine,
        0.0,
        40.0,
        machine.at([0.0] * blocks, belt_speed),
        integrator=CLOSE,
        saveat=ss.SaveAt(max_events=40 * blocks),
    )
    events: Any = run.events
    rest = sum(1 << 2 * c for c in range(blocks))
    # All have given way where no contact rests any more.
    count = int(run.num_events)
    before, after = (np.asarray(m)[:count] for m in (events.mode_before, events.mode_after))
    free = np.array([not any((m >> 2 * c) & 3 == 1 for c in range(blocks)) for m in after])
    bound = np.array([any((m >> 2 * c) & 3 == 1 for c in range(blocks)) for m in before])
    first = before == rest
    times = np.asarray(events.t)[:count]
    released = np.stack([times[first], times[free & bound][-first.sum() :]])
    omega, d = np.sqrt(PULL / MASS), (STATIC - KINETIC) / PULL
    known = 2.0 * d / belt_speed + (np.pi + 2.0 * np.arctan(belt_speed / (omega * d))) / omega
    return float(np.diff(released[0]).mean()), float(known), released


def stepped(x: np.ndarray, belt_speed: float, seconds: float, h: float) -> np.ndarray:
    """Places after `seconds` by time stepping (Moreau) that knows neither modes nor events [m].

    From the places `x` [start, block]. Velocities at whole steps, places between them; friction of the
    new sliding speed has the old speed's size.
    """
    v = np.full(x.shape, belt_speed)
    x = x + 0.5 * h * v
    for step in range(round(seconds / h)):
        force = -PULL * x
        between = COUPLING * (x[:, 1:] - x[:, :-1])
        force[:, :-1] += between
        force[:, 1:] -= between
        most = KINETIC + (STATIC - KINETIC) * np.exp(-np.abs(v - belt_speed) / FALL)
        u = v + h * force / MASS - belt_speed
        v = belt_speed + np.sign(u) * np.maximum(np.abs(u) - h * most / MASS, 0.0)
        x = x + (h if step < round(seconds / h) - 1 else 0.5 * h) * v
    return x


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """The three comparisons, and a motion of `blocks` blocks."""
    q = parameters
    sizes = [1, 2, q["compared"]]
    modes = [slipping(n, 20.0) for n in sizes]
    period, known, released = alike(q["compared"])
    machine = chain(q["compared"], weakening(), 0.1)
    starts = uneven(STARTS, q["compared"])

    def motion_from(places):
        run = ss.simulate(
            machine,
            0.0,
            10.0,
            machine.at(places, 0.1),
            integrator=CLOSE,
            saveat=ss.SaveAt(max_events=None),
            throw=False,
        )
        return jnp.stack(run.y1[: q["compared"]]), run.num_events

    places, events = jax.jit(jax.vmap(motion_from))(jnp.asarray(starts))
    steps = q["step"] * 0.5 ** np.arange(6)
    apart = [stepped(starts, 0.1, 10.0, h) - np.asarray(places) for h in steps]
    # One error rises and falls with where steps meet events: the mean over several motions.
    errors = [np.sqrt(np.mean(x**2)) for x in apart]
    shown = np.linspace(0.0, q["shown"], 2001)
    whole = chain(q["blocks"], weakening(), SLOW)
    motion = ss.simulate(
        whole, 0.0, q["shown"], whole.at(uneven(q["blocks"]), SLOW),
        saveat=ss.SaveAt(ts=jnp.asarray(shown), max_events=None),
    )  # fmt: skip
    log: Any = motion.outputs
    rates = np.stack(log.y[q["blocks"] :], axis=1)
    number = np.asarray(log.mode)[:, None] >> 2 * np.arange(q["blocks"])
    return xr.Dataset(
        {
            "mode_error": ("size", [np.abs(a - b).max() for a, b in modes], {"units": "m"}),
            "released": (("which", "period"), released, {"units": "s"}),
            "error": ("step", errors, {"units": "m"}),
            "rate": (("time", "block"), rates, {"units": "m/s"}),
            "sticks": (("time", "block"), (number & 3) == 1),
        },
        {
            "size": sizes, "which": ["first", "last"], "step": ("step", steps, {"units": "s"}),
            "time": ("time", shown, {"units": "s"}), "block": np.arange(1, q["blocks"] + 1),
        },
        attrs={
            "period": period, "known": known, "events": int(events.sum()),
            "compared": q["compared"], "all_events": int(motion.num_events),
        },
    )  # fmt: skip


def draw(dataset: xr.Dataset) -> Figure:
    """Slip of every block over time, the share that sticks, and the error of time stepping."""
    figure, axes = plt.subplot_mosaic(
        [["slip", "slip"], ["share", "error"]], figsize=(10.5, 6.6), height_ratios=(3, 2)
    )
    slip = np.where(dataset.sticks, np.nan, -(np.asarray(dataset.rate) - SLOW)).T
    image = axes["slip"].pcolormesh(
        dataset.time,
        dataset.block,
        slip,
        cmap="viridis_r",
        shading="nearest",
        rasterized=True,
        vmin=0.0,
        vmax=np.nanquantile(slip, 0.995),
    )
    figure.colorbar(image, ax=axes["slip"], label="slip speed [m/s]; white: sticks")
    axes["slip"].set(xlabel="$t$ [s]", ylabel="block")
    axes["share"].plot(dataset.time, dataset.sticks.mean("block"), color="#1f4e9c", lw=0.6)
    axes["share"].set(xlabel="$t$ [s]", ylabel="share of blocks that stick")
    axes["error"].loglog(dataset.step, dataset.error, "o-", color="#c0392b", ms=3)
    axes["error"].set(
        xlabel="step of time stepping [s]", ylabel="its error after 10 s [m]",
        title=f"{dataset.attrs['compared']} blocks, {STARTS} motions",
    )  # fmt: skip
    return figure


@statement("M1.1", "Blocks that all slip are the superposition of the modes of the chain.")
def is_superposition_of_modes(dataset: xr.Dataset) -> Verdict:
    """Largest distance of a block from the sum of the modes."""
    sizes = ", ".join(str(n) for n in dataset["size"].values)
    return verdict(float(dataset.mode_error.max()), Machines.MODES, f"{sizes} blocks after 20 s; in m")


@statement("M1.2", "Equal blocks that begin alike have the period of one block.")
def has_period_of_one_block(dataset: xr.Dataset) -> Verdict:
    """Difference of the periods, and the time within which all blocks give way."""
    attrs = dataset.attrs
    spread = float((dataset.released.sel(which="last") - dataset.released.sel(which="first")).max())
    off = abs(attrs["period"] / attrs["known"] - 1.0)
    return verdict(
        max(off, spread), Machines.PERIOD,
        f"{attrs['compared']} blocks, {attrs['period']:.10f} s, known {attrs['known']:.10f} s; "
        f"all let go within {spread:.1e} s; relative, and in s",
    )  # fmt: skip


@statement("M1.3", "Time stepping tends to the same motion, its error falling with the step.")
def is_limit_of_time_stepping(dataset: xr.Dataset) -> Verdict:
    """Order of the error of time stepping against one."""
    error = np.asarray(dataset.error)
    order = np.polyfit(np.log(dataset.step), np.log(error), 1)[0]
    return verdict(
        abs(float(order) - 1.0), Machines.ORDER,
        f"errors {', '.join(f'{e:.2g}' for e in error)} m, {STARTS} motions, "
        f"{dataset.attrs['events']} events, order {order:.2f}",
    )  # fmt: skip


judge = judge_all("M1.")


EXPERIMENT = Experiment(
    name="mechanism-chain",
    title="Chain of blocks on a belt (Burridge and Knopoff)",
    parameters={"blocks": 15, "compared": 8, "step": 8e-3, "shown": 250.0},
    quick={"blocks": 6, "compared": 3, "shown": 60.0},
    compute=compute,
    draw=draw,
    judge=judge,
)
