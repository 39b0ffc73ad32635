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
# # When does my brake squeal?
#
# Complex eigenvalues say from which friction on steady sliding is unstable. A brake may squeal long
# before, if something pushes it far enough: below the border of the eigenvalues there is a region in
# which it slides in silence and squeals, side by side. Here both borders are computed, and how hard the
# push must be.
#
# The machine is the minimal model of mode coupling (N. Hoffmann, M. Fischer, R. Allgaier, L. Gaul,
# Mechanics Research Communications 29, 2002): a mass on a belt, held by two springs at 30° and 150° to
# it and pressed on it through the stiffness of the contact, whose force is the normal force. The
# numbers are ours: 1 kg, 1.6, 1.2 and 1 N/m, 1 N and a belt of 0.6 m/s. In its linear part only ratios
# count.

# %% tags=["remove-output"]
from typing import Any, ClassVar

import matplotlib.pyplot as plt
import numpy as np
import scipy.optimize

import stickslip as ss
from stickslip import plot
from stickslip.basin import Settle, basins_over, border_motion
from stickslip.continuation import Follow, continue_equilibrium, continue_orbit, continue_point
from stickslip.friction import Stribeck
from stickslip.mechanism import AbstractMechanism, Contact

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
RATIOS = np.geomspace(0.2, 4.0, 24)  # of damping
MU, SHARES = 0.33, (0.28, 0.29, 0.30, 0.31, 0.33, 0.35)  # frictions that are looked at
CELLS, LONG, FAR, BORDERS = 32, 1000.0, 60, 2  # of a map, its duration [s], of a curve, of basins

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")
if QUICK:
    RATIOS, SHARES, CELLS, LONG, FAR, BORDERS = np.geomspace(0.2, 4.0, 4), (MU,), 8, 400.0, 1, 0

# %%
slopes = np.deg2rad([30.0, 150.0])
ways = np.stack([np.cos(slopes), np.sin(slopes)])  # of the springs, along the belt and towards it
(KXX, KXY), (_, KYY) = ways * np.array([1.6, 1.2]) @ ways.T
CONTACT, BELT, WIDTH = 1.0, 0.6, 0.2  # [N/m], [m/s], and the speed over which friction falls


class Brake(AbstractMechanism):
    """A mass on a belt, which lifts off where the normal force is used up."""

    mu: Any = 0.2  # of fast sliding
    drop: Any = 0.3  # friction at rest is greater by this part
    damping: Any = 0.05  # along the belt [N s/m]
    ratio: Any = 1.0  # damping towards the belt by that along it
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1}}
    opening: ClassVar = ("belt",)

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {
            "x": -KXX * q.x - KXY * q.y - self.damping * v.x,
            "y": 1.0 - KXY * q.x - KYY * q.y - self.ratio * self.damping * v.y,
        }

    def contacts(self, t, q, v, args):
        law = Stribeck((1.0 + self.drop) * self.mu, self.mu, WIDTH, exponent=1)
        return {"belt": Contact(law, 1.0 + CONTACT * q.y, BELT, normal_direction={"y": -1})}


SLIDES = list(Brake().mode_names).index("slip backward")  # slower than the belt

# %% [markdown]
# ## Two frequencies that meet
#
# Steady sliding is an equilibrium of the mode in which the block slips. At first without damping, and
# with friction that does not fall: $\mu$ times the stiffness of the contact makes the stiffness matrix
# unsymmetric, two frequencies come together, and from there on one motion grows and the other one
# decays. The squares of the frequencies are the roots of a quadratic equation. They meet where
#
# $$\mu_c = \frac{k_{xy}}{k_3} + \frac{(k_{xx} - k_{yy} - k_3)^2}{4\,k_{xy}k_3}.$$
#
# A zero that one is interested in is located as any other special point: here that of the discriminant.


