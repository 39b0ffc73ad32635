"""What the experiments on declared machines share: growth of small disturbances, shading, verdicts."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.mechanism import AbstractMechanism

from .._statement import Verdict

FAST = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-9), max_steps=1_000_000)


def flow_matrix(machine: AbstractMechanism, y: Any, duration: float, steps: int = 100) -> jax.Array:
    """Derivative of the state after `duration` [s] by the state `y`, through `simulate`.

    In steps of equal length: at an equilibrium, which moves nowhere, an adaptive one would be as long
    as the run, and its derivative would be that of one step.
    """
    leaves, form = jax.tree.flatten(y)
    start = jnp.stack([jnp.asarray(x, jnp.float64) for x in leaves])
    integrator = ss.Integrator("dop853", ss.FixedStep(duration / steps))

    def end(start):
        y0 = jax.tree.unflatten(form, list(start))
        run = ss.simulate(
            machine,
            0.0,
            duration,
            y0,
            integrator=integrator,
            saveat=ss.SaveAt(max_events=None),
            throw=False,
        )
        return jnp.stack(jax.tree.leaves(run.y1))

    return jax.jacfwd(end)(start)


def rates_of(matrix: np.ndarray, duration: Any) -> np.ndarray:
    """Growth rates [1/s] of the disturbances that `matrix` carries over `duration`, the largest first.

    `matrix` may have leading axes.
    """
    factors = np.abs(np.linalg.eigvals(np.asarray(matrix)))
    return -np.sort(-np.log(factors), axis=-1) / np.asarray(duration)


def verdict(difference: float, allowed: float, text: str) -> Verdict:
    """Whether `difference` is at most `allowed`, and `text` with both."""
    told = f"{text}; difference {difference:.2g}, allowed {allowed:g}"
    return bool(difference <= allowed), told
