"""Every parameter out of its range is refused by name, value and what is allowed."""

import jax
import jax.numpy as jnp
import pytest

from stickslip.derived import WithIntegrals
from stickslip.systems import (
    BouncingBall,
    CoulombOscillator,
    OscillatorBetweenStops,
    SlidingBlock,
    TwoBlocksOnBelt,
)
from tests.stickslip.systems._systems import PAIR, STOPS

OSCILLATOR = dict(mass=1.0, stiffness=1.0, static_force=1.0, kinetic_force=0.5, belt_speed=0.2)
BLOCK = dict(mass=1.0, static_force=1.0, kinetic_force=0.5, force=0.0)
BALL = dict(mass=1.0, gravity=9.81, restitution=0.5, rest_speed=0.0)


@pytest.mark.parametrize(
    ("system", "good", "name", "value"),
    [
        (CoulombOscillator, OSCILLATOR, "mass", 0.0),
        (CoulombOscillator, OSCILLATOR, "stiffness", -1.0),
        (CoulombOscillator, OSCILLATOR, "static_force", -1e-9),
        (CoulombOscillator, OSCILLATOR, "kinetic_force", float("nan")),
        (CoulombOscillator, OSCILLATOR, "belt_speed", float("inf")),
        (SlidingBlock, BLOCK, "mass", -1.0),
        (SlidingBlock, BLOCK, "static_force", -1.0),
        (SlidingBlock, BLOCK, "kinetic_force", -1.0),
        (SlidingBlock, BLOCK, "force", float("nan")),
        (BouncingBall, BALL, "mass", 0.0),
        (BouncingBall, BALL, "gravity", 0.0),
        (BouncingBall, BALL, "restitution", 1.5),
        (BouncingBall, BALL, "restitution", -0.1),
        (BouncingBall, BALL, "rest_speed", -1.0),
        (OscillatorBetweenStops, STOPS, "mass", 0.0),
        (OscillatorBetweenStops, STOPS, "stiffness", 0.0),
        (OscillatorBetweenStops, STOPS, "damping", -1.0),
        (OscillatorBetweenStops, STOPS, "lower", float("-inf")),
        (OscillatorBetweenStops, STOPS, "upper", -0.6),
        (OscillatorBetweenStops, STOPS, "restitution", 2.0),
        (OscillatorBetweenStops, STOPS, "rest_speed", -1.0),
        (OscillatorBetweenStops, STOPS, "force_amplitude", float("nan")),
        (OscillatorBetweenStops, STOPS, "force_frequency", float("nan")),
        *((TwoBlocksOnBelt, PAIR, name, -1.0) for name in PAIR if name != "belt_speed"),
        (TwoBlocksOnBelt, PAIR, "belt_speed", float("nan")),
    ],
)
def test_wrong_parameter(system, good, name, value):
    system(**good)
    with pytest.raises(ValueError, match=rf"^{name}.* = .*: it must be "):
        system(**{**good, name: value})


def test_traced_parameters_pass():
    kinetic = jax.jit(lambda mass: CoulombOscillator(mass, 1.0, 1.0, 0.5, 0.2).mass * 2.0)
    assert float(kinetic(-1.0)) == -2.0


def test_wrong_integrals():
    block = CoulombOscillator(**OSCILLATOR)
    with pytest.raises(ValueError, match=r"units\['x'\] = .*: it must be named unlike .* x, v"):
        WithIntegrals(block, lambda *_: {"x": jnp.zeros(())}, units={"x": "J"})
