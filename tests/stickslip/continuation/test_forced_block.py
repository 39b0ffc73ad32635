"""The forced block's tori against shooting with SciPy alone."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from stickslip.continuation import OrbitGuess, continue_orbit
from tests.stickslip.continuation._systems import ForcedBlock, Motion

pytestmark = pytest.mark.slow


def of_frequency(system):
    return 2 * jnp.pi / system.frequency


def slip(t, y, force, w):
    """Slower than the belt; the third number is the integral of the divergence."""
    u = 1.0 - y[1]
    rate = -y[0] + 1.5 - 1.5 * u + 0.45 * u**3 + force * np.cos(w * t)
    return y[1], rate, 1.5 - 1.35 * u**2


def end(state, force, w, turns, **options):
    start = [*state, 0.0]
    return solve_ivp(
        slip, (0.0, 2 * np.pi * turns / w), start, "DOP853", args=(force, w), rtol=1e-12, atol=1e-13,
        **options,
    )  # fmt: skip


@pytest.mark.parametrize(("w", "force"), [(3.0, 1.2720514849), (3.5, 1.5279422492)])
def test_torus_of_the_pure_slip_orbit(w, force):
    """A conjugate pair is on the unit circle where the integral of the divergence is zero."""
    start = OrbitGuess(Motion(0.45 + 0.8 / (1.0 - w * w), 0.0), 2 * np.pi / w, 0)
    branch = continue_orbit(
        ForcedBlock(0.8, w), start, "amplitude", (0.7, 2.0), step=0.05, forcing_period=of_frequency
    )
    (torus,) = branch["NS"]
    assert np.abs(torus.orbit.multipliers) == pytest.approx(1.0, abs=1e-9)
    assert int(torus.orbit.events.count) == 0

    def wrong(z):
        last = end(z[:2], z[2], w, 1).y[:, -1]
        return last - [z[0], z[1], 0.0]

    known = fsolve(wrong, [0.45 + force / (1.0 - w * w), 0.0, force], xtol=1e-13)
    assert known[2] == pytest.approx(force, abs=1e-9)
    assert torus.value == pytest.approx(known[2], abs=1e-9)
