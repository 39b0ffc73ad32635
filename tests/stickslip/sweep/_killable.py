"""A sweep in a process of its own, for tests that kill it.

`python -m ..._killable STORE [PAUSE [PART OF]]`
"""

import sys
import time

import jax
import jax.numpy as jnp
import numpy as np

from stickslip.sweep import Variable, run_sweep
from stickslip.sweep.evaluate import Evaluate
from tests.stickslip.sweep._options import options

GRID = {"a": np.linspace(2.5, 4.0, 103), "b": np.array([0.1, 0.2, 0.3])}


def logistic(a, b):
    """Points of the logistic map, and one number that is not finite for some lanes."""

    def step(x, _):
        x = a * x * (1.0 - x)
        return x, x

    end, points = jax.lax.scan(step, b, None, length=64)
    return {"x": points[-8:], "end": {"log": jnp.log(end - 0.5)}, "low": end < 0.5}


def sweep(store, *, chunk=9, **more):
    """The sweep that is killed."""
    variables = {"x": Variable(("point",), "1", "population")}
    settings = {"points": 8, "seed": 1}
    return run_sweep(
        logistic, GRID, **options(store, chunk=chunk, settings=settings, variables=variables, **more)
    )


if __name__ == "__main__":
    pause = float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
    evaluate = Evaluate.__call__

    def slowly(self, block, read):
        time.sleep(pause)
        return evaluate(self, block, read)

    Evaluate.__call__ = slowly
    sweep(sys.argv[1], part=tuple(map(int, sys.argv[3:])) or None)
