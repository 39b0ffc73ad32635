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
# # A law of your own: a neural network, learned through sticks and slips
#
# A friction law is a class with three claims and three methods. Anything that JAX can differentiate may
# stand in them: here a small neural network, whose weights are found from a record of a motion.

# %% tags=["remove-output"]
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import optax

import stickslip as ss
from stickslip.friction import AbstractDryFrictionLaw, Stribeck, check_friction_law
from stickslip.mechanism import AbstractMechanism, Contact

ss.enable_compilation_cache()  # what a run compiles, the next one reads from disk

# %% tags=["remove-cell"]
import os

QUICK = os.environ.get("NOTEBOOK_QUICK", "0") not in ("", "0")

# %% [markdown]
# ## The law
#
# - `kinetic(v, sense)` is the signed coefficient while the contact slips in `sense`, +1 or -1; it must
#   go smoothly a little beyond $v = 0$, because the integrator looks for the end of the slip there.
# - `static_coefficient(sense)` is the most that a contact at rest holds.
# - `set_valued_limit()` is the law that a smooth one approximates; a set-valued law is its own.
#
# A speed comes as a number or as a row of numbers, and the coefficient has the same shape.
# `jnp.vectorize` makes a function of one number such a function of either. `check_friction_law(law)`
# says what a law of your own does not keep, such as a static friction below the kinetic one.


# %%
class Learned(AbstractDryFrictionLaw):
    """A coefficient that a network gives over the speed, the same in both directions."""

    net: eqx.nn.MLP
    set_valued: ClassVar[bool] = True  # sticks exactly
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    def kinetic(self, v, sense):
        magnitude = jnp.vectorize(self.net)(10.0 * sense * jnp.asarray(v))
        # As many bits as the speed has: 64, unless you ask with others.
        return (sense * magnitude).astype(jnp.result_type(v, float))

    def static_coefficient(self, sense=1):
        return sense * self.kinetic(0.0, sense)

    def set_valued_limit(self):
        return self


def network(key):
    """Eight hidden numbers: 25 weights of 64 bits, and a result that is positive."""
    return eqx.nn.MLP(
        "scalar", "scalar", 8, 1, jnp.tanh, jax.nn.softplus, dtype=jnp.float64, key=jax.random.key(key)
    )


untrained = Learned(network(0))
check_friction_law(untrained)
print("a number:", untrained.coefficient(0.1))
print("a row:   ", untrained.coefficient(jnp.array([-0.1, 0.0, 0.1, 0.2])))

# %% [markdown]
# `check_friction_law` asks the law for all that it claims, and says in words what does not hold.
#
# ## The machine and the record
#
# A sledge of 2 kg is pulled through a spring whose end moves at 0.1 m/s. The record, of a Stribeck law
# that the network does not know, has an error of 1 mm.


# %%
class Sledge(AbstractMechanism):
    """A sledge on dry ground, pulled through a spring."""

    law: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 2.0}

    def forces(self, t, q, v, args):
        return {"x": 50.0 * (0.1 * t - q.x)}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(self.law, normal_force=19.6)}


SD, END = 1e-3, 6.0  # [m], [s]
times = jnp.linspace(0.0, END, 121)


def run(law):
    """The run from rest with its places at the times of the record."""
    sledge = Sledge(law)
    return ss.simulate(sledge, 0.0, END, sledge.state(), saveat=ss.SaveAt(ts=times), throw=False)


truth = Stribeck(mu_s=0.4, mu_k=0.2, v_s=0.05)
exact = run(truth)
record = exact.outputs.y.x + SD * jax.random.normal(jax.random.key(1), times.shape)
print(exact)

# %% [markdown]
# ## The training
#
# The misfit is differentiated through every stick and slip, in one reverse pass for all weights.

# %%
STEPS = 600


def misfit(law):
    """Mean square of the residuals in units of the error: 1 is the noise."""
    return jnp.mean(((run(law).outputs.y.x - record) / SD) ** 2)


optimiser = optax.adam(optax.cosine_decay_schedule(3e-2, STEPS))


@eqx.filter_jit
def step(law, memory):
    value, slope = eqx.filter_value_and_grad(misfit)(law)
    change, memory = optimiser.update(slope, memory)
    return eqx.apply_updates(law, change), memory, value


# %% tags=["remove-cell"]
STEPS = 5 if QUICK else STEPS

# %%
law, memory = untrained, optimiser.init(eqx.filter(untrained, eqx.is_inexact_array))
misfits = []
for _ in range(STEPS):
    law, memory, value = step(law, memory)
    misfits.append(float(value))
events = run(law).num_events
print(f"misfit: {misfits[0]:.0f} at first, {misfits[-1]:.2f} at last, through {events} events")

# %%
speeds = jnp.linspace(0.0, 0.4, 201)
figure, axes = plt.subplots(1, 3, figsize=(11, 3.2), layout="constrained")
axes[0].semilogy(misfits)
axes[0].set(xlabel="step", ylabel="misfit")
axes[1].plot(times, 1e3 * record, ".", markersize=3, label="record")
axes[1].plot(times, 1e3 * run(law).outputs.y.x, label="learned")
axes[1].set(xlabel="t [s]", ylabel="x [mm]")
for name, one in (("before", untrained), ("learned", law), ("truth", truth)):
    axes[2].plot(speeds[1:], one.coefficient(speeds[1:]), label=name)
axes[2].set(xlabel="speed [m/s]", ylabel="coefficient")
for axis in axes[1:]:
    axis.legend(frameon=False)
plt.show()

# %% tags=["remove-cell"]
seen = speeds[(speeds > 0.0) & (speeds < float(jnp.max(exact.outputs.y.v_x)))]
off = np.abs(np.asarray(law.coefficient(seen) - truth.coefficient(seen)))
print(f"law off by {off.max():.3f}; fastest in the record {seen[-1]:.3f} m/s")
assert misfits[-1] < misfits[0]
assert QUICK or misfits[-1] < 1.5
assert QUICK or off.max() < 0.05

# %% [markdown]
# Beyond the fastest speed of the record the network says what it likes. A misfit that stays above 1 is
# a training that has stalled, not noise: the misfit has jumps where an event more begins, and the law
# is then wrong most beside rest, where speeds pass quickly. What helps, in this order: let the network
# see numbers of the size of one (the factor 10 above is 1 over the fastest expected speed), another
# size of the steps (3e-2 to 1e-1), more of them, other weights to begin with. To see how sure the law
# is, learn it from several records, or from several starts.
#
# A law that depends on more than the speed is built where the rest is known: `contacts` of the
# mechanism has time, coordinates and velocities, and may give the law a temperature, or another normal
# force. A law with memory is an `AbstractBristleLaw`. [How to](how_to.md) has more recipes.
