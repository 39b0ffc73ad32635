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
# # Your printer: from a log to a shaper
#
# A CoreXY printer rings behind every corner, and one of its belts may be looser than the other. Its
# firmware can shake the head through a range of frequencies while an accelerometer listens, and a
# plucked belt sounds. Here these records become stiffnesses and tensions with intervals, these a shaper
# that suits the whole bed, and that a print, simulated with all its friction.
#
# The printer is `desktop_printer()`, constructed from data of its parts. So that the answers are known,
# its records are made here: from a machine whose belt 2 is softer and whose belt 1 is looser than they
# should be, with the noise of a cheap accelerometer.

# %% tags=["remove-output"]
import jax
import matplotlib.pyplot as plt
import numpy as np

import corexy_jax as cx
import stickslip as ss
from corexy_jax import elastic
from stickslip.control import InputShaper

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
F0, F1 = 30.0, 110.0

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")
if QUICK:
    F0, F1 = 50.0, 95.0

# %% [markdown]
# ## The records

# %%
printer = elastic.desktop_printer()
sweep = elastic.resonance_sweep((1.0, 1.0), F0, F1, rate=40.0, acceleration_per_hz=0.06)
hidden_belts = elastic.Belts(printer.belts.frame, 1.8e4, 1.55e4, 3.5e-4)
hidden = cx.with_values(printer.parameters, {"P1": 14.0, "P2": 18.0, "mu_s": 0.018, "mu_k": 0.018})


def motors(path):
    return elastic.Stepper(path, printer.torque, printer.parameters.r, damping=1e-3)


rng = np.random.default_rng(1)
shaken = ss.WithBreaks(elastic.ElasticCoreXY(hidden, hidden_belts, motors(sweep)), sweep.breaks())
t = np.arange(int(3200 * (float(sweep.duration) + 0.05))) / 3200.0
saved = ss.SaveAt(ts=t, max_events=None)
integrator = ss.Integrator(max_steps=1_000_000)
motion = ss.simulate(
    shaken, 0.0, t[-1], shaken.start(shaken.system.at()), saveat=saved, integrator=integrator
)
felt = np.diff(np.stack([motion.outputs.y.y.v_x, motion.outputs.y.y.v_y]), axis=1) * 3200.0
felt += rng.normal(scale=0.1, size=felt.shape)

rho, span = 0.0084, 0.15  # kg/m of a belt of 6 mm, m of the span that is plucked
tones = []
for tension in (hidden.P1, hidden.P2):
    f = float(elastic.span_frequency(tension, rho, span))
    s = np.arange(3200) / 1600.0
    tones.append(np.exp(-4.0 * s) * np.cos(2 * np.pi * f * s) + 0.1 * rng.normal(size=s.size))

# %% [markdown]
# ## Tensions, by their tones
#
# No sweep tells a tension: as long as no span is slack, it moves no frequency of the machine. A free
# span is a string, and sounds by it.

# %%
plucks = [elastic.pluck_tone(s, tone, 50.0, 400.0) for tone in tones]
tensions = [float(elastic.span_tension(p.frequency, rho, span)) for p in plucks]
for k, (p, T) in enumerate(zip(plucks, tensions, strict=True)):
    print(
        f"belt {k + 1}: {p.frequency:.2f} Hz, {T:.2f} +- {T * 2 * 1.96 * p.error / p.frequency:.2f} N"
    )
loose = 1 - tensions[0] / tensions[1]
print(
    f"belt 1 is {100 * loose:.0f}% looser: tighten it until it sounds at {plucks[1].frequency:.1f} Hz"
)

# %% tags=["remove-cell"]
assert abs(tensions[0] - 14.0) < 0.1
assert abs(tensions[1] - 18.0) < 0.1

# %% [markdown]
# ## Stiffness, damping and friction, by the sweep

# %%
told = cx.with_values(printer.parameters, {"P1": tensions[0], "P2": tensions[1]})
known = elastic.ElasticCoreXY(told, printer.belts, motors(sweep))
found = elastic.fit_belts(known, elastic.HeadRecord(sweep, t[1:] - 0.5 / 3200.0, *felt))
for name in ("EA_1", "EA_2", "retardation", "mu"):
    print(
        f"{name}: {float(found.fit.values[name]):.4g} +- {1.96 * float(found.errors[name]):.2g} (95%)"
    )
print(f"not explained: {found.unexplained:.1%} of what the head felt")

# %% tags=["remove-cell"]
values = {name: float(value) for name, value in found.fit.values.items()}
assert abs(values["EA_1"] / 1.8e4 - 1) < 0.01
assert abs(values["EA_2"] / 1.55e4 - 1) < 0.01
assert abs(values["mu"] / 0.018 - 1) < 0.05
assert found.unexplained < 0.1

