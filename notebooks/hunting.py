# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Why does my axis hunt?
#
# An axis is told to stay where it is, and does not: once a second it jumps over its set point and back,
# for ever. The cure is mostly found by trial. Here it is found from the numbers of a measurement: which
# gains hunt, and which do not under any friction that the axis may have.
#
# The numbers are those of a [report on the shoulder of a robot
# arm](https://github.com/almond-bot/axol/pull/317): its gears take 2.4 to 3.3 N m to break away, about
# 2.1 N m at 0.06 rad/s, 1.4 at 0.12 and 0.7 beyond 0.2, a Stribeck curve. Inertia and damping are not
# told there; 0.4 kg m² and 2 N m s/rad stand for them, and 100 Hz with a sample of delay for its
# controller.

# %% tags=["remove-output"]
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import optax

import stickslip as ss
from stickslip import plot
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, periodic_orbit
from stickslip.control import PID, WithController, hunting_map
from stickslip.friction import Coulomb, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
POINTS, STEPS, BETWEEN, LONG = 40, 60, 91, 24.0  # of the map, of the descent, of friction; [s]

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")
if QUICK:
    POINTS, STEPS, BETWEEN, LONG = 3, 30, 5, 12.0


# %%
class Shoulder(AbstractMechanism):
    static: Any
    coordinates: ClassVar = {"x": "rad"}
    contact_directions: ClassVar = {"gears": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 0.4}

    def forces(self, t, q, v, args):
        return {"x": args.output - 2.0 * v.x}

    def contacts(self, t, q, v, args):
        return {"gears": Contact(Stribeck(self.static, 0.7, 0.1))}


PERIOD = 0.01


def loop(kp, ki, kd, static=2.85):
    pid = PID(kp, ki, kd, period=PERIOD, limit=20.0)
    return WithController(Shoulder(static), pid, PERIOD, pid.state(), delay=1)


def start(loop):
    return loop.start(loop.system.state(x=0.3))  # 0.3 rad away from where it should be


step = ss.Integrator("rk4", ss.FixedStep(PERIOD))

# %% [markdown]
# ## Gains of a rule
#
# Ziegler and Nichols: raise the proportional gain until the loop without friction oscillates, and take
# 0.6 of it. With the delay of a sample, and half of one for the hold, that is in closed form:

# %%
late = 1.5 * PERIOD
omega = np.sqrt(2.0 / (0.4 * late))  # where the phase is -180 degrees, for small omega * late
ultimate, cycle = omega * np.hypot(0.4 * omega, 2.0), 2 * np.pi / omega
rule = np.array([0.6 * ultimate, 1.2 * ultimate / cycle, 0.075 * ultimate * cycle])
print("kp {:.1f} N m/rad, ki {:.0f} N m/(rad s), kd {:.2f} N m s/rad".format(*rule))


def motion(gains, static=2.85):
    system, times = loop(*gains, static), np.arange(0.0, 8.0, PERIOD)
    saved = ss.SaveAt(ts=times, max_events=64)
    return ss.simulate(system, 0.0, 8.0, start(system), integrator=step, saveat=saved)


run = motion(rule)
print(run)

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.plot(run.outputs.t, run.outputs.y.y.x)
left.set(xlabel="time [s]", ylabel="angle [rad]", ylim=(-0.05, 0.05))
right.plot(run.outputs.t, run.outputs.y.output)
right.set(xlabel="time [s]", ylabel="output of the controller [N m]")
plt.show()

# %% [markdown]
# The arm sticks beside its set point. The integrator winds up, until the output overcomes the static
# friction; the friction falls, what has been gathered is too much, and the arm sticks on the other
# side.
#
# ## A map
#
# `hunting_map` runs one loop for each point, and gives a verdict. Below, the derivative gain is small
# against the slope of the friction: everything with an integrator hunts, the harder the more of it.
# Enough damping, and it creeps into its place.

# %%
ki, kd = np.meshgrid(np.linspace(0.0, 600.0, POINTS), np.linspace(2.0, 10.0, POINTS))
values = {"ki": ki, "kd": kd}
found = hunting_map(
    lambda ki, kd: loop(rule[0], ki, kd), values, start, LONG, "x", resolution=1e-6, integrator=step
)
words, counts = np.unique(found.verdict, return_counts=True)
print(dict(zip(words.tolist(), counts.tolist(), strict=True)))

# %% tags=["remove-cell"]
assert found.verdict[0, 0] == "rests"
assert found.verdict[0, -1] == "unstable" or found.verdict[0, -1] == "hunts"
assert found.verdict[-1, 1] != "hunts"

# %%
axis = plot.hunting(found, ("ki", "kd"))
axis.plot(*rule[1:], "k*", markersize=12)
axis.set(xlabel="ki [N m/(rad s)]", ylabel="kd [N m s/rad]")
plt.show()

