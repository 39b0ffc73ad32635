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
# # LuGre, and what it costs
#
# A set-valued law sticks exactly. Real contacts give a little before they slide: asperities bend like
# bristles. The LuGre law has one state for them, the deflection $z$,
#
# $$\dot z = v - \frac{\sigma_0 |v|}{\mu(v)}\,z, \qquad F = N(\sigma_0 z + \sigma_1 \dot z),$$
#
# with the stiffness $\sigma_0$ [1/m] and the damping $\sigma_1$ [s/m], each per unit of normal force.
# What does it show that a set-valued law cannot, what does it cost, and which method should take it?

# %% tags=["remove-output"]
import time
from typing import Any, ClassVar

import diffrax
import jax
import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss
from stickslip.friction import LuGre, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")


# %%
class Block(AbstractMechanism):
    """A block on a table, pulled to and fro by a force that grows."""

    law: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"table": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 0.7 * t * jax.numpy.sin(2.0 * t)}

    def contacts(self, t, q, v, args):
        return {"table": Contact(self.law, 10.0)}


law = Stribeck(0.4, 0.3, 0.01)
END = 12.0
grid = np.linspace(0.0, END, 1201)
saved = ss.SaveAt(ts=jax.numpy.asarray(grid))
exact = ss.simulate(Block(law), 0.0, END, Block(law).state(), saveat=saved)
first = float(exact.events.t[0])
print(f"the set-valued block lets go at {first:.6f} s: 0.7 t sin(2 t) = 4 N there")

# %% tags=["remove-cell"]
assert abs(abs(0.7 * first * np.sin(2.0 * first)) - 4.0) < 1e-9

# %% [markdown]
# ## Before it slides
#
# Until then the set-valued block does not move at all. The bristles bend, and what they show is a
# hysteresis: force over displacement, micrometres wide.


# %%
def bent(stiffness, method="dop853", rtol=1e-8):
    """The run with bristles of `stiffness` [1/m], its seconds of computing, and the attempts."""
    form = Block(law).bristles(LuGre, sigma_0=stiffness, sigma_1=2.0 * np.sqrt(stiffness / 10.0))
    integrator = ss.Integrator(method, ss.AdaptiveStep(rtol, 0.1 * rtol), max_steps=10_000_000)

    @jax.jit
    def run(start):
        return ss.simulate(form, 0.0, END, start, integrator=integrator, saveat=saved, throw=False)

    start = form.start(Block(law).state())
    jax.block_until_ready(run(start))  # compiles
    begin = time.perf_counter()
    found = jax.block_until_ready(run(start))
    return found, time.perf_counter() - begin, int(found.stats.num_attempts)


soft, *_ = bent(1e4)
before = grid < first
force = 0.7 * grid * np.sin(2.0 * grid)
figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
axes[0].plot(1e6 * np.asarray(soft.outputs.y.y.x)[before], force[before])
axes[0].set(xlabel="x [µm]", ylabel="pull [N]", title="bristles of 1e4 1/m, before sliding")
axes[1].plot(grid, 1e3 * np.asarray(exact.outputs.y.x), label="set-valued")
axes[1].plot(grid, 1e3 * np.asarray(soft.outputs.y.y.x), "--", label="LuGre")
axes[1].set(xlabel="t [s]", ylabel="x [mm]")
axes[1].legend()
elastic = np.abs(np.asarray(soft.outputs.y.y.x)[before]).max()
print(f"largest displacement before sliding: {1e6 * elastic:.1f} µm")

# %% tags=["remove-cell"]
assert 0.0 < elastic < 1e-3
assert np.all(np.asarray(exact.outputs.y.x)[before] == 0.0)

# %% [markdown]
# ## What it costs
#
# In sliding the bristles relax at the rate $\sigma_0 |v| / \mu$, and at rest they ring: both grow with
# $\sigma_0$. An explicit method follows them with ever shorter steps, however little happens. An
# implicit one takes many steps where the friction turns, but hardly more for stiffer bristles; each
# costs as much as five to ten explicit ones.

# %%
STIFFNESSES = (1e3, 1e4, 1e5)

# %% tags=["remove-cell"]
STIFFNESSES = STIFFNESSES[:2] if QUICK else STIFFNESSES

# %%
print(f"{'1/m':>8s} {'method':>10s} {'attempts':>9s} {'s':>7s}  off the set-valued end")
reference = float(exact.y1.x)
attempts, gaps, ran = {}, [], []
for stiffness in STIFFNESSES:
    for name, method, rtol in (("dop853", "dop853", 1e-8), ("Kvaerno5", diffrax.Kvaerno5(), 1e-5)):
        found, seconds, tried = bent(stiffness, method, rtol)
        gap = abs(float(found.y1.y.x) - reference)
        attempts[name, stiffness] = tried
        print(f"{stiffness:8g} {name:>10s} {tried:9d} {seconds:7.3f}  {gap:.1e} m")
        ran.append(bool(found.successful))
    gaps.append(gap)
tried = int(exact.stats.num_attempts)
print(f"set-valued: {tried} attempts, {int(exact.events.count)} events")

# %% tags=["remove-cell"]
assert all(ran)
# Stiffer bristles come nearer to the set-valued law, and cost the explicit method more.
assert gaps[-1] < gaps[0]
assert attempts["dop853", STIFFNESSES[-1]] > 2 * attempts["dop853", STIFFNESSES[0]]
assert attempts["Kvaerno5", STIFFNESSES[-1]] < 2 * attempts["Kvaerno5", STIFFNESSES[0]]
assert tried < attempts["dop853", STIFFNESSES[0]]

# %% [markdown]
# On the machine where this was written bristles ten times stiffer cost the explicit method six to nine
# times as many attempts, the implicit one at most 1.3 times; it was the faster one from 1e5 1/m on. The
# set-valued law took fewer than either at any stiffness.
#
# So: **set-valued** where sticking is what matters, in sweeps and in fits of friction; **LuGre** where
# the displacement before sliding is measured or controlled, as in a positioning machine, with an
# explicit method for soft bristles and an implicit one (`diffrax.Kvaerno5()`) for stiff ones. A fit may
# begin with one and end with the other: both come from the same declaration.
