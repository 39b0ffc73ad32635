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
# # Periodic orbits through stick and slip
#
# A scan shows the attractors that simulations end on. The branch that connects them, stable or not, its
# folds, doublings and the points where a stick appears or vanishes need the periodic orbit itself:
# Newton's method on the return map, and continuation. The sequence of sticks and slips is found on the
# way, not given.
#
# The machine: a block on a belt, held by a spring and a dashpot, with friction that falls with the slip
# speed (Leine, Van Campen, De Kraker, Van den Steen, Nonlinear Dynamics 16, 1998).

# %% tags=["remove-output"]
import pathlib
import tempfile
from typing import Any, ClassVar

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss
from stickslip import plot
from stickslip.continuation import (
    Follow,
    OrbitGuess,
    continue_equilibrium,
    continue_orbit,
    continue_point,
    load_branch,
    orbit_guess,
    periodic_orbit,
    save_branch,
)
from stickslip.friction import HyperbolicWeakening
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import Motion

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
BOTH, STEP, POINTS = True, 0.04, 80  # both ways, in steps of so much, and at most so far

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")
if QUICK:
    BOTH, STEP, POINTS = False, 0.1, 4


# %%
class Block(AbstractMechanism):
    """Unit mass and spring, a dashpot, a belt."""

    damping: Any
    law: Any
    belt_speed: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1}}
    parameter_units: ClassVar = {"belt_speed": "m/s", "damping": "N s/m"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x - self.damping * v.x}

    def contacts(self, t, q, v, args):
        return [Contact(self.law, 1.0, self.belt_speed)]


block = Block(0.5, HyperbolicWeakening(1.0, 3.0), 0.6)

# %% [markdown]
# ## An orbit and its Floquet multipliers
#
# `orbit_guess` simulates until the motion has settled and looks for its return; `periodic_orbit` makes
# an orbit of it to twelve digits. The multiplier is exactly zero: sticking forgets where the block came
# from.

# %%
guess = orbit_guess(block, block.state(x=1.0), transient=50.0, max_period=12.0)
orbit = periodic_orbit(block, guess)
print(orbit)
print(orbit.events.to_dataframe(block)[["t", "mode_after"]])

# %% tags=["remove-cell"]
assert bool(orbit.successful)
assert bool(orbit.stable)
assert orbit.multipliers.tolist() == [0.0]

# %% [markdown]
# A guess by hand does as well, if it is near enough; what is found is simulated once more, and `result`
# says in words what became of it.

# %%
by_hand = periodic_orbit(block, OrbitGuess(block.state(x=0.4, v_x=-0.65), 6.5))
print(by_hand)
nothing = periodic_orbit(block, OrbitGuess(block.state(x=0.3571), 3.0))
print(nothing)

# %% tags=["remove-cell"]
assert abs(float(by_hand.period - orbit.period)) < 1e-9
assert not bool(nothing.successful)

# %% [markdown]
# ## The branch over the speed of the belt
#
# The stick-slip orbit ends where its stick has no length left. There it meets the unstable cycle of
# pure slip: a discontinuous fold. The branch turns, and the cycle is followed down to the Hopf point
# of the equilibrium, whose speed is known, $v_H = (\sqrt{3/c} - 1)/3$.

# %%
branch = continue_orbit(
    block, orbit, "belt_speed", (0.4, 0.8), follow=Follow(step=0.04, both=BOTH, max_points=60)
)
print(branch)
(fold,) = branch["GR"]
hopf = (np.sqrt(3 / 0.5) - 1) / 3

# %% tags=["remove-cell"]
assert abs(fold.value - 0.6721494669) < 1e-8
assert abs(branch["EP"][-1].value - hopf) < 1e-6

# %%
axis = plot.branch(branch, "x")
axis.axvline(hopf, color="0.8", zorder=0)
axis.set_title("Discontinuous fold of a block on a belt")
axis.legend(frameon=False)
plt.show()

# %% [markdown]
# The orbit at a label, with its stick in grey, and the multipliers of the branch about the unit circle:

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4))
plot.orbit(branch, fold, "x", "v_x", ax=left)
plot.multipliers(branch, ax=right)
plt.show()

# %% [markdown]
# As a dataset, for all that comes after:

# %%
print(branch.to_dataset())

# %% [markdown]
# ## What the labels mean
#
# | label | point |
# |---|---|
# | `LP` | fold: the parameter turns |
# | `PD` | period doubling, a multiplier of -1; to `continue_orbit` it starts the doubled branch |
# | `NS` | a conjugate pair of multipliers on the unit circle |
# | `BP` | two branches cross |
# | `GR` | an event appears or vanishes: grazing, a stick that begins or ends |
# | `SQ` | another change of the sequence of modes |
# | `HB` | Hopf point: the orbit has shrunk to an equilibrium |
# | `UZ` | at one of the `values` of the parameter that were asked for |
# | `EP` | end of the branch, with the reason |
#
# `special.system` is the system with the parameter at that value. A period that grows without bound is
# the end `homoclinic`, with the value that the parameter tends to.
#
# From `PD` and `BP` points `continue_orbit` follows the branch that begins there. Of a `GR` point
# `words` name the sliding bifurcation:

