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
# # Getting started
#
# One block on a belt, from the first run to a diagram, in five cells. Install first: `pip install .` in
# a checkout, or `make setup` for an environment of its own.

# %% tags=["remove-output"]
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss
from stickslip.analysis import Maximum, time_history
from stickslip.systems import CoulombOscillator, Motion

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")

# %% [markdown]
# ## A run and its events
#
# 1 kg on a spring of 1 N/m; the belt drags it with at most 1 N while it sticks and with 0.5 N while it
# slips. The run starts stuck, and every change of mode is located to rounding: the block lets go when
# the spring pulls with 1 N, after 1 m / 0.2 m/s = 5 s.

# %%
block = CoulombOscillator(mass=1.0, stiffness=1.0, static_force=1.0, kinetic_force=0.5, belt_speed=0.2)
start = Motion(x=0.0, v=0.2)
run = ss.simulate(block, 0.0, 30.0, start, "stick")
print(run)
for t, mode in zip(run.events.t[:4], run.events.mode_after[:4], strict=True):
    print(f"{t:.12f} s: {block.mode_names[mode]}")

# %% tags=["remove-cell"]
assert abs(float(run.events.t[0]) - 5.0) < 1e-12

# %% [markdown]
# ## A history
#
# `time_history` returns an xarray `Dataset` with units. Anything that the system can say may be asked
# for by name, and crossings of sections are recorded beside it.

# %%
t = np.linspace(0.0, 30.0, 601)
history = time_history(block, start, t, ["x", "v"], sections={"peak": Maximum("x")})
figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
stuck = history.mode == block.mode_names.index("stick")
axis.fill_between(
    t, 0, 1, where=stuck, transform=axis.get_xaxis_transform(), color="0.88", label="stick"
)
axis.plot(t, history.x, label="x [m]")
axis.plot(history.at_peak_t, history.at_peak_x, "o", label="peaks")
axis.set_xlabel("t [s]")
axis.legend(loc="upper right")
plt.show()

# %% tags=["remove-cell"]
assert np.all(history.v.values[stuck.values] == 0.2)

# %% [markdown]
# ## A derivative
#
# JAX differentiates through all events, forward and reverse. `run.flags` is zero where the derivative
# exists.


# %%
def end(belt_speed):
    """Where the block is after 30 s."""
    moved = CoulombOscillator(1.0, 1.0, 1.0, 0.5, belt_speed)
    return ss.simulate(moved, 0.0, 30.0, Motion(x=0.0, v=belt_speed), "stick").y1.x


slope = jax.jit(jax.grad(end))(0.2)
print(f"d x(30) / d belt speed = {slope:.10f} s; in closed form 16.2232182593 s")

# %% tags=["remove-cell"]
assert abs(float(slope) - 16.2232182593) < 1e-8
assert int(run.flags) == 0

# %% [markdown]
# ## Many runs
#
# `map_lanes` is `jax.vmap` on all cores; a *lane* is one of the runs. Each has its own events.

# %%
LANES = 10_000

# %% tags=["remove-cell"]
LANES = 64 if QUICK else LANES

# %%
speeds = jnp.linspace(0.05, 0.6, LANES)
ends = np.asarray(ss.map_lanes(end)(speeds))
figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
axis.plot(speeds, ends, ".", markersize=2)
axis.set(xlabel="belt speed [m/s]", ylabel="x(30 s) [m]")
plt.show()

# %% tags=["remove-cell"]
assert np.isfinite(ends).all()

# %% [markdown]
# Go on with [a mechanism of your own](own_mechanism.py), [how to choose](how_to_choose.md) law, method
# and executor, and the [sharp bits](sharp_bits.md).