# %%
def sliding(brake, **options):
    """Steady sliding over the friction, and its eigenvalues."""
    follow = Follow(step=0.05, **options)
    return continue_equilibrium(brake, brake.state(), "mu", (0.05, 0.6), mode0=SLIDES, follow=follow)


def discriminant(rest):
    squares = np.sort_complex(rest.eigenvalues**2)
    return np.real((squares[-1] - squares[0]) ** 2)


half = (KXX - KYY - CONTACT) / 2
meet = KXY / CONTACT + half**2 / (KXY * CONTACT)
plain = sliding(Brake(drop=0.0, damping=0.0), tests={"meet": discriminant})
(flutter,) = plain["meet"]
print(f"the frequencies meet at {flutter.value:.15f}, in closed form {meet:.15f}")

# %% tags=["remove-cell"]
assert abs(flutter.value - meet) < 1e-13

# %%
damped = sliding(Brake())
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
for rest, look, label in ((plain, "0.6", "not damped, constant"), (damped, "C0", "damped, falling")):
    left.plot(rest.values, np.abs(rest.orbits.eigenvalues.imag) / (2 * np.pi), ".", color=look)
    right.plot(rest.values, rest.orbits.eigenvalues.real, ".", color=look)
    right.plot([], [], ".", color=look, label=f"{label} friction")
left.set(xlabel="friction [1]", ylabel="frequency [Hz]", ylim=(0.17, 0.25))
right.set(xlabel="friction [1]", ylabel="growth [1/s]")
right.legend(frameon=False)
plt.show()

# %% [markdown]
# With damping they only come near each other. Steady sliding loses its stability at a Hopf point,
# `HB`, where a pair passes the imaginary axis.
#
# ## More damping, earlier squeal
#
# The Hopf point over the damping towards the belt, with that along the belt held: a loop, since
# `continue_point` follows points of orbits only. Beside it stands the criterion of Routh and Hurwitz:
# of $s^4 + a_1 s^3 + a_2 s^2 + a_3 s + a_4$ a pair is on the axis where
# $a_1 a_2 a_3 = a_3^2 + a_1^2 a_4$. Friction that falls, with the slope $\mu'$ at the speed of the
# belt, takes $-\mu' N$ from the damping along it.


# %%
def hurwitz(mu, ratio, drop, damping=0.05):
    decay = np.exp(-BELT / WIDTH)
    friction = mu * (1.0 + drop * decay)
    k_xy, k_yy = KXY - friction * CONTACT, KYY + CONTACT
    determinant = KXX * k_yy - k_xy * KXY
    load = 1.0 - CONTACT * KXY * friction / determinant  # of steady sliding
    c_x, c_y = damping - mu * drop / WIDTH * decay * load, ratio * damping
    a_1, a_2, a_3 = c_x + c_y, KXX + k_yy + c_x * c_y, c_x * k_yy + c_y * KXX
    return a_1 * a_2 * a_3 - a_3**2 - a_1**2 * determinant


hopf, off = {}, []
for drop in (0.0, 0.3):
    points = [sliding(Brake(ratio=ratio, drop=drop))["HB"][0].value for ratio in RATIOS]
    for value, ratio in zip(points, RATIOS, strict=True):
        known = scipy.optimize.brentq(hurwitz, value - 0.01, value + 0.01, (ratio, drop), xtol=1e-15)
        off.append(abs(value - known))
    hopf[drop] = np.array(points)
print(f"{len(off)} Hopf points, at most {max(off):.0e} from the criterion of Routh and Hurwitz")

# %% tags=["remove-cell"]
assert max(off) < 1e-9
assert hopf[0.3][-1] < 0.9 * hopf[0.3].max()  # the more is damped, the earlier it squeals

