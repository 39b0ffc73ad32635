"""Sweeps that other processes find by name, for the tests of many workers."""

import os
import resource
import sys
import time

import jax.numpy as jnp
import numpy as np

from stickslip.sweep import Variable, refine_sweep, run_sweep
from tests.stickslip.sweep._killable import GRID, logistic

SMALL = {"k": np.linspace(1.0, 2.0, 5), "q": np.array([0.5, 0.25])}


def plain(k, q):
    """No program is smaller."""
    return {"x": k + q, "code": (k > 1.5).astype(np.int32)}


def small(store, chunk=2, offset=0.0, shard=None, pause=0.0):
    """Ten lanes in five units; each worker begins after a pause."""
    time.sleep(pause)
    return run_sweep(
        lambda k, q: {**plain(k, q), "y": k + offset}, SMALL, store=store, chunk=chunk, shard=shard,
        executor="portable", settings={"offset": offset},
        variables={"code": Variable(attrs={"flag_values": [0, 1], "flag_meanings": "low high"})},
    )  # fmt: skip


def halves(store):
    """Unlike the function that was planned, when a process of another environment asks."""
    return small(store, offset=float(os.environ.get("STICKSLIP_TEST_OFFSET", "0")))


def carried(store):
    """Two rows of five units that follow from each other, which takes two units of work."""

    def step(carry, k, q):
        return 0.5 * carry + k * q, {"x": carry}

    return run_sweep(step, SMALL, carry=1.0, store=store, chunk=1, executor="portable")


DISC = {"a": np.linspace(-1.0, 1.0, 5), "b": np.linspace(1.0, -1.0, 4)}


def disc(a, b, radius=0.8):
    """Inside a disc or not; outside a number that is none there."""
    inside = a * a + b * b < radius**2
    return {"inside": inside, "height": jnp.where(inside, jnp.array([a, b]), jnp.nan)}


def refined(store=None, levels=2, radius=0.8, tolerance=0.0, chunk=8, pause=0.0, **options):
    """The rim of a disc, in units of eight lanes."""
    if pause:
        _slowly(pause)
    return refine_sweep(
        lambda a, b: disc(a, b, radius), DISC, {"inside": tolerance}, levels=levels, store=store,
        chunk=chunk, executor="portable", settings={"radius": radius},
        variables={"a": Variable(units="m"), "height": Variable(("axis",), "m")}, **options,
    )  # fmt: skip


def none(store):
    """Forgets to sweep."""


def logistic_map(store, pause=0.0):
    """The sweep that is killed; a unit takes `pause` seconds longer than it must."""
    if pause:
        _slowly(pause)
    return run_sweep(
        logistic, GRID, store=store, chunk=9, executor="portable", settings={"points": 8, "seed": 1},
        variables={"x": Variable(("point",), "1", "population")},
    )  # fmt: skip


def _slowly(pause):
    """A unit takes so many seconds longer than it must."""
    from stickslip.sweep.evaluate import Evaluate

    evaluate = Evaluate.__call__

    def slowly(self, block, read):
        time.sleep(pause)
        return evaluate(self, block, read)

    Evaluate.__call__ = slowly


def large(store, rows=1000, columns=1000, shard=2**18):
    """A million lanes by default, with twelve variables of one number and one of eight."""

    def lane(a, b):
        numbers = {f"x{i}": a + i * b for i in range(12)}
        return {**numbers, "points": a * jnp.arange(8.0) - b}

    grid = {"a": np.linspace(0.0, 1.0, rows), "b": np.linspace(2.0, 3.0, columns)}
    return run_sweep(lane, grid, store=store, shard=shard, executor="portable", workers=1)


if __name__ == "__main__":
    # Seconds of a call, and the most memory that the process had, in MB.
    begin = time.monotonic()
    large(sys.argv[1], rows=int(sys.argv[2]))
    print(time.monotonic() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
