"""Largest Lyapunov exponent by two trajectories (Benettin's method)."""

import dataclasses

import jax
import jax.numpy as jnp
import xarray as xr

import stickslip as ss
from stickslip.sweep import Compute, Labels, Storage, Variable, run_sweep

WARM_UP = 20  # segments left out: the distance must first turn into the direction that grows
APART = 1e-7  # distance the two trajectories are set to: far above rounding, far below the attractor
FAR = 1e-2  # a tenth of the size of the motion: beyond, a distance is not small


def largest_exponents(
    build,
    grid,
    y0,
    *,
    transient: float,
    segments: int,
    integrator,
    segment: float = 1.0,
    store: Storage | None = None,
    labels: Labels | None = None,
    compute: Compute | None = None,
) -> xr.Dataset:
    """Largest exponent over a grid: mean growth rate of a small distance, reset every `segment` s.

    Returns `exponent` [1/s] and `spread`, the standard deviation of the means over four quarters of
    the time, a measure of how far it has converged. Both are NaN where a motion ends early, where the
    two trajectories merge to rounding, and where they part within a segment by `FAR`.
    """

    def lane(**point):
        system = build(**point)

        def run(y, mode, duration):
            end = ss.simulate(
                system,
                0.0,
                duration,
                y,
                mode,
                integrator=integrator,
                saveat=ss.SaveAt(max_events=None),
                throw=False,
            )
            return end.y1, end.mode1, end.successful

        start = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y0)
        mode = jnp.asarray(system.initial_mode(0.0, start, None), jnp.int32)
        y, mode, good = run(start, mode, transient)
        other = y._replace(x=y.x + APART)

        def step(carry, _):
            # One simulation for both, batched, is compiled once.
            pair, modes, good = carry
            pair, modes, well = jax.vmap(lambda y, m: run(y, m, segment))(pair, modes)
            gap = jax.tree.map(lambda a: a[1] - a[0], pair)
            distance = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree.leaves(gap)))
            scale = APART / jnp.maximum(distance, 1e-300)
            pair = jax.tree.map(lambda a, g: jnp.stack([a[0], a[0] + scale * g]), pair, gap)
            size = jnp.sqrt(sum(a[0] * a[0] for a in jax.tree.leaves(pair)))
            tells = (distance > 64 * 2.0**-52 * size) & (distance < FAR)
            return (pair, modes, good & jnp.all(well) & tells), jnp.log(distance / APART)

        pair = jax.tree.map(lambda a, b: jnp.stack([a, b]), y, other)
        carry = (pair, jnp.stack([mode, mode]), good)
        (_, _, good), growth = jax.lax.scan(step, carry, None, length=segments + WARM_UP)
        growth = jnp.where(good, growth[WARM_UP:], jnp.nan)
        quarters = growth[: 4 * (segments // 4)].reshape(4, -1).mean(axis=1) / segment
        return {"exponent": growth.mean() / segment, "spread": jnp.std(quarters)}

    labels = dataclasses.replace(
        Labels() if labels is None else labels,
        variables={
            "exponent": Variable(units="1/s", long_name="largest Lyapunov exponent"),
            "spread": Variable(units="1/s", long_name="standard deviation over quarters of the time"),
            "k3": Variable(units="N/m", long_name="stiffness k3"),
        },
        settings={"transient": transient, "segments": segments, "segment": segment},
    )
    store = Storage(chunk=512) if store is None else store
    return run_sweep(lane, grid, store=store, labels=labels, compute=compute)
