"""Parameters that do not go together are named; single ones: the walk in `tests/house`."""

import jax
import jax.numpy as jnp
import pytest

from stickslip.derived import WithIntegrals
from stickslip.systems import (
    CoulombOscillator,
    OscillatorBetweenStops,
)
from tests.stickslip.systems._systems import STOPS

OSCILLATOR = dict(mass=1.0, stiffness=1.0, static_force=1.0, kinetic_force=0.5, belt_speed=0.2)


def test_the_upper_stop_is_above_the_lower_one():
    with pytest.raises(ValueError, match=r"upper = -0.6: it must be above lower = -0.6"):
        OscillatorBetweenStops(**{**STOPS, "upper": -0.6})


def test_traced_parameters_pass():
    kinetic = jax.jit(lambda mass: CoulombOscillator(mass, 1.0, 1.0, 0.5, 0.2).mass * 2.0)
    assert float(kinetic(-1.0)) == -2.0


def test_wrong_integrals():
    block = CoulombOscillator(**OSCILLATOR)
    with pytest.raises(ValueError, match=r"units\['x'\] = .*: it must be named unlike .* x, v"):
        WithIntegrals(block, lambda *_: {"x": jnp.zeros(())}, units={"x": "J"})
