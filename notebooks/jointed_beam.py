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
# # Stick-slip that shakes a beam: spectrum, power flow, and how chaotic it is
#
# A mass bounces on a running belt. While it touches, friction drags it along; a spring joins it to
# a beam, which is shaken by every stick and every slip. We look at the motion, at its spectrum, at
# where the power goes, and then ask the question of the paper this model comes from: is it chaotic,
# and how sure are we?
#
# All numbers are dimensionless. The parameters are **constructed**: the paper's table is lost.

# %% tags=["remove-output"]
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss
from stickslip import plot
from stickslip.analysis import (
    Samples,
    Segments,
    amplitude_spectrum,
    energy_ledger,
    lyapunov_spectrum,
    lyapunov_spectrum_of_map,
    spectral_peaks,
    time_history,
    two_trajectory_exponent,
)
from stickslip.systems import JointedBeam, JointedBeamState

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
SLOW, FAST = 5e-4, 5e-3  # speeds of the belt
END, DROPPED = 400.0, 200.0
METHOD = ss.Integrator("tsit5", ss.AdaptiveStep(1e-9, 1e-14), max_steps=10_000_000)

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")
END, DROPPED = (44.0, 12.0) if QUICK else (END, DROPPED)

# %% [markdown]
# ## The motion
#
# Four modes: slip backward, stick, slip forward, no contact. In stick the velocity is that of the
# belt to the last bit.

# %%
t = np.arange(0.0, END, 0.01)
beam = JointedBeam.constructed(v=SLOW)
sticks = ss.Section(
    lambda system, t, y, dy, mode, args: jnp.where(mode == 1, 1.0, -1.0), "rising", name="stick"
)
motion = time_history(
    beam, beam.start(), Samples(t, max_points=1024),
    ["x", "y", "vy", "w", "w_rate", "friction_power", "beam_power"],
    sections={"stick": sticks}, integrator=METHOD,
)  # fmt: skip
stuck = motion.mode.values == 1

figure, axes = plt.subplots(1, 3, figsize=(11, 3.2), layout="constrained")
late = t >= DROPPED
plot.motion(motion.sel(time=slice(0.0, 8.0)), beam, "vy", ax=axes[0])
axes[0].set_title("grey: stick")
settled = motion.isel(time=late)
plot.phase_plane(settled, x="y", y="vy", ax=axes[1], linewidth=0.4).set_title("the mass")
plot.phase_plane(settled, x="w", y="w_rate", ax=axes[2], linewidth=0.4).set_title("the beam")
plt.show()

# %% tags=["remove-cell"]
assert np.all(motion.vy.values[stuck] == SLOW)
assert motion.time.units == motion.y.units == "1"

# %% [markdown]
# The stick begins once a bounce. The bounce has a closed form, half a swing on both springs and
# half a swing on one, so we know what the period must be.

# %%
onsets = motion.at_stick_t.values
period = np.diff(onsets[onsets > DROPPED]).mean()
exact = np.pi * np.sqrt(0.1 / 30.4) + np.pi * np.sqrt(0.1 / 7.6)
print(f"stick begins every {period:.6f}, the bounce takes {exact:.6f}")

# %% tags=["remove-cell"]
assert abs(period - exact) < 1e-3

# %% [markdown]
# ## The spectrum
#
# The mass has lines at the harmonics of that frequency $f_s$. The beam answers at them, and at its
# own frequencies $f_1, f_2, \dots$, which nothing damps.

# %%
bases = {"f_s": 1 / period, "f_1": np.pi / 2, "f_2": 2 * np.pi}
peaks = {}
for name in ("y", "w"):
    lines = spectral_peaks(amplitude_spectrum(motion[name].values[late], 0.01), count=6, bases=bases)
    print(name, "; ".join(f"{p.frequency:.3f} {p.name} ({p.amplitude:.1e})" for p in lines))
    peaks[name] = [p.name for p in lines]

# %% tags=["remove-cell"]
assert peaks["y"][:3] == ["1 f_s", "2 f_s", "3 f_s"]
assert "1 f_1" in peaks["w"]

# %% [markdown]
# ## Where the power goes
#
# The belt gives, friction takes, the beam gets very little. The ledger adds up.

# %%
ledger = energy_ledger(beam, beam.start(), t[t < 0.5 * END], integrator=METHOD)
gain = float(ledger.energy[-1] - ledger.energy[0])
for name in ("belt", "friction"):
    print(f"work of {name:>8}: {float(ledger[f'work_{name}'][-1]):+.3e}")
print(f"gain of energy   : {gain:+.3e}, left over {float(abs(ledger.imbalance).max()):.1e}")

