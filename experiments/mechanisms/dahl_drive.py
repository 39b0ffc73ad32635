r"""A belt drive whose carriage rubs on its rail by Dahl's law: a spring before it slides.

$$m_p\ddot p = K\,(A\sin\omega t - p) - D\dot p - k\,(p - x) - c\,(\dot p - \dot x), \qquad
  m\ddot x = k\,(p - x) + c\,(\dot p - \dot x) - \lambda$$

A servo moves the pulley to and fro (its angle times its radius is $p$), the belt takes the carriage
along. Dahl's friction $\lambda$ of the stiffness $\sigma$ and the greatest force $F$ knows no time,
only distance: between turning points $\dot\lambda = \sigma\,(1 \mp \lambda/F)\,\dot x$. Known are

- the loop between turning points $\pm a$: from $\mp\lambda_m$ to $\pm\lambda_m$ along an exponential,
  with $\lambda_m = F\tanh(\sigma a/F)$, of the area $4F(a - \lambda_m/\sigma)$, however fast;
- before it slides: small swings about rest see the spring $\sigma$, so they have the frequencies of the
  linear system with it;
- for $\sigma \to \infty$ the area $4Fa$ of Coulomb's law, which the event-driven form has exactly.

P. R. Dahl, *Solid friction damping of mechanical vibrations*, AIAA Journal 14, 1976.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import AbstractFrictionLaw, Coulomb, Dahl
from stickslip.mechanism import AbstractMechanism, Contact

from .._experiment import Context, Experiment
from .._statement import Verdict, judge_all, statement
from .._thresholds import Machines
from ._shared import verdict

PULLEY, CARRIAGE = 0.5, 2.0  # [kg]
SERVO, SERVO_DAMPING, BELT, BELT_DAMPING = 4000.0, 80.0, 2000.0, 20.0  # [N/m], [N s/m]
FRICTION, STIFFNESS = 2.0, 2000.0  # [N], [N/m]
BELOW = ss.Integrator("dop853", ss.AdaptiveStep(1e-10, 1e-12), max_steps=1_000_000)


class BeltDrive(AbstractMechanism):
    """Pulley, belt and carriage; the carriage rubs on its rail."""

    amplitude: Any  # that the servo aims at [m]
    omega: Any  # [rad/s]
    law: AbstractFrictionLaw
    load: Any  # normal force on the rail [N]
    coordinates: ClassVar = {"pulley": "m", "carriage": "m"}
    contact_directions: ClassVar = {"rail": {"carriage": 1}}

    def mass_matrix(self, q):
        return {"pulley": PULLEY, "carriage": CARRIAGE}

    def forces(self, t, q, v, args):
        aim = self.amplitude * jnp.sin(self.omega * t)
        servo = SERVO * (aim - q.pulley) - SERVO_DAMPING * v.pulley
        belt = BELT * (q.pulley - q.carriage) + BELT_DAMPING * (v.pulley - v.carriage)
        return {"pulley": servo - belt, "carriage": belt}

    def contacts(self, t, q, v, args):
        return {"rail": Contact(self.law, self.load)}

    def time_scale(self, args):
        return 1.0 / self.omega


def drive(amplitude: Any, omega: Any) -> BeltDrive:
    """The constructed drive, pressed on its rail by 10 N."""
    return BeltDrive(amplitude, omega, Coulomb(FRICTION / 10.0, FRICTION / 10.0), 10.0)


def area(a: Any, stiffness: Any = STIFFNESS) -> Any:
    """Work that Dahl's friction takes in a loop between `-a` and `a` [J]."""
    return 4.0 * FRICTION * (a - FRICTION * np.tanh(stiffness * a / FRICTION) / stiffness)


def _loss(system, t, y, mode, args):
    return {"loss": system.powers(t, y, mode, args)["friction of rail"]}


def _cycle(form: Any, start: Any, omega: Any, periods: int) -> tuple[Any, Any, Any]:
    """Work lost in the last of `periods`, its turning points by their half distance, success."""
    period = 2.0 * jnp.pi / omega
    ledger = WithIntegrals(form, _loss, units={"loss": "J"})
    begin = (periods - 1) * period
    # A turn of the carriage is where its speed passes through zero; enough points find it to 1e-7.
    times = begin + period * jnp.linspace(0.0, 1.0, 4001)
    run = ss.simulate(
        ledger, 0.0, periods * period, ledger.start(start), integrator=BELOW,
        saveat=ss.SaveAt(ts=times, max_events=None), throw=False,
    )  # fmt: skip
    y = run.outputs.y.y
    x = (y.y if hasattr(y, "y") else y).carriage
    lost = run.outputs.y.integrals["loss"]
    return lost[0] - lost[-1], 0.5 * (jnp.max(x) - jnp.min(x)), run.successful


