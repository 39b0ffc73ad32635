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
# # Friction damper of a blade
#
# Blades of turbines are damped by small pieces of metal that rub on them. Too light a piece slides
# with hardly any friction, too heavy a one sticks and only makes the blade stiffer; in between there
# is a best preload. Here it is found, from the matrices of a finite-element model to the answer,
# without smoothing the friction or cutting off harmonics.

# %% tags=["remove-output"]
import functools

import jax
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import root

import stickslip as ss
from stickslip import plot
from stickslip.continuation import Forcing, forced_response, frequency_response
from stickslip.structure import (
    HarmonicForce,
    Jenkins,
    LinearStructure,
    WithSliders,
    craig_bampton,
    modal_damping,
)

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
LIMITS, COUNT = (3.0, 10.0, 30.0), 31  # frictions [N], and how many frequencies have each
BAND, BRANCH = (235.0, 305.0), (250.0, 270.0)  # Hz

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")
if QUICK:
    LIMITS, COUNT, BRANCH = (10.0,), 8, (250.0, 251.0)

# %% [markdown]
# ## From matrices
#
# A steel blade, 100 mm long, 20 mm wide and 3 mm thick, is clamped at its root: 20 beam elements with
# a deflection and a slope at each node. Yours come from a finite-element program: `scipy.io.loadmat`
# reads them ([Friction dampers](friction_dampers.md)).
#
# The damper sits at a quarter of the length and the force acts on the tip. `craig_bampton` keeps
# these two deflections and adds the first mode of the rest.

