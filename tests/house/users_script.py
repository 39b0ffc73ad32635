# pyright: standard
"""What a user writes, as type checkers see it who has set none of their rules. It is never run.

`make lint` and `test_types.py` check it with pyright.
"""

from typing import Any, ClassVar, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optax

import corexy_jax as cx
import stickslip as ss
from stickslip import analysis, friction, identification, plot, sweep
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import BlockOnBelt, CoulombOscillator, JointedBeam, Motion


class State(NamedTuple):
    """State of the oscillator."""

    x: Any  # [m]
    v: Any  # [m/s]


class Oscillator(ss.AbstractHybridSystem):
    """A block on a belt, written by hand."""

    stiffness: float
    belt_speed: float = 0.2
    mode_names: ClassVar = ("stick", "slip")
    guard_names: ClassVar = ("breakaway", "capture")
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return State(y.v, jnp.where(mode == 0, 0.0, 0.5 - self.stiffness * y.x))

    def guards(self, t, y, mode, args):
        stick = mode == 0
        return (
            jnp.where(stick, 1.0 - self.stiffness * y.x, 1.0),
            jnp.where(stick, 1.0, self.belt_speed - y.v),
        )

    def transition(self, t, y, mode, guard, args):
        return State(y.x, self.belt_speed), 1 - mode

    def initial_mode(self, t, y, args):
        return jnp.where(y.v == self.belt_speed, 0, 1)


class Pendulum(ss.AbstractSmoothSystem):
    """Annotated by a user who annotates."""

    length: float
    units: ClassVar[dict[str, str]] = {"x": "rad", "v": "rad/s"}
    periods: ClassVar[dict[str, float]] = {"x": 2.0 * np.pi}

    def vector_field(self, t: Any, y: State, mode: Any, args: Any) -> State:
        return State(y.v, -9.81 / self.length * jnp.sin(y.x))


class Timed(ss.AbstractSystemWrapper):
    """Around another system."""

    system: ss.AbstractHybridSystem
    rate: float = 1.0

    def inner(self, y, args):
        return y[0], args

    def vector_field(self, t, y, mode, args):
        return self.system.vector_field(t, y[0], mode, args), self.rate

    def transition(self, t, y, mode, guard, args):
        after, mode = self.system.transition(t, y[0], mode, guard, args)
        return (after, y[1]), mode


class Block(AbstractMechanism):
    """The same block, declared."""

    mass: float
    stiffness: float
    law: friction.AbstractFrictionLaw
    belt_speed: float = 0.2
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1.0}}
    opening: ClassVar = ("belt",)

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": -self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        return {"belt": Contact(self.law, 9.81 * self.mass, surface_speed=self.belt_speed)}


class Chain(AbstractMechanism):
    """As many blocks as a parameter says."""

    masses: tuple[float, ...]

    @property
    def coordinates(self):
        return {f"x{i}": "m" for i in range(len(self.masses))}

    @property
    def contact_directions(self):
        return {f"c{i}": {f"x{i}": 1.0} for i in range(len(self.masses))}

    def mass_matrix(self, q):
        return list(self.masses)

    def forces(self, t, q, v, args):
        return [-x for x in q]

    def contacts(self, t, q, v, args):
        return [Contact(friction.Coulomb(0.3, 0.2), m) for m in self.masses]


class Halving(ss.AbstractAdaptiveStep):
    """A step-size rule of one's own."""

    rtol: float = 1e-9
    atol: float | None = None
    dtmax: float | None = None
    dtmin: float = 0.0
    remembers: ClassVar = False

    def initial(self, y, dy, scale):
        return jnp.asarray(1e-3)

    def factor(self, error, previous, order):
        return jnp.where(error > 1.0, 0.5, 2.0)


class Log(friction.AbstractFrictionLaw):
    """A friction law of one's own."""

    size: float

    set_valued: ClassVar = True
    num_states: ClassVar = 0


system, y0 = Oscillator(1.0), State(0.0, 0.2)
solution = ss.simulate(system, 0.0, 30.0, y0, integrator=ss.Integrator("rk4", ss.FixedStep(1e-3)))
print(solution.y1.x, solution.events.t[:3], solution.events.mode_after, solution.num_events)
adaptive = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10, dtmax=0.1), max_steps=10_000)
ts = np.linspace(0.0, 1.0, 11)
solution = ss.simulate(system, 0, 1.0, y0, "stick", integrator=adaptive, saveat=ss.SaveAt(ts=ts))
print(solution.outputs.t, solution.outputs.y.x, solution.crossings[0].y.x)
solution = ss.simulate(
    Pendulum(1.0), 0.0, 1.0, State(0.1, 0.0), integrator=ss.Integrator(diffrax.Kvaerno5(), Halving())
)
print(solution.to_dataset(system)["x"], solution.events.to_dataframe(system))
section = ss.Section(lambda system, t, y, dy, mode, args: y.x, name="zero", direction="rising")
ss.simulate(
    Timed(system),
    0.0,
    1.0,
    (y0, 0.0),
    saveat=ss.SaveAt(sections=section, max_events=None),
)
ss.interpolate(system, solution, [0.1, 0.3])