# %%
ratios = np.linspace(0.0, 4.0, 201)
uneven = (1.0 - ratios) / (1.0 + ratios)
figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
axis.axvline(meet, color="0.8")
little = KXY / CONTACT + half**2 / (KXY * CONTACT) * (1.0 - uneven**2)
axis.plot(little, ratios, ":", color="0.4", label="constant friction, hardly damped")
axis.plot(hopf[0.0], RATIOS, "C1", label="constant friction")
axis.plot(hopf[0.3], RATIOS, "C0", label="falling friction")
axis.set(xlabel="friction at the Hopf point [1]", ylabel="ratio of damping [1]")
axis.legend(frameon=False)
plt.show()

# %% [markdown]
# Where both directions are damped alike and hardly, sliding is stable up to where the frequencies meet.
# Damp one of them more and it is not: the dotted line, $\mu = \mu_c - \frac{(k_{xx} - k_{yy} -
# k_3)^2}{4\,k_{xy}k_3}\left(\frac{1 - r}{1 + r}\right)^2$ for a damping ratio $r$, does not depend on
# how small the damping is. Friction that falls is a damping that is missing in one direction: it bends
# the line, and moves its best ratio from 1.5 to below 0.5.
#
# ## The squeal, with its events
#
# The cycles that are born at the Hopf point, followed wherever they go. No mode is given: where the
# block sticks, lifts off or overtakes the belt is found on the way.

# %%
(point,) = damped["HB"]
branch = continue_orbit(
    Brake(), point, "mu", (0.1, 0.6), follow=Follow(step=0.1, max_points=60, values=(MU,))
)
print(branch)

# %%
figure, axis = plt.subplots(figsize=(9, 5), layout="constrained")
plot.branch(branch, "y", lowest=True, ax=axis)
plot.branch(damped, "y", ax=axis)
axis.axhline(-1.0 / CONTACT, color="0.8", zorder=0)
axis.set(xlabel="friction [1]", ylabel="greatest and least y [m]")
plt.show()

# %% [markdown]
# The cycle is unstable, and goes to smaller friction (the Hopf point is subcritical). It grows until it
# just touches the speed of the belt (`GR`): there it meets the first squeal, in which the block sticks
# once a period. That is its least friction, 39% below the Hopf point. At one fold, `LP`, this squeal
# ends, just short of the Hopf point; at the other one a louder squeal begins: the block lifts off
# (below the grey line), comes down, overtakes the belt and sticks.
#
# At a friction in between there are two squeals, and below each an unstable cycle: what it takes to get
# there.

# %%
for at in branch["UZ"]:
    orbit = at.orbit
    modes = [Brake().mode_names[m] for m in orbit.events.mode_after[: orbit.events.count]]
    print(
        f"{1 / orbit.period:.6f} Hz, {'stable' if orbit.stable else 'unstable'},",
        f"multiplier {orbit.multipliers[0]:.4f}, {', '.join(modes) or 'slips all the time'}",
    )

# %% tags=["remove-cell"]
fold = branch["GR"][0]
assert fold.words.startswith("grazing-sliding")
assert abs(fold.value - 0.2306178107) < 1e-7  # by SciPy: the slip that touches the belt's speed
assert [bool(at.orbit.stable) for at in branch["UZ"]] == [False, True, False, True]

# %%
figure, axis = plt.subplots(figsize=(6, 5), layout="constrained")
for at, color in zip(branch["UZ"], ("0.6", "C0", "0.6", "C3"), strict=True):
    plot.orbit(branch, at, "x", "y", ax=axis, color=color)
axis.get_legend().remove()
axis.set_title(f"Four cycles at a friction of {MU}; broad: the block sticks", fontsize="medium")
plt.show()

# %% [markdown]
# ## Where it slides and squeals
#
# `continue_point` follows the fold over friction and damping. Left of it neither squeal is there, right
# of the Hopf curve the brake squeals by itself. In between it depends on what happened.

# %%
bounds = ((0.1, 0.6), (RATIOS[0], RATIOS[-1]))
edge = continue_point(
    Brake(), branch["GR"][0], ("mu", "ratio"), bounds, follow=Follow(step=0.2, max_points=FAR)
)
print(edge)