# %%
LENGTH, WIDTH, THICK, E, RHO, N = 0.1, 0.02, 0.003, 2.0e11, 7800.0, 20
h, EI, LINE = LENGTH / N, E * WIDTH * THICK**3 / 12.0, RHO * WIDTH * THICK
stiff = np.array(
    [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
     [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
)  # fmt: skip
heavy = np.array(
    [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
     [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
)  # fmt: skip
K, M = np.zeros((2, 2 * N + 2, 2 * N + 2))
for i in range(N):
    at = slice(2 * i, 2 * i + 4)
    K[at, at] += EI / h**3 * stiff
    M[at, at] += LINE * h / 420.0 * heavy
K, M = K[2:, 2:], M[2:, 2:]  # clamped

PLATFORM, TIP = 2 * (N // 4 - 1), 2 * (N - 1)
small = craig_bampton(M, K, boundary=[PLATFORM, TIP], modes=1)
damping = modal_damping(small.mass, small.stiffness, ratios=0.01)
first = LinearStructure(small.mass, damping, small.stiffness).frequencies()[0] / (2 * np.pi)
beam = 3.5160152685 / (2 * np.pi * LENGTH**2) * np.sqrt(EI / LINE)
print(f"first frequency {first:.3f} Hz; of Euler's beam {beam:.3f} Hz")

# %% tags=["remove-cell"]
assert abs(first - beam) < 2e-4 * beam

# %% [markdown]
# ## The damper
#
# A Jenkins element: a slider without mass behind a spring, here of 2 N/µm, that gives way at the
# friction $\mu N$. It is put on the structure by a row that makes its elongation out of the
# coordinates.
#
# If it never stuck, or never slipped, the blade would be linear. Between these two peaks everything
# happens.

# %%
CONTACT, FORCE = 2.0e6, 1.0  # N/m, N
platform, tip = np.eye(3)[0], np.eye(3)[1]


def blade(frequency, limit):
    """The blade under a harmonic force on its tip [rad/s], with the friction of its damper [N]."""
    structure = LinearStructure(
        small.mass, damping, small.stiffness, HarmonicForce(FORCE * tip, frequency)
    )
    return WithSliders(structure, {"damper": Jenkins(platform, CONTACT, limit)})


def linear(frequency, sticks):
    """Amplitude of the tip where the damper always sticks, or is not there."""
    K = small.stiffness + sticks * CONTACT * np.outer(platform, platform)
    dynamic = K - frequency**2 * small.mass + 1j * frequency * damping
    return abs(np.linalg.solve(dynamic, FORCE * tip)[1])


hertz = np.linspace(*BAND, 4001)
free, stuck = (np.array([linear(2 * np.pi * f, sticks) for f in hertz]) for sticks in (0.0, 1.0))
for name, curve in (("free", free), ("stuck", stuck)):
    print(f"{name}: peak {1e3 * curve.max():.3f} mm at {hertz[curve.argmax()]:.1f} Hz")

# %% [markdown]
# ## One frequency
#
# `forced_response` finds the periodic motion, all sticks and slips located, with its harmonics and
# its stability.

# %%
forcing = Forcing("system__force__frequency")
rest = blade(1.0, 1.0).start(LinearStructure(small.mass, damping, small.stiffness).state())
one = forced_response(blade(2 * np.pi * 255.0, 10.0), rest, forcing, observables="q[1]")
print(one)

# %% [markdown]
# ## Over the frequency, for several preloads
#
# Every pair of a friction and a frequency is a lane of one program.


# %%
@functools.partial(ss.map_lanes, executor="portable")  # XLA cannot fuse this program
def amplitude(frequency, limit):
    found = forced_response(blade(frequency, limit), rest, forcing, observables="q[1]")
    return found.amplitude["q[1]"], found.successful


some = np.linspace(*BAND, COUNT)
limits, frequencies = np.meshgrid(LIMITS, some, indexing="ij")
found, successful = amplitude(2 * np.pi * frequencies.ravel(), limits.ravel())
curves, successful = (np.asarray(a).reshape(limits.shape) for a in (found, successful))
print(f"{successful.sum()} of {successful.size} responses found")

figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.semilogy(hertz, 1e3 * free, "0.7", label="free")
axes.semilogy(hertz, 1e3 * stuck, "0.7", linestyle="--", label="stuck")
for limit, curve in zip(LIMITS, curves, strict=True):
    axes.semilogy(some, 1e3 * curve, label=f"{limit:g} N")
axes.set(xlabel="frequency [Hz]", ylabel="amplitude of the tip [mm]")
axes.legend(frameon=False, ncols=2)
plt.show()

# %% tags=["remove-cell"]
assert successful.all()
assert curves.max() < min(free.max(), stuck.max())

# %% [markdown]
# ## The best preload
#
# At a peak the slope of the amplitude by the frequency is zero, and where the peak is lowest that by
# the friction is zero as well: one root of a gradient, which is exact through the events.

# %%
peaks = curves.max(axis=1)
best = int(np.argmin(peaks))
start = 2 * np.pi * some[curves[best].argmax()], LIMITS[best]
scale = np.array(start)  # the root is looked for in parts of these


@jax.jit
def slopes(parts):
    def height(parts):
        w, limit = parts * scale
        return forced_response(blade(w, limit), rest, forcing, observables="q[1]").amplitude["q[1]"]

    return jax.jacfwd(height)(parts) / peaks[best]


answer = root(slopes, np.ones(2), tol=1e-9)
w, limit = answer.x * scale
lowest = forced_response(blade(w, limit), rest, forcing, observables="q[1]")
height = float(lowest.amplitude["q[1]"])
print(f"best friction {limit:.4f} N: peak {1e3 * height:.5f} mm at {w / (2 * np.pi):.3f} Hz")
print(f"that is {free.max() / height:.1f} times less than without a damper")

# %% tags=["remove-cell"]
assert answer.success
assert height < peaks.min() * 1.0001 or QUICK
assert bool(lowest.stable)

# %% [markdown]
# Where everything is linear but the slider, only the ratio of friction and force counts: with ten
# times the force the best friction is ten times as great, and so is the amplitude. A damper that is
# best at one level of excitation is too light at a higher one and too heavy at a lower one.
#
# ## With folds and stability
#
# `frequency_response` follows the branch instead, through folds and past unstable motions, and names
# the borders at which events appear or vanish.

# %%
span = tuple(2 * np.pi * np.array(BRANCH))
branch = frequency_response(blade(span[0], limit), rest, span, forcing, observables="q[1]")
print(f"{len(branch.frequency)} motions; events appear or vanish at", end=" ")
print(", ".join(f"{point.value / (2 * np.pi):.2f}" for point in branch.branch["GR"]) or "none", "Hz")
plot.frequency_response(branch, "q[1]")
plt.show()
