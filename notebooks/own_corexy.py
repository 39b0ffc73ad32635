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
# # Measure your own CoreXY: belt tensions from a log of one second
#
# A log of voltages and encoders goes in; out come the tensions of both belts, with an interval, and a
# verdict whether these data can show them at all. On the way: how to move the machine so that they
# can, and what to do if the verdict is no.

# %% tags=["remove-output"]
import contextlib
import io
import json
import pathlib
import tempfile

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import corexy_jax as cx
import stickslip as ss
from experiments.__main__ import main
from stickslip.identification import Observed, Problem, Record, Unknown, profile, report, sensitivity

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")

# %% [markdown]
# ## What to measure
#
# | what | how |
# |---|---|
# | time | stamps in seconds, 100 to 500 a second; in even steps or not |
# | `v1`, `v2` | voltages of the motors, held from one stamp until they change |
# | `theta_1`, `theta_2` | encoders of the motors; their speeds, `omega_1` and `omega_2`, will do |
# | `x`, `y` | position of the collar, if you can; without it slip of a belt shows in the motors alone |
# | masses, radii, `K_t`, `K_e`, `R` | a balance, a calliper and the data sheet of the motors |
#
# - **Begin at rest**, some ten stamps with no voltage: places count from there.
# - **What to move, how fast.** Jumps of the voltage, some below what the belts hold and some above,
#   both motors in both directions. A belt that never slips does not show its friction, and one that
#   always slips hides the ground's. Best are voltages in between that bring contacts at rest to the
#   limit: `python -m experiments corexy-input-design` designs them; how much they show can be
#   computed before anything is measured, as below.
# - **How long.** Errors fall with the root of the number of samples, and by more when something
#   breaks loose once more. For the tensions alone a second is enough.
#
# `python -m experiments identify-corexy --template LOG.csv` writes such a log, one second at 200 Hz,
# and beside it `LOG-machine.json` with what is known of the machine: replace both by your own.
# Tensions stand in it as 30 N and 20 N, and are a guess.

# %%
with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
    path = pathlib.Path(folder, "log.csv")
    main(["identify-corexy", "--template", str(path)])
    log = pd.read_csv(path)
    known = json.loads(path.with_name("log-machine.json").read_text(encoding="utf-8"))
log.head()

# %% [markdown]
# ## The question
#
# Voltages jump where the log says so, and the engine lands on each jump. Everything measured has a
# standard deviation: read it off the part at rest.

# %%
NOISE = {"theta_1": (1e-3, "rad"), "theta_2": (1e-3, "rad"), "x": (1e-4, "m"), "y": (1e-4, "m")}
TRUTH = {"P1": 20.0, "P2": 30.0}  # what the template was made with
TENSIONS = {
    "P1": Unknown(known["P1"], bounds=(0.0, None), unit="N"),
    "P2": Unknown(known["P2"], bounds=(0.0, None), unit="N"),
}


def voltage_of(log):
    """Voltages held until they change."""
    volts = log[["v1", "v2"]].to_numpy()
    new = np.flatnonzero(np.any(np.diff(volts, axis=0) != 0.0, axis=1)) + 1
    rows = np.concatenate([[0], new])
    return cx.PiecewiseStep(log["time"].to_numpy()[rows], volts[rows, 0], volts[rows, 1])


def seen(name):
    return lambda t, y, machine: getattr(y, name)


def problem_of(log, unknowns):
    voltage = voltage_of(log)
    machine = cx.CoreXYParameters(**known)

    def system(values, inputs):
        return cx.CoreXY(cx.with_values(machine, {name: values[name] for name in unknowns}), voltage)

    return Problem(
        system=system,
        initial_state=lambda values, inputs: system(values, inputs).state(),
        unknowns=unknowns,
        observed={name: Observed(seen(name), sd, unit) for name, (sd, unit) in NOISE.items()},
        records=Record(log["time"].to_numpy(), {name: log[name].to_numpy() for name in NOISE}),
        integrator=ss.Integrator("tsit5", ss.AdaptiveStep(1e-7, 1e-7)),
    )


# %% [markdown]
# ## What the log will show, before it is measured
#
# The derivatives of what would be seen, at the guess, say how large the standard errors will be. Ask
# for parts of the record, for half of the voltage, for one motor alone, before you go to the bench.

# %%
problem = problem_of(log, TENSIONS)
guess = {name: known[name] for name in TENSIONS}
matrix = np.asarray(sensitivity(problem.residual_function, guess).matrix)
times = np.tile(log["time"].to_numpy(), len(NOISE))
foreseen = {}
for end in (0.25, 0.5, 0.75, 1.0):
    part = matrix[times <= end]
    foreseen[f"{end} s"] = 100.0 * np.sqrt(np.diag(np.linalg.inv(part.T @ part)))
pd.DataFrame(foreseen, ["P1 [%]", "P2 [%]"]).round(4)

