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
# # From a raw log to friction with an interval and a verdict
#
# A sledge on a spring is pushed by a known force, and an encoder writes down where it is. What is its
# friction, how far can the number be trusted, and what can these data not show?

# %% tags=["remove-output"]
from typing import Any, ClassVar

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import stickslip as ss
from stickslip import plot
from stickslip.friction import Coulomb
from stickslip.identification import Observed, Problem, Record, Unknown, profile, report
from stickslip.mechanism import AbstractMechanism, Contact

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")


# %%
class Sledge(AbstractMechanism):
    """Mass and spring on a dry guide, pushed by `push(t)` [N]."""

    mass: Any
    stiffness: Any
    friction: Any
    normal: Any
    push: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"guide": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": self.push(t) - self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        return {"guide": Contact(Coulomb(self.friction, self.friction), self.normal)}


# %% [markdown]
# ## The log
#
# Here it is made up, with values that the rest of the page does not know: 1.2 kg, 40 N/m, a
# coefficient of 0.3 under 9 N; an encoder with an error of 0.5 mm that was silent for half a second and
# lost two samples more. The force was sampled without a gap and is read as straight lines between the
# samples: what pushes the sledge must be known throughout.

# %%
TRUTH = {"mass": 1.2, "stiffness": 40.0, "friction": 0.3}
SD = 5e-4  # of the encoder [m]
rng = np.random.default_rng(3)
END = 8.0  # s

# %% tags=["remove-cell"]
END = 3.0 if QUICK else END

# %%
times = np.arange(0.0, END, 0.02)
log = pd.DataFrame({"time": times, "push": 6.0 * np.sin(3.0 * times) + 3.0 * np.sin(7.3 * times)})
log["position"] = 0.0


def system(values, inputs):
    return Sledge(values["mass"], values["stiffness"], values["friction"], 9.0, inputs["push"])


def problem_of(log, system=system, **unknowns):
    """The question that is asked of a log."""
    given = {
        "mass": Unknown(1.0, unit="kg"),
        "stiffness": Unknown(30.0, bounds=(1.0, 200.0), unit="N/m"),
        "friction": Unknown(0.2, bounds=(0.0, None)),
    }
    record = Record.from_table(
        log, values=["position"], inputs=["push"], interpolation="linear", missing="nan"
    )
    observed = {"position": Observed(lambda t, y, sledge: y.x, SD, "m")}
    return Problem(system, lambda v, i: system(v, i).state(), {**given, **unknowns}, observed, record)


bench = problem_of(log).simulate(TRUTH)
log["position"] = np.asarray(bench.observed["position"]) + SD * rng.standard_normal(times.size)
log.loc[(times > 1.0) & (times < 1.5), "position"] = np.nan
log.loc[[30, 90], "position"] = np.nan
log.head()

# %% [markdown]
# ## The fit
#
# Unknowns have a start and, where they are known, bounds and a unit. The motion is simulated with its
# sticks and slips, the derivatives are exact through them, and Levenberg-Marquardt does the rest.

# %%
problem = problem_of(log)
fit = problem.fit()
print(fit)

# %% tags=["remove-cell"]
assert bool(fit.successful)
for name, error in fit.standard_errors().items():
    assert abs(float(fit.values[name]) - TRUTH[name]) < 4.0 * float(error)

# %% [markdown]
# ## How far to trust it
#
# The Wald interval takes the problem for linear. The profile does not: one unknown is moved while the
# others are fitted anew, until the misfit has grown by what the level allows. The verdict says whether
# there is an end on both sides. Are the residuals white, nothing that the model lacks shows in them.

# %%
found = profile(problem.residual_function, fit)
parts = problem.parts(fit.data_residual)["0"]
solution = problem.simulate({name: float(v) for name, v in fit.values.items()}).solution
told = report(
    fit, profile=found, series={"position": np.asarray(parts["position"][1])}, runs={"log": solution}
)
print(told)
told.plot()

# %% tags=["remove-cell"]
assert set(found.verdicts.values()) == {"identifiable"}

# %% [markdown]
# ## If the verdict is no
#
# Friction is a coefficient times a normal force, and the motion sees the product only. If you ask
# for both, the report says so by name, and names the product that the data do see.

# %%
both = problem_of(
    log,
    system=lambda v, i: Sledge(v["mass"], v["stiffness"], v["friction"], v["normal"], i["push"]),
    normal=Unknown(8.0, bounds=(0.0, None), unit="N"),
)
blind = both.fit()
verdicts = profile(both.residual_function, blind, ["friction", "normal"]).verdicts
print(report(blind).hidden)
product = float(blind.values["friction"] * blind.values["normal"])

# %% tags=["remove-cell"]
assert set(verdicts.values()) == {"structurally not identifiable"}
assert abs(product - 0.3 * 9.0) < 0.02

# %% [markdown]
# Three ways out: **weigh the sledge**, and `normal` is a known number, as above; **ask for the
# product**, one unknown in newtons; or **measure something else** that separates the two, such as a
# record under a second load. If an unknown is only *practically* not identifiable, there is too little
# of it in this record: a longer one, a push that moves the sledge faster or turns it more often, or a
# prior (`Unknown(..., prior=Normal(mean, sd))`) from a measurement of its own.

# %%
plot.fit(fit, problem)
plt.show()
