"""A program of lanes is traced for one executor throughout, the parts traced late among them."""

from typing import Any

import jax
import jax.numpy as jnp
import pytest

import stickslip as ss
from stickslip.hybrid import current_executor
from stickslip.systems import CoulombOscillator, Motion

SEEN: list[bool] = []


class Witness(CoulombOscillator):
    """An oscillator that notes for which executor it is traced."""

    def vector_field(self, t, y, mode, args):
        SEEN.append(current_executor().fused)
        return super().vector_field(t, y, mode, args)

    def transition(self, t, y, mode, guard, args):
        SEEN.append(current_executor().fused)
        return super().transition(t, y, mode, guard, args)


def end(speed: Any) -> Any:
    y0 = Motion(0.0, 0.2)
    return ss.simulate(Witness(1.0, 1.0, 1.0, 0.5, speed), 0.0, 8.0, y0, throw=False).y1.x


@pytest.mark.more
@pytest.mark.parametrize(
    "derivative", [lambda f: f, jax.jacfwd, pytest.param(jax.jacrev, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("executor", ["fused", pytest.param("portable", marks=pytest.mark.slow)])
def test_every_part_is_traced_for_the_executor_of_the_lanes(executor, derivative):
    program = ss.map_lanes(derivative(end), executor=executor, workers=1)
    SEEN.clear()
    program(jnp.linspace(0.1, 0.3, 4))
    assert SEEN
    assert set(SEEN) == {executor == "fused"}
