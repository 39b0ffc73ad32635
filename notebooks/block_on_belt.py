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
# # A block on a belt: stick, slip, chaos, derivatives
#
# A block rests on a moving belt, held back by springs and pressed down by a pendulum. Friction
# drags it along until the springs tear it loose; it slips back and sticks again. We simulate it,
# look at the events, sweep a stiffness, zoom in, ask how fast neighbouring motions part, and
# differentiate through everything.
#
# The parameters are **constructed** (set A): the paper the model comes from prints none. Units are
# SI.

# %% tags=["remove-output"]
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss
from stickslip import plot
from stickslip.analysis import PeriodTest, Recording, orbit_diagram
from stickslip.sweep import Compute
from stickslip.systems import BlockOnBelt, BlockOnBeltSetValued, BlockState

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk
START = BlockState(x=0.0, vx=0.0, y=0.0, vy=0.0)

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")

# %% [markdown]
# ## One motion
#
# With a *set-valued* friction law the block truly sticks: while it does, its velocity is that of
# the belt and the friction force is whatever holds it, as long as the static interval allows. The
# system is a hybrid one: three modes (slip backward, stick, slip forward), guards between them. The
# integrator lands on each event.

# %%
block = BlockOnBeltSetValued.constructed(k3=85.0)
END = 10.0
grid = np.linspace(0.0, END, 2001)
plain = ss.Integrator("rk4", ss.FixedStep(1e-3))


@jax.jit
def motion(system):
    """Ten seconds from rest, with outputs, events and the points of the paper's section."""
    return ss.simulate(
        system, 0.0, END, START, integrator=plain,
        saveat=ss.SaveAt(
            ts=jnp.asarray(grid), sections=block.zero_acceleration_section(), max_crossings=32,
        ),
        throw=False,
    )  # fmt: skip


run = motion(block)
print(run)
print(run.events.to_dataframe(block)[["t", "mode_before", "mode_after"]].head(6))

# %%
above, below = plot.motion(run, block, ["x", "vx"], events=False)
section = run.crossings[0]
above.plot(section.t, section.y.x, "r.", label="section: acceleration falls through 0")
above.legend(loc="lower right")
below.axhline(float(block.V_b), color="0.5", linewidth=0.8)

y, mode = run.outputs.y, np.asarray(run.outputs.mode)
stick = mode == block.mode_names.index("stick")
late = grid > 2.0
share = stick[late].mean()
print(f"the block sticks {share:.0%} of the time")

# %% tags=["remove-cell"]
assert bool(run.successful)
# While it sticks, it moves with the belt, to rounding.
assert np.abs(np.asarray(y.vx)[stick][1:] - float(block.V_b)).max() < 1e-12
assert 0.3 < share < 0.7

# %% [markdown]
# ## Is it right?
#
# Energy shows it. Between events the energy of block and pendulum changes by what belt, friction and
# dampers feed in. Here is the balance, the powers integrated over the outputs (the trapezoidal rule
# jumps over the events, so do not ask it for more than 1e-3).

# %%
powers = jax.vmap(lambda t, y, m: block.powers(t, y, m, None))(
    run.outputs.t, run.outputs.y, run.outputs.mode
)
energy = np.asarray(jax.vmap(block.energy)(run.outputs.y))
fed = {name: np.trapezoid(np.asarray(p), grid) for name, p in powers.items()}
gap = energy[-1] - energy[0] - sum(fed.values())
print({name: f"{value:+.4f} J" for name, value in fed.items()}, f"unaccounted for: {gap:+.1e} J")

# %% tags=["remove-cell"]
assert abs(gap) < 2e-3 * fed["belt"]
assert fed["friction"] < 0.0 > fed["dampers"]

# %% [markdown]
# ## A sweep
#
# The paper smooths the law: friction is a steep but single-valued function of the sliding velocity,
# and the block creeps instead of sticking. For each stiffness $k_3$ we start at rest, drop a
# transient and keep the positions at which the acceleration of the block falls through zero. That
# is an orbit diagram: one point per lane is a period-one motion, two after a doubling, a cloud if
# it is chaotic.
#
# `orbit_diagram` runs the lanes in small chunks on all cores; with `store="some/directory"` it
# would survive a `kill -9` and go on where it stopped.

# %%
LANES, TRANSIENT, DURATION = 401, 150.0, 40.0
PERIOD, CHECK = PeriodTest(1e-3, longest=16), 16
smooth = BlockOnBelt.constructed(k3=85.0)
fast = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-9), max_steps=10_000_000)


def diagram(low, high):
    """Points of the section over k3 from `low` to `high` [N/m]."""
    return orbit_diagram(
        smooth, {"k3": np.linspace(low, high, LANES)}, START,
        Recording(
            TRANSIENT, DURATION, smooth.zero_acceleration_section(), "x", max_points=96,
            period=PERIOD, check=CHECK,
        ),
        integrator=fast, compute=Compute(progress=False),
    )  # fmt: skip


def show(data, title):
    """The diagram, with the period that was found underneath."""
    figure, (cloud, steps) = plt.subplots(
        2, 1, sharex=True, figsize=(9, 5), height_ratios=(3, 1), layout="constrained"
    )
    plot.orbit_diagram(data, "x", ax=cloud, color="k", markersize=2.5)
    cloud.set(xlabel=None, title=title)
    plot.orbit_diagram(data, "period", ax=steps, markersize=5)
    steps.set(ylabel="period (0: none, -1: unknown)")
    return figure


# %% tags=["remove-cell"]
if QUICK:
    LANES, TRANSIENT, DURATION = 8, 30.0, 12.0
    PERIOD, CHECK = PeriodTest(1e-2, longest=4), 0