block = Block(1.0, 1.0, friction.Stribeck(1.0, 0.5, 0.1))
run = ss.simulate(block, 0.0, 50.0, block.state(v_x=0.2))
print([block.mode_names[m] for m in run.events.mode_after[:3]], block.names.coordinates)
ss.simulate(block.regularised(1e-3), 0.0, 1.0, block.state())
form = block.bristles(friction.LuGre, sigma_0=1e4)
ss.simulate(form, 0.0, 1.0, form.start(block.state()))
Chain((1.0, 2.0)).state(x0=1.0)

gradient = jax.grad(lambda k: ss.simulate(Oscillator(k), 0.0, 30.0, y0).y1.x)(1.0)
many = ss.map_lanes(lambda k: ss.simulate(Oscillator(k), 0.0, 30.0, y0).y1.x)(jnp.linspace(1, 2, 99))
print(gradient, many.min())

diagram = analysis.orbit_diagram(
    system,
    {"stiffness": np.linspace(1.0, 2.0, 11)},
    y0,
    analysis.Recording(
        100.0, 50.0, analysis.Maximum("x"), ["x", "t"], period=analysis.PeriodTest(longest=4)
    ),
    integrator=adaptive,
    store="diagram",
)
print(diagram["x"].max(), diagram.attrs)
analysis.orbit_diagram(
    lambda stiffness: Oscillator(stiffness),
    {"stiffness": [1.0, 2.0]},
    y0,
    analysis.Recording(
        100.0,
        50.0,
        {"zero": section, "top": analysis.Maximum("x")},
        {"height": lambda system, t, y, dy, mode, args: y.x},
        points=20,
    ),
)
analysis.time_history(system, y0, np.linspace(0.0, 10.0, 101), ["x", "v"])
spectrum = analysis.lyapunov_spectrum(system, y0, analysis.Segments(1.0, 100, 10.0))
print(spectrum.exponents[0])
swept = sweep.run_sweep(
    lambda k: {"x": 2.0 * k}, {"k": [1.0, 2.0]}, labels=sweep.Labels({"x": sweep.Variable(units="m")})
)
print(swept["x"])

times = jnp.linspace(0.0, 1.0, 20)


def residual(p):
    return (p["size"] * jnp.exp(-p["rate"] * times) - 1.0) / 0.01


fit = identification.least_squares(residual, {"size": 1.0, "rate": 1.0})
print(fit.values["size"], fit.standard_errors()["rate"], fit.cost, fit.covariance())
identification.least_squares(
    residual,
    {"size": identification.Unknown(1.0, bounds=(0.0, None), unit="m")},
    identification.LevenbergMarquardt(loss=identification.Huber()),
)
best = identification.many_starts(residual, {"size": [1.0, 2.0], "rate": [1.0, 3.0]})
print(identification.best(best).values["rate"])
descent = identification.GradientDescent(optax.adam(1e-2))
identification.least_squares(residual, {"size": 1.0, "rate": 2.0}, descent)
identification.many_starts(
    residual, {"size": [1.0]}, method=identification.LevenbergMarquardt(tolerance=1e-6), chunk_size=8
)

plot.motion(run, block, "x")
plot.orbit_diagram(diagram, "x")
plot.fit(fit)

printed = cx.simulate(*cx.scenario(1), method="as_printed")
print(cx.simulate(*cx.scenario(1), 1.0).y.x, printed.events.t)
print(
    BlockOnBelt.constructed(80.0), JointedBeam.printed(0.1), CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
)
print(Motion(x=0.0, v=0.1))
rows = np.loadtxt("voltages.csv", delimiter=",", skiprows=1)
voltage = cx.Sampled(rows[:, 0], rows[:, 1], rows[:, 2])
cx.simulate(cx.scenario(1).parameters, voltage, voltage.times[-1])
scale = {
    "m": 1.0,
    "M": 0.2,
    "J": 0.1,
    "k1": 17.0,
    "k2": 11.0,
    "c1": 1.0,
    "c2": 0.0,
    "r": 0.25,
    "Q": 0.0,
}
BlockOnBelt(**scale, k3=80.0, V_b=0.1, law=friction.SmoothHyperbolicWeakening(0.3, 100.0, 0.9, 1.7))