plot.energy_account(ledger)
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.2), layout="constrained")
left.plot(t[late][:400], motion.friction_power[late][:400])
left.set(xlabel="time", title="$W_f$, friction: regular")
right.plot(t[late][:400], motion.beam_power[late][:400])
right.set(xlabel="time", title="$W_b$, mass to beam: irregular")
plt.show()

# %% tags=["remove-cell"]
assert float(abs(ledger.imbalance).max()) < 1e-6 * float(ledger.work_belt[-1])
assert float(motion.friction_power.max()) <= 0.0
assert np.all(motion.friction_power.values[stuck] == 0.0)

# %% [markdown]
# ## Is it chaotic?
#
# Neighbouring motions of a chaotic system part exponentially: its greatest Lyapunov exponent is
# positive. First a case where we know the answer, the logistic map at 4, with $\ln 2$.

# %%
known = lyapunov_spectrum_of_map(lambda z: 4.0 * z * (1.0 - z), 0.3, Segments(1, 4000, 50))
print(f"logistic map: {float(known.exponents[0]):.4f} ± {float(known.error[0]):.4f}, ln 2 = 0.6931")

# %% tags=["remove-cell"]
assert abs(float(known.exponents[0]) - np.log(2)) < 3 * float(known.error[0])

# %% [markdown]
# Now the beam. $x$ moves by itself, so we let only the mass's $y$ and the beam deviate; and the fifth
# mode has a node at the joint, so four modes are the same motion. The deviations go through every
# event with the saltation matrix. Where slip turns into stick one direction is lost at once: an
# exponent of $-\infty$.

# %%
SEGMENTS, WARM_UP, MODES = 1600, 40, 4

# %% tags=["remove-cell"]
if QUICK:
    SEGMENTS, WARM_UP, MODES = 40, 10, 2


# %%


@jax.jit
def exponents(v):
    """Spectrum of what the bounce drives, measured in units in which a free swing keeps its size."""
    system = JointedBeam.constructed(v, modes=MODES)
    one = jnp.ones(())
    scales = JointedBeamState(
        one, one, one, jnp.sqrt(system.k1 / system.m), jnp.ones(MODES), system.frequencies()
    )
    return lyapunov_spectrum(
        system, system.start(), Segments(0.5, SEGMENTS, warm_up=WARM_UP),
        components=("y", "vy", "q", "p"), scales=scales, integrator=METHOD,
    )  # fmt: skip


spectra = [exponents(v) for v in (SLOW, FAST)]
for v, found in zip((SLOW, FAST), spectra, strict=True):
    print(f"v = {v:g}: {found}")

# %% tags=["remove-cell"]
for found in spectra:
    values, errors = np.asarray(found.exponents), np.asarray(found.error)
    assert np.isneginf(values[-1])
    finite = np.isfinite(values)
    assert np.all(values[finite] < 3 * errors[finite] + 1e-3)

# %% [markdown]
# Eight exponents are the beam's: zero to the error, because nothing damps it and the joint is weak.
# The mass has the other two. At the slow speed they are clearly negative: stick-slip forgets its
# start. At the fast one the finite one is zero to its error: the motion looks irregular, a slow swing
# of the mass on its joint that never quite repeats, but it is **not chaotic**. No exponent is
# positive beyond its error.
#
# Why does the paper find positive ones? Its definition follows two motions that are never brought
# together again,
#
# $$\Lambda = \frac1t \ln\frac{\Delta(t)}{\Delta(0)}.$$
#
# Where no deviation grows exponentially it still may start by growing, and then $\Lambda$ sinks towards
# zero from above as $1/t$: its last value depends on when one stopped.

# %%
TIMES = 400
system = JointedBeam.constructed(FAST, modes=MODES)

# %% tags=["remove-cell"]
TIMES = 20 if QUICK else TIMES


# %%
@jax.jit
def printed_separation(y0):
    """Eq. (2.25) to the letter."""
    return two_trajectory_exponent(
        system, y0, Segments(1.0, TIMES), distance=1e-8, renormalise=False,
        integrator=METHOD,
    )  # fmt: skip


apart = printed_separation(system.start())
half = apart.running.shape[0] // 2
print(f"(2.25) after {float(apart.time[half]):.0f}: {float(apart.running[half]):+.4f}")
print(f"(2.25) after {float(apart.time[-1]):.0f}: {float(apart.running[-1]):+.4f}")
figure, axis = plt.subplots(figsize=(6, 3), layout="constrained")
axis.plot(apart.time, apart.running)
axis.axhline(0.0, color="0.6")
axis.set(xlabel="time", ylabel=r"$\Lambda$, Eq. (2.25)")
plt.show()

# %% tags=["remove-cell"]
assert bool(apart.successful)