def bristled(amplitude: Any, omega: Any, periods: int) -> tuple[Any, Any, Any]:
    """`_cycle` with Dahl's bristles; the law's stiffness is per normal force."""
    form = drive(amplitude, omega).bristles(Dahl, sigma_0=STIFFNESS / 10.0)
    return _cycle(form, form.start(form.mechanism.state()), omega, periods)


def rigid(amplitude: Any, omega: Any, periods: int) -> tuple[Any, Any, Any]:
    """`_cycle` of the event-driven form."""
    machine = drive(amplitude, omega)
    return _cycle(machine, machine.state(), omega, periods)


def small_frequencies() -> np.ndarray:
    """Angular frequencies [rad/s] of small swings about rest, by the simulation's own field."""
    form = drive(0.0, 1.0).bristles(Dahl, sigma_0=STIFFNESS / 10.0)
    y0 = form.start(form.mechanism.state())
    leaves, tree = jax.tree.flatten(y0)

    def end(start, seconds=0.01):
        """A step of the motion so small that bristles bend and do not slide."""
        run = ss.simulate(
            form, 0.0, seconds, jax.tree.unflatten(tree, list(start)),
            saveat=ss.SaveAt(max_events=None), integrator=ss.Integrator("dop853", ss.FixedStep(1e-3)),
            throw=False,
        )  # fmt: skip
        return jnp.stack(jax.tree.leaves(run.y1))

    tiny = 1e-9 * np.eye(len(leaves))
    matrix = np.array(jax.jit(jax.vmap(end))(jnp.asarray(tiny))).T / 1e-9
    # The deflection of the bristles follows the carriage: one factor is 1.
    rates = np.log(np.linalg.eigvals(matrix).astype(complex)) / 0.01
    return np.sort(np.abs(rates))


