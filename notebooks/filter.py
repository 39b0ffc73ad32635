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
# # A filter that knows it sticks
#
# A block rides on a belt, held by a spring. An encoder says where it is, twenty times in ten seconds,
# to a centimetre; nobody measures its speed, the friction under it, or a push that drifts. A Kalman
# filter through the exact motion tells all three, with bands. While the block sticks its speed is that
# of the belt, without any doubt, and its place says nothing about the push. The instant at which it
# breaks away does.

# %% tags=["remove-output"]
from typing import Any, ClassVar

import jax
import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss
from stickslip.estimation import Gaussian, Noise, kalman_filter, smooth
from stickslip.friction import Coulomb
from stickslip.identification import KalmanFilter, Observed, Problem, Record, Unknown
from stickslip.mechanism import AbstractMechanism, Contact

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
STAMPS = 120

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")
if QUICK:
    STAMPS = 40


# %%
class Block(AbstractMechanism):
    """1 kg on a belt of 0.2 m/s, a spring of 1 N/m, and a push `d` that drifts."""

    kinetic: Any = 0.5
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1}}
    first_order: ClassVar = {"d": "N"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": q.d - q.x}

    def rates(self, t, q, v, args):
        return {"d": 0.0}

    def contacts(self, t, q, v, args):
        return {"belt": Contact(Coulomb(1.0, self.kinetic), surface_speed=0.2)}


block = Block()
t = 0.5 * np.arange(1, STAMPS + 1)
saved = ss.SaveAt(ts=t, max_events=None)
truth = ss.simulate(block, 0.0, t[-1], block.state(d=0.015, v_x=0.2), saveat=saved)
read = truth.outputs.y.x + 0.01 * np.random.default_rng(7).normal(size=t.size)

# %% [markdown]
# ## The filter
#
# It begins with a state and its standard deviations: the push is 0 within 0.02 N or so. Between the
# stamps the mean moves as `simulate` moves it, and the covariance with the derivative of the motion. An
# event turns it by the saltation matrix; where slip turns into stick that loses a rank, and what was
# not known about the speed is gone.


# %%
def position(system, t, y, mode, args):
    return {"x": y.x}


def track(kinetic, drift):
    system = Block(kinetic)
    start = Gaussian(block.state(v_x=0.2), spread=block.state(x=0.01, d=0.02))
    noise = Noise({"x": 0.01}, process=block.state(d=drift))
    return kalman_filter(system, 0.0, start, t, {"x": read}, position, noise)


found = track(0.5, 1e-4)
later = smooth(found)
print(found, f"log likelihood {found.log_likelihood:.1f}, mean NIS {found.nis.mean():.2f}")


# %%
def unmeasured(system, t, y, mode, args):
    return {"speed": y.v_x, "friction": system.friction_forces(t, y, mode, args)["belt"], "push": y.d}


known = jax.vmap(lambda t, y, mode: unmeasured(block, t, y, mode, None))(
    truth.outputs.t, truth.outputs.y, truth.outputs.mode
)
figure, axes = plt.subplots(3, 1, figsize=(8, 7), sharex=True, layout="constrained")
for estimate, color in ((found.estimate, "C0"), (later, "C3")):
    value, sd = estimate.sense(unmeasured)
    for axis, name in zip(axes, known, strict=True):
        low, high = value[name] - 2 * sd[name], value[name] + 2 * sd[name]
        axis.fill_between(t, low, high, color=color, alpha=0.3, lw=0)
for axis, (name, row) in zip(axes, known.items(), strict=True):
    axis.plot(t, row, "k.", markersize=3)
    axis.set_ylabel(f"{name} [{'m/s' if name == 'speed' else 'N'}]")
axes[0].set_title("filter (blue) and smoother (red), twice the standard deviation; truth (dots)")
axes[-1].set_xlabel("time [s]")
plt.show()

# %% [markdown]
# The friction of a block that sticks is what the spring and the push ask for: its band is that of the
# push, wide until it first breaks away. Of one that slips it is known, and the band has no width.
# `sense` takes any function of the state.

# %%
value, sd = later.sense(unmeasured)
sticks = np.asarray(later.modes) == block.mode_names.index("stick")
speed = sd["speed"]
print(f"speed in stick to {speed[sticks].max():.0e} m/s, in slip to {speed[~sticks].max():.4f} m/s")
off = (later.means.d[-1] - 0.015) / np.sqrt(later.covariances[-1, 1, 1])
print(f"push {later.means.d[-1]:.4f} N, {abs(off):.1f} standard deviations from the truth")

# %% tags=["remove-cell"]
assert sd["speed"][sticks].max() < 1e-9
assert abs(off) < 3.0
inside = np.abs(np.asarray(value["speed"] - known["speed"])) <= 3 * np.asarray(sd["speed"]) + 1e-9
assert inside.mean() > 0.95

# %% [markdown]
# ## Parameters and noise from the same record
#
# The likelihood of the record has derivatives by everything that stands in `track`, by the noise too.
# In a `Problem` it is what a fit maximises: friction comes with an interval that knows of the drift.

# %%
fit = Problem(
    system=lambda p, inputs: Block(p["kinetic"]),
    initial_state=lambda p, inputs: block.state(v_x=0.2),
    unknowns={"kinetic": Unknown(0.49, unit="N")},
    observed={"position": Observed(lambda t, y, system: y.x, 0.01, "m")},
    records=Record(t, {"position": read}, begin=0.0),
    correct=KalmanFilter(
        process=lambda p, inputs: block.state(d=1e-4),
        spread=lambda p, inputs: block.state(x=0.01, d=0.02),
    ),
).fit()
print(fit)

# %% tags=["remove-cell"]
assert fit.successful
assert abs(fit.values["kinetic"] - 0.5) < 3.0 * fit.standard_errors()["kinetic"] < 0.02

# %% [markdown]
# The filter is of first order: break-away should be known to within the time between stamps, or the
# bands behind it are too narrow. A push known to 0.1 N is half a second here, which is too much. Where
# the friction is not the one assumed, the normalised innovations say so: their mean should be 1.

# %%
for kinetic in (0.45, 0.5, 0.55):
    print(f"kinetic friction {kinetic} N: mean NIS {track(kinetic, 1e-4).nis.mean():.2f}")