# %%
axis = plot.branch(edge)
axis.plot(hopf[0.3], RATIOS, "C3")
axis.text(0.13, 2.0, "silent")
axis.text(0.25, 2.0, "silent or squeals")
axis.text(0.42, 2.0, "squeals")
axis.set(xlim=(0.1, 0.5), xlabel="friction [1]", ylabel="ratio of damping [1]")
plt.show()

# %% [markdown]
# From 0.5 on more damping towards the belt moves both borders to the left: it helps against neither.
#
# ## How hard a push
#
# All starts in a plane: the block is where it slides steadily, and is pushed towards the belt or away
# from it, at any speed. `basins_over` says which of the motions follows, at several frictions; `basins`
# does at one.

# %%
(steady,) = sliding(Brake(), values=(MU,))["UZ"]
box, settle = {"y": (-1.2, 1.2), "v_y": (-1.6, 1.6)}, Settle(LONG)
over = basins_over(Brake(), "mu", SHARES, steady.orbit.y, box, settle, points=(CELLS, CELLS))
print(over)
found, brake = over.maps[list(SHARES).index(MU)], steady.system
print(found)

# %% tags=["remove-cell"]
assert len(found.attractors) == 3
assert set(found.code.ravel()) == {0, 1, 2}

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
plot.basins(found, brake, ax=left).set_title(f"a friction of {MU}")
plot.shares(over, ax=right).set_xlabel("friction [1]")
plt.show()

# %% [markdown]
# Silence keeps the middle, the louder squeal has all that is pushed hard. What is left to silence is
# gone at the Hopf point, but small long before. `smallest_kick` of [basins](basins.md) is the least
# push that ends it.
#
# Between two basins lies an unstable motion. `border_motion` finds it from the map alone, and it is the
# cycle of the branch. All motions of the border come to it. Its period is what one hears while the
# brake "makes up its mind", and its multiplier says how long that takes.

# %%
silent = next(a for a in found.attractors if a.kind == "fixed point")
orbits = (a for a in found.attractors if a.kind == "orbit")
soft, loud = sorted(orbits, key=lambda a: a.motion.highest.y)
first, _, second, _ = branch["UZ"]
off = [0.0]
for one, other, known in ((silent, soft, first), (soft, loud, second))[:BORDERS]:
    border = border_motion(brake, found, (one.name, other.name), settle)
    off.append(abs(border.period - known.orbit.period))
    print(f"{one.name} and {other.name}: {border.period:.9f} s, {off[-1]:.0e} s from the branch")

# %% tags=["remove-cell"]
assert max(off) < 1e-9

# %% [markdown]
# ## Your own brake
#
# - **More degrees of freedom**: more names in `coordinates`, and a row of `mass_matrix` and of `forces`
#   for each. Nothing else on this page changes but the closed forms. Take a model of finite elements
#   down to some modes first: `craig_bampton` of [friction dampers](friction_dampers.md).
# - **More pads**: more names in `contact_directions` and `contacts`. A mode is then a state of each,
#   `list(brake.mode_names)` has their numbers, and steady sliding is the one in which all slip.
# - **Units**: any. Nothing on this page is absolute but the bounds that you give.
# - **A friction law of your own**: [here](own_law.py). Take the slope at the speed of the disc from a
#   measurement: the Hopf point depends on it and on the friction there, the fold on all of the law.
# - **Another parameter**: any field of the class, in place of `"mu"` and `"ratio"`: stiffness, pressure
#   or speed.
# - **Constant friction**: the slip is linear then, and its cycles of all sizes lie at the Hopf point
#   itself. The branch goes straight up there, where `stable` is a matter of rounding, until the cycle
#   touches the speed of the belt (`GR`); take many points. Or simulate beyond the Hopf point, and
#   follow what `orbit_guess` finds back to smaller friction.
# - **"not settled"** is what a `Settle` too short leaves. Near the Hopf point motions decay slowly, and
#   near flutter distances grow at first: take ten times the time to halve, or more.