def known_frequencies() -> np.ndarray:
    """The same from masses, springs and dampers, the bristles as a spring."""
    stiffness = np.array([[SERVO + BELT, -BELT], [-BELT, BELT + STIFFNESS]])
    damping = np.array([[SERVO_DAMPING + BELT_DAMPING, -BELT_DAMPING], [-BELT_DAMPING, BELT_DAMPING]])
    mass = np.diag([1.0 / PULLEY, 1.0 / CARRIAGE])
    whole = np.block([[np.zeros((2, 2)), np.eye(2)], [-mass @ stiffness, -mass @ damping]])
    return np.sort(np.append(np.abs(np.linalg.eigvals(whole)), 0.0))


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Loops over the amplitude at three frequencies, with bristles and without, and one drawn."""
    q = parameters
    # The shorter a loop, the longer it remembers the start: by exp(-4σa/F) less each period.
    amplitude = np.geomspace(3e-4, 2e-2, q["points"])
    omega = np.array([0.5, 2.0, 8.0])
    both = [x.ravel() for x in np.meshgrid(omega, amplitude, indexing="ij")]
    lanes = [jnp.asarray(both[1]), jnp.asarray(both[0])]
    found = []
    for way in (bristled, rigid):
        # Fused, XLA fails to compile a program with so many times that differ from lane to lane.
        out = ss.map_lanes(lambda a, w, way=way: way(a, w, q["periods"]), executor="portable")(*lanes)
        found.append([np.asarray(x).reshape(len(omega), -1) for x in out])
    (lost, turn, fine), (lost_rigid, turn_rigid, fine_rigid) = found
    shown = np.linspace(0.0, 2.0 * 2.0 * np.pi / omega[1], 2001)
    loops = []
    for a in (1.5e-3, 4e-3, 1e-2):
        form = drive(a, omega[1]).bristles(Dahl, sigma_0=STIFFNESS / 10.0)
        run = ss.simulate(
            form, 0.0, shown[-1], form.start(form.mechanism.state()),
            saveat=ss.SaveAt(ts=jnp.asarray(shown), max_events=None),
        )  # fmt: skip
        log: Any = run.outputs
        loops.append(np.stack([log.y.y.carriage, STIFFNESS * log.y.z[0][0]]))
    return xr.Dataset(
        {
            "lost": (("omega", "amplitude"), lost, {"units": "J"}),
            "turn": (("omega", "amplitude"), turn, {"units": "m"}),
            "lost_rigid": (("omega", "amplitude"), lost_rigid, {"units": "J"}),
            "turn_rigid": (("omega", "amplitude"), turn_rigid, {"units": "m"}),
            "small": ("swing", small_frequencies(), {"units": "rad/s"}),
            "loops": (("loop", "quantity", "time"), np.array(loops)),
        },
        {
            "amplitude": ("amplitude", amplitude, {"units": "m"}),
            "omega": ("omega", omega, {"units": "rad/s"}),
            "loop": [1.5e-3, 4e-3, 1e-2], "quantity": ["place", "friction"],
            "time": ("time", shown, {"units": "s"}),
        },
        attrs={"failed": int((~fine).sum() + (~fine_rigid).sum())},
    )  # fmt: skip


def draw(dataset: xr.Dataset) -> Figure:
    """Loops of friction over place, and their areas over the distance of the turning points."""
    figure, (loops, areas) = plt.subplots(1, 2, figsize=(10.5, 4.2))
    for amplitude in dataset.loop.values[::-1]:
        place, friction = np.asarray(dataset.loops.sel(loop=amplitude))
        loops.plot(1e3 * place, friction, label=f"servo to ± {1e3 * amplitude:g} mm", lw=1.0)
    loops.set(xlabel="carriage [mm]", ylabel="friction [N]", title="two periods from rest")
    a = np.geomspace(float(dataset.turn.min()), float(dataset.turn.max()), 300)
    areas.loglog(1e3 * a, area(a), color="0.6", lw=3.0, label="closed form, Dahl")
    areas.loglog(
        1e3 * a, 4.0 * FRICTION * a, color="0.6", lw=1.0, ls="--", label="closed form, Coulomb"
    )
    for omega in dataset.omega.values:
        part = dataset.sel(omega=omega)
        areas.loglog(1e3 * part.turn, part.lost, ".", ms=4, label=f"bristles, {omega:g} rad/s")
    moves = dataset.turn_rigid > 1e-9
    areas.loglog(
        1e3 * dataset.turn_rigid.values[moves], dataset.lost_rigid.values[moves], "x", ms=4,
        color="#c0392b", label="event-driven",
    )  # fmt: skip
    areas.set(
        xlabel="half distance of the turning points [mm]", ylabel="work lost in a loop [J]",
        ylim=(0.3 * float(dataset.lost.min()), None),
    )  # fmt: skip
    for axis in (loops, areas):
        axis.legend(frameon=False, fontsize=7)
    return figure


@statement("M5.1", "A loop takes 4F (a - λ/σ), however fast it is run through.")
def loop_takes(dataset: xr.Dataset) -> Verdict:
    """Largest difference of the area of a loop."""
    known = area(np.asarray(dataset.turn))
    return verdict(
        float(np.abs(dataset.lost.values / known - 1.0).max()), Machines.LOOPS,
        f"{known.size} loops, a from {1e3 * float(dataset.turn.min()):.3g} to "
        f"{1e3 * float(dataset.turn.max()):.3g} mm, rad/s {dataset.omega.values.tolist()}",
    )  # fmt: skip


@statement("M5.2", "Small swings about rest see the bristles as a spring.")
def bristles_are_a_spring(dataset: xr.Dataset) -> Verdict:
    """Largest difference of the frequencies."""
    small, expected = np.asarray(dataset.small), known_frequencies()
    return verdict(
        float(np.abs(small - expected).max() / expected.max()), Machines.SMALL,
        f"{', '.join(f'{x:.4f}' for x in small)} rad/s, closed form "
        f"{', '.join(f'{x:.4f}' for x in expected)}; relative to the largest",
    )  # fmt: skip


@statement("M5.3", "Without bristles a loop takes 4F a.")
def rigid_loop_takes(dataset: xr.Dataset) -> Verdict:
    """Largest difference of the area, where the carriage moves at all."""
    moves = np.asarray(dataset.turn_rigid) > Machines.MOVES
    coulomb = 4.0 * FRICTION * np.asarray(dataset.turn_rigid)
    return verdict(
        float(np.abs(dataset.lost_rigid.values[moves] / coulomb[moves] - 1.0).max()), Machines.RIGID,
        f"{int(moves.sum())} loops, event-driven; in {int((~moves).sum())} the carriage stays; "
        "relative",
    )  # fmt: skip


judge = judge_all("M5.")


EXPERIMENT = Experiment(
    name="mechanism-dahl-drive",
    title="Belt drive with Dahl's friction: hysteresis of the carriage",
    parameters={"points": 40, "periods": 32},
    quick={"points": 4},
    compute=compute,
    draw=draw,
    judge=judge,
)
