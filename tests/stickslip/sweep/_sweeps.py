"""Sweeps that other processes find by name, for tests of stores and of many workers."""

import os
import resource
import sys
import time

import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.sweep import Carried, Variable, refine_sweep, run_sweep
from stickslip.systems import CoulombOscillator, Motion
from tests.stickslip.sweep._options import options

SMALL = {"k": np.linspace(1.0, 2.0, 5), "q": np.array([0.5, 0.25])}
LABELS = {"code": Variable(attrs={"flag_values": [0, 1], "flag_meanings": "low high"})}


def plain(k, q):
    """No program is smaller."""
    return {"x": k + q, "code": (k > 1.5).astype(np.int32)}


def small(store, offset=0.0, chunk=2, **more):
    """Ten lanes in five units."""
    return run_sweep(
        lambda k, q: {**plain(k, q), "y": k + offset}, SMALL,
        **options(store, chunk=chunk, settings={"offset": offset}, variables=LABELS, **more),
    )  # fmt: skip


def carried(store, **more):
    """Two rows of five units that follow from each other."""

    def step(carry, k, q):
        return 0.5 * carry + k * q, {"x": carry}

    down = Carried("downwards")
    return run_sweep(step, SMALL, carry=1.0, carried=down, **options(store, chunk=1, **more))


DISC = {"a": np.linspace(-1.0, 1.0, 5), "b": np.linspace(1.0, -1.0, 4)}


def disc(a, b, radius=0.8):
    """Inside a disc or not; outside a number that is none there."""
    inside = a * a + b * b < radius**2
    return {"inside": inside, "height": jnp.where(inside, jnp.array([a, b]), jnp.nan)}


def refined(store=None, levels=2, radius=0.8, tolerance=0.0, **more):
    """The rim of a disc, in units of eight lanes."""
    variables = {"a": Variable(units="m"), "height": Variable(("axis",), "m")}
    return refine_sweep(
        lambda a, b: disc(a, b, radius), DISC, {"inside": tolerance}, levels=levels,
        **options(store, chunk=8, settings={"radius": radius}, variables=variables, **more),
    )  # fmt: skip


def simulated(store, **more):
    """A motion with events, whose program has many parts."""

    def lane(belt_speed):
        block = CoulombOscillator(1.0, 1.0, 1.5, 0.5, belt_speed)
        start = Motion(x=jnp.zeros(()), v=belt_speed)
        run = ss.simulate(block, 0.0, 20.0, start, saveat=ss.SaveAt(max_events=None), throw=False)
        return {"x": run.y1.x, "ok": run.successful}

    return run_sweep(lane, {"belt_speed": np.linspace(0.2, 0.4, 6)}, **options(store, chunk=3, **more))


def elsewhere(store, name="STICKSLIP_TEST_OFFSET", **more):
    """Unlike the sweep that was asked for, where a process has another environment."""

    def lane(k, q):
        return {"x": k + q + float(os.environ.get(name, "0"))}

    return run_sweep(lane, SMALL, **options(store, chunk=2, **more))


def large(store, rows=1000, columns=1000, shard=2**18):
    """A million lanes by default, with twelve variables of one number and one of eight."""

    def lane(a, b):
        numbers = {f"x{i}": a + i * b for i in range(12)}
        return {**numbers, "points": a * jnp.arange(8.0) - b}

    grid = {"a": np.linspace(0.0, 1.0, rows), "b": np.linspace(2.0, 3.0, columns)}
    return run_sweep(lane, grid, **options(store, shard=shard))


if __name__ == "__main__":
    # Seconds of a call, and the most memory that the process had, in MB.
    begin = time.monotonic()
    large(sys.argv[1], rows=int(sys.argv[2]))
    print(time.monotonic() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
