"""Motions of `Pushed` with a force that wanders, as the filters have to find them."""

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss

KEPT = ss.SaveAt(events=False, max_events=None)


def wander(system, t0, dt, y, mode, kicks):
    """State and mode after `dt`, in which the force makes half of a step before and after each part."""
    h = dt / kicks.size

    def part(carry, kick):
        t, y, mode = carry
        half = 0.5 * kick
        y = system.state(x=y.x, d=y.d + half, v_x=y.v_x)
        run = ss.simulate(system, t, t + h, y, mode, saveat=KEPT, throw=False)
        y = run.y1
        return (t + h, system.state(x=y.x, d=y.d + half, v_x=y.v_x), run.mode1), None

    (_, y, mode), _ = jax.lax.scan(part, (t0, y, mode), kicks)
    return y, mode


def draw(system, mean, spread, key):
    """A state around the mean; one that sticks keeps the speed of its belt."""
    x, d, v = jax.random.normal(key, (3,))
    stuck = mean.v_x == system.belt_speed
    v_x = jnp.where(stuck, mean.v_x, mean.v_x + spread.v_x * v)
    return system.state(x=mean.x + spread.x * x, d=mean.d + spread.d * d, v_x=v_x)


def kicks_of(q, dt, shape, key, parts=8):
    return q * np.sqrt(dt / parts) * jax.random.normal(key, (*shape, parts))
