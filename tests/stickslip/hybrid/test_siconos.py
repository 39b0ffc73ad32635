"""Cross-check against Siconos, an independent code for set-valued friction, where it is installed.

Debian: `apt-get install python3-siconos`. It lives in the system's Python, so it runs in a process of
its own. Its implicit Euler-Moreau stepping is of first order; the comparison is of its limit.
"""

import json
import pathlib
import shutil
import subprocess
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from tests.stickslip.hybrid._systems import State

SCRIPT = pathlib.Path(__file__).with_name("_siconos_run.py")
END, AMPLITUDE, FREQUENCY, FRICTION, X0 = 20.0, 1.5, 0.7, 1.0, 0.3


def system_python():
    python = shutil.which("python3", path="/usr/bin:/usr/local/bin")
    if python is None:
        return None
    found = subprocess.run([python, "-c", "import siconos.kernel"], capture_output=True, check=False)
    return python if found.returncode == 0 else None


class ForcedBlock(ss.AbstractHybridSystem):
    """x'' = -x + A cos(w t) - F sgn(x'), at rest while the load is below F."""

    mode_names: ClassVar = ("backward", "rest", "forward")
    guard_names: ClassVar = ("load reaches +F", "load reaches -F", "stops")

    def load(self, t, y):
        return AMPLITUDE * jnp.cos(FREQUENCY * t) - y.x

    def vector_field(self, t, y, mode, args):
        sense = jnp.asarray(mode, jnp.float64) - 1.0
        return State(y.v, jnp.where(mode == 1, 0.0, self.load(t, y) - sense * FRICTION))

    def guards(self, t, y, mode, args):
        rest, sense = mode == 1, jnp.asarray(mode, jnp.float64) - 1.0
        load = self.load(t, y)
        return (
            jnp.where(rest, FRICTION - load, 1.0),
            jnp.where(rest, FRICTION + load, 1.0),
            jnp.where(rest, 1.0, sense * y.v),
        )

    def transition(self, t, y, mode, guard, args):
        load = self.load(t, y)
        onset = jnp.where(load > FRICTION, 2, jnp.where(load < -FRICTION, 0, 1))
        mode = jnp.where(guard == 0, 2, jnp.where(guard == 1, 0, onset))
        return State(y.x, 0.0 * y.v), mode

    def initial_mode(self, t, y, args):
        return 2


@pytest.mark.slow
def test_forced_block_sticks_and_slips_as_in_siconos():
    python = system_python()
    if python is None:
        pytest.skip("Siconos is not installed in the system's Python")

    def siconos(h):
        arguments = [h, END, AMPLITUDE, FREQUENCY, FRICTION, X0, 0.0]
        done = subprocess.run(
            [python, str(SCRIPT), *map(str, arguments)], capture_output=True, check=True, text=True
        )
        return np.array(json.loads(done.stdout.splitlines()[-1]))

    run = ss.simulate(
        ForcedBlock(), 0.0, END, State(X0, 0.0), "forward",
        saveat=ss.SaveAt(ts=jnp.linspace(0.1, END, 200)),
    )  # fmt: skip
    assert run.num_events >= 6
    errors = []
    for every in (50, 100, 200):
        rows = siconos(0.1 / every)[every - 1 :: every][:200]
        np.testing.assert_allclose(rows[:, 0], run.outputs.t, atol=1e-9)
        errors.append(rows[:, 1] - np.asarray(run.outputs.y.x))
    worst = [np.abs(e).max() for e in errors]
    # First order: the error halves with the step, and its extrapolation is near zero.
    assert 1.8 < worst[0] / worst[1] < 2.2
    assert 1.8 < worst[1] / worst[2] < 2.2
    assert np.abs(2 * errors[2] - errors[1]).max() < 0.02 * worst[2]
    # Both hold the block exactly.
    resting = np.asarray(run.outputs.mode) == 1
    assert resting.sum() > 10
    np.testing.assert_array_equal(np.asarray(run.outputs.y.v)[resting], 0.0)
    assert np.abs(rows[resting][1:-1, 2]).max() < 1e-12