# %%
whole = diagram(72.0, 97.0)
show(whole, "Simplified model, set A")
words = whole.status.attrs["flag_meanings"].split()
ran = whole.status.isin([words.index("ok"), words.index("not_settled")])
print("lanes that failed:", int((~ran).sum()))
print("lanes that had not settled:", int((whole.status == words.index("not_settled")).sum()))

# %% tags=["remove-cell"]
assert ran.all()
assert int(whole.period.sel(k3=74.0, method="nearest")) == 1
assert int(whole.period.sel(k3=83.0, method="nearest")) == 2

# %% [markdown]
# `slow_transient` marks lanes whose first points are not yet those of the attractor. It is the
# honest companion of every brute-force diagram: the paper drops 15 s, which for these parameters is
# not enough.

# %%
print(f"still approaching their attractor: {float(whole.slow_transient.mean()):.0%} of the lanes")

# %% [markdown]
# ## Zoom
#
# The same function, the same compiled program, other values.

# %%
window = diagram(88.0, 92.0)
show(window, "Into chaos")
spread = window.x.max("point") - window.x.min("point")

# %% tags=["remove-cell"]
assert float(spread.max()) > 1.5 * float(whole.x.sel(k3=74.0, method="nearest").std())

# %% [markdown]
# ## How fast do neighbours part?
#
# A tangent vector carried along with the motion is one `jax.jvp` through the simulation, events
# included. Its mean growth rate is the largest Lyapunov exponent: zero for a periodic motion of a
# system without external clock (a shift in time neither grows nor decays), positive for chaos.

# %%
SEGMENTS, SEGMENT, SETTLE = 150, 2.0, 150.0
VALUES = np.linspace(72.0, 97.0, 101)


def exponent(k3):
    """Largest Lyapunov exponent [1/s] at `k3`."""
    system = BlockOnBelt.constructed(k3=k3)

    def flow(y, seconds):
        end = ss.simulate(
            system, 0.0, seconds, y, integrator=fast, saveat=ss.SaveAt(max_events=None), throw=False
        )
        return end.y1

    def step(carry, seconds):
        y, v = carry
        y, v = jax.jvp(lambda y: flow(y, seconds), (y,), (v,))
        length = jnp.sqrt(sum(c * c for c in v))
        return (y, jax.tree.map(lambda c: c / length, v)), jnp.log(length)

    y = jax.tree.map(lambda c: c + 0.0 * k3, START)
    v = jax.tree.map(lambda c: c + 0.5 + 0.0 * k3, START)
    # The first segment is the transient; then the vector turns into the direction that grows.
    seconds = jnp.full(SEGMENTS + 3, SEGMENT).at[0].set(SETTLE)
    growth = jax.lax.scan(step, (y, v), seconds)[1]
    return growth[3:].mean() / SEGMENT


# %% tags=["remove-cell"]
if QUICK:
    SEGMENTS, SETTLE, VALUES = 10, 20.0, np.array([76.0, 93.0])

# %%
exponents = np.asarray(ss.map_lanes(exponent)(jnp.asarray(VALUES)))
figure, axis = plt.subplots(figsize=(9, 2.5), layout="constrained")
axis.axhline(0.0, color="0.6")
axis.plot(VALUES, exponents, ".-")
axis.set(xlabel="k3 [N/m]", ylabel="exponent [1/s]")
periodic, chaotic = (float(exponents[np.abs(VALUES - k3).argmin()]) for k3 in (76.0, 93.0))
print(f"k3 = 76: {periodic:+.3f} 1/s, k3 = 93: {chaotic:+.3f} 1/s")

# %% tags=["remove-cell"]
assert abs(periodic) < 0.05
assert chaotic > 0.05

# %% [markdown]
# ## Derivatives
#
# Back to the set-valued model. How does the position after one second, or the very moment at which
# the block sticks for the second time, depend on stiffness, belt speed and friction? The derivative
# goes through every event: it contains the jump in the sensitivity that an event makes (the
# saltation matrix). A check by central differences is cheap.

# %%
NAMES = ("k3", "V_b", "mu_0")
nominal = jnp.array([85.0, 0.12, 0.26])
law = BlockOnBelt.constructed(k3=85.0).law


def outcome(p):
    """Position after one second and time of the second event, for `p = (k3, V_b, mu_0)`."""
    changed = type(law)(p[2], law.alpha, law.beta, law.gamma).set_valued_limit()
    system = BlockOnBeltSetValued.constructed(k3=p[0], V_b=p[1], law=changed)
    end = ss.simulate(
        system, 0.0, 1.0, START, integrator=plain, saveat=ss.SaveAt(max_events=8), throw=False
    )
    both = jnp.stack([end.y1.x, end.events.t[1]])
    return both, both


with_slopes = jax.jit(jax.jacfwd(outcome, has_aux=True))
slopes, value = with_slopes(nominal)
differences = []
for step in np.diag(1e-5 * np.asarray(nominal)):
    ends = [np.asarray(with_slopes(nominal + sign * step)[1]) for sign in (1, -1)]
    differences.append((ends[0] - ends[1]) / (2.0 * step.sum()))
differences = np.array(differences).T
print(f"x(1 s) = {value[0]:.6f} m, second event at {value[1]:.6f} s")
for i, name in enumerate(NAMES):
    print(f"by {name:5s} exact {slopes[0, i]:+.8f} {slopes[1, i]:+.8f}", end="   ")
    print(f"central differences {differences[0, i]:+.8f} {differences[1, i]:+.8f}")

# %% tags=["remove-cell"]
np.testing.assert_allclose(slopes, differences, rtol=1e-5, atol=1e-8)

# %% [markdown]
# Where to go on: the docstring of `stickslip.AbstractHybridSystem` shows a system of your own in
# thirty lines; `python -m experiments --list` names the figures; `map_lanes` maps anything over
# many lanes.
