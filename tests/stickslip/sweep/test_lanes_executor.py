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


def test_a_sweep_traces_its_function_once_and_another_sweep_again():
    """One trace serves shapes, identity and program; what was altered since is seen by the next."""
    calls, factor = [], 2.0

    def lane(a):
        calls.append(a)
        return factor * a

    for factor in (2.0, 3.0):
        calls.clear()
        found = ss.sweep.run_sweep(lane, {"a": [1.0, 2.0, 3.0]}, executor="portable", workers=1)
        assert found["value"].values.tolist() == [factor, 2 * factor, 3 * factor]
        assert len(calls) == 1
