"""Two guards in one step: one dips below zero before the other crosses it."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss


class Place(NamedTuple):
    x: Any


class Passing(ss.AbstractHybridSystem):
    """At unit speed past a shallow ditch at x = 0.5, `width` wide to each side, to a wall at x = 1."""

    width: float

    mode_names: ClassVar = ("before", "ditch", "wall")
    guard_names: ClassVar = ("wall", "ditch")
    guard_scales: ClassVar = (1.0, 1.0)

    def vector_field(self, t, y, mode, args):
        return Place(jnp.ones_like(y.x))

    def guards(self, t, y, mode, args):
        ditch = (y.x - 0.5) ** 2 - self.width**2
        return jnp.where(mode == 2, 1.0, 1.0 - y.x), jnp.where(mode == 0, ditch, 1.0)

    def transition(self, t, y, mode, guard, args):
        return y, jnp.where(guard == 0, 2, 1)

    def initial_mode(self, t, y, args):
        return 0


@pytest.mark.parametrize("width", [0.1, 1e-2, 1e-4])
@pytest.mark.parametrize("end", [1.05, 1.3, 2.0])
@pytest.mark.parametrize("step", [ss.FixedStep(3.0), ss.AdaptiveStep(1e-10)])
def test_the_dip_comes_first(width, end, step):
    run = ss.simulate(Passing(width), 0.0, end, Place(0.0), integrator=ss.Integrator(step=step))
    assert int(run.num_events) == 2
    np.testing.assert_array_equal(run.events.guard[:2], [1, 0])
    np.testing.assert_allclose(run.events.t[:2], [0.5 - width, 1.0], atol=1e-9)