# %%
figure, axes = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, layout="constrained")
for k, axis in enumerate(axes):
    axis.plot(found.times[0], found.measured[0][:, k], color="0.6", lw=0.8, label="felt")
    axis.plot(found.times[0], found.computed[0][:, k], color="C0", lw=0.6, label="computed")
    axis.set_ylabel(f"along {'xy'[k]} [m/s²]")
axes[0].legend(frameon=False, ncols=2)
axes[1].set_xlabel("time [s]")
plt.show()

# %% [markdown]
# The head was shaken along the diagonal that turns motor 1 alone.
#
# ## A shaper for the whole bed
#
# Vibrations of the machine in closed form, at every place of the bed. A shaper is chosen by what it
# leaves where that is most, and by how long it takes.

# %%
belts = elastic.Belts(
    printer.belts.frame, *(float(found.fit.values[k]) for k in ("EA_1", "EA_2")), 3.5e-4
)
bed = np.linspace(-0.11, 0.11, 9)
holding = float(motors(sweep).stiffness)
map_of_bed = elastic.resonances(told, belts, bed[:, None], bed[None, :], holding=holding)
slow, fast = (map_of_bed.frequencies[..., k] for k in (0, 1))
print(
    f"along y {slow.min():.1f} to {slow.max():.1f} Hz, along x {fast.min():.1f} to {fast.max():.1f} Hz"
)
middle = [float(np.sqrt(row.min() * row.max())) for row in (fast, slow)]
for kind in ("ZV", "MZV", "EI", "2HUMP_EI"):
    left = [
        float(np.max(InputShaper(0.0, kind, 2 * np.pi * f, 0.05).residual(2 * np.pi * row, 0.05)))
        for f, row in zip(middle, (fast, slow), strict=True)
    ]
    print(f"{kind:8s} leaves at most {100 * left[0]:4.1f}% along x, {100 * left[1]:4.1f}% along y")

# %%
figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
for axis, row, word in zip(axes, (fast, slow), "xy", strict=True):
    drawn = axis.contourf(1e3 * bed, 1e3 * bed, row.T, 12)
    figure.colorbar(drawn, ax=axis, label="Hz")
    axis.set(title=f"along {word}", xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
plt.show()

# %% [markdown]
# ## A print
#
# A corner at 300 mm/s and 20 m/s², with all friction, without a shaper and with one for each axis: how
# far the head is to the side of the line behind the corner.

# %%
moves = elastic.read_gcode("G1 X40 F18000\nG1 Y40\n")
path = elastic.trajectory(moves.points, moves.speeds, acceleration=20.0, corner_speed=0.005)
shapers = elastic.AxisShapers(*(InputShaper(path, "EI", 2 * np.pi * f, 0.05) for f in middle))
machine = cx.with_values(told, {name: float(found.fit.values["mu"]) for name in ("mu_s", "mu_k")})
figure, axis = plt.subplots(figsize=(8, 3.2), layout="constrained")
rings = {}
for word, shaper in (("no shaper", None), ("EI", shapers)):
    drive = motors(path if shaper is None else shaper)
    run = ss.WithBreaks(elastic.ElasticCoreXY(machine, belts, drive), path.breaks(shaper))
    times = np.arange(0.0, float(path.duration) + 0.1, 5e-4)
    saved = ss.SaveAt(ts=times, max_events=None)
    head = ss.simulate(run, 0.0, times[-1], run.start(run.system.at()), saveat=saved).outputs.y.y
    side = 1e6 * (np.asarray(head.x) - 0.04)
    behind = (np.asarray(head.y) > 1e-3) & (np.asarray(head.y) < 0.039)
    rings[word] = float(np.ptp(side[behind]))
    left = jax.vmap(drive.margin)(times, (head.one / told.r, head.two / told.r))
    print(f"{word}: {rings[word]:.1f} um; motors keep {100 * np.min(left):.0f}% of their angle or more")
    axis.plot(1e3 * head.y[behind], side[behind], lw=0.9, label=word)
axis.set(xlabel="y behind the corner [mm]", ylabel="to the side [um]")
axis.legend(frameon=False)
plt.show()

# %% [markdown]
# ## What friction keeps
#
# Where a slow motion turns back, friction first unwinds the belts and winds them up the other way,
# while the head stays. No shaper helps against that; stiffer belts, less friction and stiffer motors
# do. Of the printer with both belts as they should be:

# %%
good = cx.with_values(machine, {"P1": 18.0, "P2": 18.0})
lost = elastic.lost_motion(good, printer.belts, holding=holding)
print(f"lost at a reversal: {1e6 * lost[0]:.1f} um along x, {1e6 * lost[1]:.1f} um along y")

# %% tags=["remove-cell"]
assert rings["EI"] < 0.5 * rings["no shaper"]
assert all(0.0 < float(a) < 1e-4 for a in lost)
plt.close("all")

# %% [markdown]
# With files of your own: `python -m experiments identify-printer --data LOG.csv` for the records,
# `python -m experiments corexy-print --set file=PART.gcode` for a print; see [Printers](printer.md).
