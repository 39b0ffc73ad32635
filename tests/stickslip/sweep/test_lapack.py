"""Lanes that call LAPACK end: two such programs of JAX 0.10 side by side may wait for ever."""

import os
import subprocess
import sys

import pytest

CALLS = """
import jax, jax.numpy as jnp, numpy as np
from stickslip.sweep import map_lanes

jax.config.update("jax_enable_x64", True)

def factor(matrix):
    return jnp.linalg.cholesky(matrix.T @ matrix + jnp.eye(250))

matrices = np.random.default_rng(0).normal(size=(16, 250, 250))
lanes = map_lanes(factor, chunk_size=4, workers=2, executor="portable")
for _ in range(10):
    found = lanes(matrices)
right = np.linalg.cholesky(matrices.transpose(0, 2, 1) @ matrices + np.eye(250))
np.testing.assert_allclose(found, right, rtol=0, atol=1e-11)
print(len(lanes.devices), "well")
"""


@pytest.mark.more
@pytest.mark.parametrize("devices", [1, 2])
def test_lanes_that_call_lapack_end(devices):
    """Without the lock none of five such runs ended; the factors are those of NumPy."""
    flags = f"--xla_force_host_platform_device_count={devices}"
    run = subprocess.run(
        [sys.executable, "-c", CALLS],
        env={**os.environ, "XLA_FLAGS": flags},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert run.stdout == f"{devices} well\n"