# %% [markdown]
# ## Gains that do not, under any of its frictions
#
# The static friction is known with an interval only: 2.4 to 3.3 N m. The worst error over seven values
# of it, from 0.6 s after the start on, has a gradient by the gains, through all events and all samples
# of all seven motions:

# %%
statics = np.linspace(2.4, 3.3, 7)
seen = PERIOD * np.arange(60, 401)


def error(gains, static):
    system, saved = loop(*gains, static), ss.SaveAt(ts=seen, events=False)
    run = ss.simulate(system, 0.0, 4.0, start(system), integrator=step, saveat=saved, throw=False)
    return jnp.sqrt(jnp.mean(run.outputs.y.y.x**2))


def worst(logarithms, statics=statics):
    return jnp.max(ss.map_lanes(lambda static: error(jnp.exp(logarithms), static))(statics))


slope = jax.jit(jax.value_and_grad(worst))
adam = optax.adam(0.05)
ahead = jax.jit(adam.update)
here = jnp.log(rule)
state, costs, best = adam.init(here), [], here
for _ in range(STEPS):
    cost, gradient = slope(here)
    best = here if cost <= min(costs, default=cost) else best
    costs.append(float(cost))
    change, state = ahead(gradient, state)
    here = here + change
tuned = np.exp(best)
print("kp {:.1f} N m/rad, ki {:.0f} N m/(rad s), kd {:.2f} N m s/rad".format(*tuned))
between = np.linspace(2.4, 3.3, BETWEEN)
for name, gains in {"rule": rule, "tuned": tuned}.items():
    print(f"{name}: worst error {1e3 * worst(np.log(gains), between):.2f} mrad")

# %% tags=["remove-cell"]
assert worst(np.log(tuned), between) < 0.2 * worst(np.log(rule), between)

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.semilogy(1e3 * np.array(costs))
left.set(xlabel="step", ylabel="worst error [mrad]")
for name, gains in {"rule": rule, "tuned": tuned}.items():
    for static in (2.4, 3.3):
        run = motion(gains, static)
        right.plot(run.outputs.t, run.outputs.y.y.x, label=f"{name}, {static} N m")
right.set(xlabel="time [s]", ylabel="angle [rad]", ylim=(-0.05, 0.05))
right.legend(frameon=False)
plt.show()

# %% [markdown]
# Four seconds are not for ever: another map, over the friction, says what becomes of them. A loop that
# creeps comes ever nearer to its set point without a stop.

# %%
for name, gains in {"rule": rule, "tuned": tuned}.items():
    lanes = hunting_map(
        lambda static, gains=gains: loop(*gains, static), {"static": between}, start, LONG, "x",
        resolution=1e-6, integrator=step,
    )  # fmt: skip
    far = 1e3 * lanes.amplitude.max()
    print(f"{name}: {', '.join(np.unique(lanes.verdict))}; amplitude at most {far:.4f} mrad")

# %% tags=["remove-cell"]
assert "hunts" not in lanes.verdict

# %% [markdown]
# ## Where hunting is born, and where it ends
#
# Without sampling the loop is a mechanism with the integral as a state of first order, and its hunting
# a periodic orbit that can be followed. The textbook's axis: 1 kg, 1 N of friction, 1.5 N at rest.


# %%
class Continuous(AbstractMechanism):
    ki: Any = 50.0
    coordinates: ClassVar = {"x": "m"}
    first_order: ClassVar = {"I": "m s"}
    contact_directions: ClassVar = {"guide": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -50.0 * q.x - self.ki * q.I - 10.0 * v.x}

    def rates(self, t, q, v, args):
        return {"I": q.x}

    def contacts(self, t, q, v, args):
        return {"guide": Contact(Coulomb(1.5, 1.0))}


axis = Continuous(50.0)
settled = ss.simulate(axis, 0.0, 40.0, axis.state(x=0.1)).y1
cycle = periodic_orbit(axis, OrbitGuess(settled, 19.4, t0=0.0))
print(cycle)
branch = continue_orbit(axis, cycle, "ki", (10.0, 700.0), follow=Follow(step=0.2, max_points=60))
print(branch)

# %% tags=["remove-cell"]
assert abs(branch["GR"][0].value - 656.1668632424) < 1e-7

# %%
picture = plot.branch(branch, "x")
picture.axvline(500.0, color="0.8", zorder=0)
picture.set(xlabel="ki [N/(m s)]", yscale="log")
plt.show()

# %% [markdown]
# It hunts at every gain that is not zero: towards zero the amplitude stays, and the period grows
# without bound. Hunting goes on beyond 500, where the loop without friction would be unstable, and ends
# where its stick has no length left: in a fold with a cycle that only slips. Whatever starts outside of
# that one is driven off. The amplitude is in proportion to $F_s - F_c$: without an excess there is
# none.
#
# With a sample time such a cycle does not close in general: a stick ends with a sample, each time a
# little off. Its amplitude tends to the one here, as the sample time does to zero.