# %%
print(fold)

# %% tags=["remove-cell"]
assert fold.words.startswith("grazing-sliding")

# %% [markdown]
# ## The fold over two parameters
#
# `continue_point` follows such a point, here over the speed of the belt and the damping: left of the
# curve the block sticks and slips, right of it it comes to rest. `curve.ends` say where and why it
# ends: at a bound, at a point of codimension two by its name, or where the orbit grazes. Resonances
# that a curve of `NS` points passes, and values asked for, are `curve.specials`.

# %%
curve = continue_point(
    block,
    fold,
    ("belt_speed", "damping"),
    ((0.5, 0.9), (0.4, 0.6)),
    follow=Follow(step=0.15, both=BOTH),
)
print(curve)
plot.branch(curve).set_title("Discontinuous fold over speed and damping")
plt.show()

# %% [markdown]
# `python -m experiments block-map` lays such curves over a map of simulated lanes: of the block with
# the pendulum, over a stiffness and the speed of the belt. Its curve of doublings ends at a point with
# two multipliers of -1 (`R2`).

# %% [markdown]
# ## Equilibria, and the orbits that are born at a Hopf point
#
# The same cycle from its other end: `continue_equilibrium` follows the rest in slip and locates its
# Hopf point; from there `continue_orbit` follows the orbits that are born, up to the fold.

# %%
slip = block.mode_names.index("slip backward")
rest = continue_equilibrium(
    block, block.state(x=0.35), "belt_speed", (0.3, 0.9), mode0=slip, follow=Follow(step=0.02)
)
print(rest)
(point,) = rest["HB"]
born = continue_orbit(
    block, point, "belt_speed", (0.4, 0.8), follow=Follow(step=0.2, max_points=POINTS)
)
print(born)

# %% tags=["remove-cell"]
assert abs(point.value - hopf) < 1e-10
assert QUICK or abs(born["GR"][0].value - fold.value) < 1e-8

# %% [markdown]
# ## A load that jumps
#
# Under a square wave the field jumps twice a period. `WithPeriodicBreaks` says when, by functions of
# the system, so that a branch over the frequency takes the breaks along; orbits have derivatives.


# %%
class Switched(ss.AbstractSmoothSystem):
    """Unit mass, spring and dashpot, pushed to and fro."""

    frequency: Any

    def vector_field(self, t, y, mode, args):
        push = jnp.sign(jnp.sin(self.frequency * t))
        return Motion(x=y.v, v=push - 0.2 * y.v - y.x)


def breaks(system):
    return jnp.pi / system.frequency * jnp.arange(2.0)


def cycle(system):
    return 2 * jnp.pi / system.frequency


switched = ss.WithPeriodicBreaks(Switched(0.45), breaks, cycle)
start = OrbitGuess(Motion(0.0, 1.0), float(cycle(switched.system)))
driven = continue_orbit(
    switched,
    start,
    "system__frequency",
    (0.25, 0.6),
    forcing_period=lambda system: cycle(system.system),
    follow=Follow(step=STEP),
)
print(driven)
axis = plot.branch(driven, "x")
axis.set_title("Resonance with the third harmonic of a square wave")
plt.show()

# %% tags=["remove-cell"]
assert np.asarray(driven.orbits.stable).all()

# %% [markdown]
# ## Where a conserved quantity makes a family of every orbit
#
# Newton's method needs a single orbit. A part of a machine that conserves its energy and feels nothing
# of the rest, as the bouncing mass of the jointed beam, has a family of them, one for each energy: two
# more multipliers are 1, and a branch over a parameter has no direction. The way out is to take the
# motion of that part as a load that is known, with `forcing_period`.
# `python -m experiments beam-branches` does so, and finds where and how its orbit of stick-slip ends:
# see [What the results say](results.md).

# %% [markdown]
# ## Branches as files
#
# A branch is written whole or not at all, as a netCDF file that `xarray` reads, and comes back to the
# last bit; from an end that is a bound or `max_points` it goes on.

# %%
with tempfile.TemporaryDirectory() as folder:
    path = save_branch(branch, pathlib.Path(folder) / "branch.nc")
    again = load_branch(path, block, block.state(x=0.0))

# %% tags=["remove-cell"]
assert repr(again) == repr(branch)
assert (again.values == branch.values).all()
