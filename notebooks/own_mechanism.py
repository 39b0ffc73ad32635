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
# # Your own mechanism in 25 lines
#
# State coordinates, inertia, forces and contacts. Modes, guards and transitions follow, and with them
# the motion with its events, two smooth forms, sweeps over all cores and derivatives.
#
# The machine: a motor drags a sledge over rough ground, and the sledge drags another one, each on an
# elastic rope.

# %% tags=["remove-output"]
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss
from stickslip import plot
from stickslip.friction import LuGre, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")


# %%
class Sledges(AbstractMechanism):
    """Two sledges in a row, the first one dragged by a motor."""

    masses: Any
    rope: Any
    law: Any
    speed: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"front": {"x": 1}, "rear": {"y": 1}}

    def mass_matrix(self, q):
        return {"x": self.masses[0], "y": self.masses[1]}

    def forces(self, t, q, v, args):
        motor, rope = self.rope * (self.speed * t - q.x), self.rope * (q.x - q.y)
        return {"x": motor - rope, "y": rope}

    def contacts(self, t, q, v, args):
        return [Contact(self.law, 9.81 * mass) for mass in self.masses]


# %% [markdown]
# That is all. A contact is a law and a normal force [N]; its direction says which velocities it rubs
# against.

# %%
sledges = Sledges((2.0, 1.0), 20.0, Stribeck(0.5, 0.3, 0.05), 0.4)
END = 20.0
grid = np.linspace(0.0, END, 2001)
start = sledges.state()
run = ss.simulate(sledges, 0.0, END, start, saveat=ss.SaveAt(ts=jnp.asarray(grid)))
print(run)
print(run.events.to_dataframe(sledges)[["t", "mode_after"]].head())

# %% tags=["remove-cell"]
# The front one lets go when its rope pulls with the friction that it bears at rest.
assert abs(float(run.events.t[0]) - 0.5 * 2.0 * 9.81 / (20.0 * 0.4)) < 1e-9
assert bool(run.successful)

# %% [markdown]
# The modes say when each sledge sticks: `contact_states` has the words of each contact, by its name.

# %%
states = sledges.contact_states(run.outputs.mode)
figure, axes = plt.subplots(2, 1, sharex=True, figsize=(9, 5), layout="constrained")
for axis, rate, name in zip(axes, ("v_x", "v_y"), ("front", "rear"), strict=True):
    plot.motion(run, sledges, rate, contacts=name, events=False, ax=axis).legend(loc="upper right")
axes[0].set_xlabel(None)
plt.show()

# %% tags=["remove-cell"]
assert np.abs(np.asarray(run.outputs.y.v_x)[states["front"] == "stick"]).max() < 1e-12

# %% [markdown]
# ## Three forms of one declaration
#
# Regularised laws creep instead of sticking; bristles give a little before they slide. Both tend to
# the set-valued form.

# %%
SHORT = 4.0
sharp = ss.simulate(sledges, 0.0, SHORT, start).y1.x
fine = ss.Integrator("dop853", ss.AdaptiveStep(1e-8, 1e-9), max_steps=1_000_000)
gaps = []
for v_reg in (1e-2, 1e-3):
    smooth = sledges.regularised(v_reg)
    y = ss.simulate(smooth, 0.0, SHORT, start, integrator=fine, saveat=ss.SaveAt(max_events=None)).y1
    gaps.append(abs(float(y.x - sharp)))
    print(f"regularised, {v_reg:g} m/s: {gaps[-1]:.1e} m off")
for stiffness in (1e2, 1e4):
    # Critical damping on the bristles, 2 sqrt(sigma_0 m / N), where N = 9.81 m.
    form = sledges.bristles(LuGre, sigma_0=stiffness, sigma_1=2.0 * (stiffness / 9.81) ** 0.5)
    y = ss.simulate(
        form, 0.0, SHORT, form.start(start), integrator=fine, saveat=ss.SaveAt(max_events=None)
    ).y1
    gaps.append(abs(float(y.y.x - sharp)))
    print(f"bristles, {stiffness:g} 1/m: {gaps[-1]:.1e} m off")

# %% tags=["remove-cell"]
assert gaps[1] < gaps[0]
assert gaps[3] < gaps[2]

# %% [markdown]
# ## A derivative
#
# Through all events, in the speed of the motor and the friction at rest; beside it differences.


# %%
def place(p):
    """Where the rear sledge is after the run, for `p` = (speed, coefficient at rest)."""
    machine = Sledges((2.0, 1.0), 20.0, Stribeck(p[1], 0.3, 0.05), p[0])
    tight = ss.Integrator("dop853", ss.AdaptiveStep(1e-10, 1e-11))
    return ss.simulate(machine, 0.0, SHORT, machine.state(), integrator=tight, throw=False).y1.y


p = jnp.array([0.4, 0.5])
slope = jax.jit(jax.jacfwd(place))(p)
beside = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
ends = jax.jit(jax.vmap(place))(jnp.asarray(np.asarray(p) + 1e-5 * beside))
differences = (ends[::2] - ends[1::2]) / 2e-5
print(f"exact {slope}, differences {differences}")

# %% tags=["remove-cell"]
np.testing.assert_allclose(slope, differences, rtol=1e-5)

# %% [markdown]
# ## A sweep
#
# `map_lanes` runs one lane for each speed of the motor, in chunks on all cores: at which does the
# front sledge no longer come to rest?

# %%
speeds = jnp.linspace(0.05, 1.5, 400)


def share(speed):
    """Share of the last 20 of 60 s in which the front sledge sticks."""
    machine = Sledges((2.0, 1.0), 20.0, sledges.law, speed)
    saved = ss.SaveAt(ts=jnp.linspace(40.0, 60.0, 401), max_events=None)
    out = ss.simulate(machine, 0.0, 60.0, machine.state(), saveat=saved, throw=False).outputs
    return jnp.mean(jnp.asarray(out.mode & 3 == 1, jnp.float64))


# %% tags=["remove-cell"]
speeds = jnp.linspace(0.05, 1.5, 16) if QUICK else speeds

# %%
shares = np.asarray(ss.map_lanes(share)(speeds))
figure, axis = plt.subplots(figsize=(9, 2.5), layout="constrained")
axis.plot(speeds, shares, ".-")
axis.set(xlabel="speed of the motor [m/s]", ylabel="time that the front sticks")
print(
    f"sticks {shares[0]:.0%} of the time at {speeds[0]:.2f} m/s, {shares[-1]:.0%} at {speeds[-1]:.2f}"
)

# %% tags=["remove-cell"]
assert shares[0] > 0.5 > shares[-1]

# %% [markdown]
# More: the docstring of `AbstractMechanism` says what is declared how; `experiments/mechanisms/` holds
# a drill string, a brake, a pendulum on a shaft, a belt drive and a chain, each beside a known result.