# %% [markdown]
# ## The fit
#
# From a guess that is wrong by half. A reduced chi squared near 1 says that the fit has come down to
# the noise. If it has not, try other starts (`problem.fit(starts=16)`): where a belt begins to slip,
# the sum of squares has more than one minimum.

# %%
fit = problem.fit()
print(fit)

# %% tags=["remove-cell"]
assert float(fit.reduced_chi_squared) < 1.25
for name, error in fit.standard_errors().items():
    assert abs(float(fit.values[name]) - TRUTH[name]) < 4.0 * float(error)

# %% [markdown]
# ## The interval, the verdict, and whether the model is the machine
#
# The profile moves one tension while the other is fitted anew. What the model lacks shows in
# residuals that are not white: do not trust an interval of a model that is not the machine.

# %%
found = profile(problem.residual_function, fit)
series = {name: np.asarray(row) for name, (_, row) in problem.parts(fit.data_residual)["0"].items()}
told = report(fit, profile=found, series=series)
print(told)
told.plot()

# %% tags=["remove-cell"]
assert set(found.verdicts.values()) == {"identifiable"}

# %% [markdown]
# ## If the verdict is no
#
# Suppose that nobody knows the kinetic friction of belt 1 on its pulley either. Under these voltages
# no belt slips, so this record cannot show it however long it is: its standard error is infinite, and
# a profile would call it *structurally not identifiable*. Under twice the voltage belt 1 slips.

# %%
BELT = {"mu_1k_b": Unknown(known["mu_1k_b"], bounds=(0.0, None))}
values = {name: float(value) for name, value in fit.values.items()} | {"mu_1k_b": known["mu_1k_b"]}
plans = {"as logged": 1.0, "twice the voltage": 2.0}

# %% tags=["remove-cell"]
plans = {"as logged": 1.0} if QUICK else plans

# %%
errors = {}
for name, factor in plans.items():
    planned = log.assign(v1=factor * log["v1"], v2=factor * log["v2"])
    found = sensitivity(problem_of(planned, TENSIONS | BELT).residual_function, values)
    errors[name] = {k: 100.0 * float(e) for k, e in found.relative_standard_errors().items()}
print(pd.DataFrame(errors).round(4), "\nstandard errors [%]")

# %% tags=["remove-cell"]
assert np.isinf(errors["as logged"]["mu_1k_b"])
assert QUICK or errors["twice the voltage"]["mu_1k_b"] < 1.0

# %% [markdown]
# What helps, in this order:
#
# 1. **Move it otherwise.** *Structurally* or *practically not identifiable* often means that the
#    motion shows too little of it: pulses that make that belt slip, ramps through rest for friction
#    on the ground. Compute the table above for what you plan.
# 2. **Know more.** A value from a balance or a spring scale is a prior, `Unknown(..., prior=Normal(0.2,
#    0.01))` with its error, or a number in the machine's file.
# 3. **Ask for the combination.** If the motion depends on the product of two unknowns
#    only, no record tells them apart; `report(fit).hidden` names the product, and it may be all you
#    need.
# 4. **Not decided** means that the sum of squares jumps, where one slip more begins, or that the
#    search ran out of steps (`profile(..., max_steps=5000)`): take gentler or rougher voltages, so
#    that no belt just slips or just does not.
#
# If the reduced chi squared stays far above 1 whatever the start, or residuals are not white, the
# machine is not the model: look at units and signs first, then at where in the record the residuals
# grow.

# %%
simulated = problem.simulate({name: float(v) for name, v in fit.values.items()})
figure, axes = plt.subplots(2, 1, figsize=(8, 4), layout="constrained", sharex=True)
for axis, names, scale, unit in (
    (axes[0], ("theta_1", "theta_2"), 1, "rad"),
    (axes[1], "xy", 1e3, "mm"),
):
    for name in names:
        axis.plot(log["time"], scale * log[name], ".", markersize=2)
        axis.plot(simulated.times, scale * np.asarray(simulated.observed[name]), lw=1, label=name)
    axis.set_ylabel(f"[{unit}]")
    axis.legend()
axes[1].set_xlabel("time [s]")
plt.show()

# %% [markdown]
# The same from the command line, with the report printed, which belt to tighten by how much, and a
# picture kept: `python -m experiments
# identify-corexy --data LOG.csv --set machine=LOG-machine.json --set profile=true`. Other names and
# units of columns: `--set columns=time=t,v1=u_1 --set units=time=ms,theta_1=count --set
# counts_per_turn=4000`; other unknowns: `--set unknowns=P1,P2,mu_k`; sensors as noisy as the report
# says they are: `--set noise=theta_1=0.002,theta_2=0.002`, in their SI units; further logs that are not
# fitted, to see whether the machine explains them: `--set scored=SECOND.csv`. Columns x and y may be
# missing, and rows too: only not where a voltage jumps. The machine that was found is kept beside the
# picture, for `corexy-plan` and `animate-corexy --set plan=...` with the same `--set machine=`.
