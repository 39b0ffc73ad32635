"""A guard that leaves zero with no slope but rounding fires where it comes back, not at once.

A block whose friction is just overcome begins to slide like that: its speed is zero, its acceleration
is what rounding leaves, and to take that for a fall would stop it at once, for ever.
"""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid.event_time import event_delay


class Course(NamedTuple):
    value: Any
    rate: Any


class Returning(ss.AbstractHybridSystem):
    """g = s t + t^2 / 2 - t^3, which is zero at 0 and, but for s, at 0.5."""

    mode_names: ClassVar = ("sliding", "stopped")
    guard_names: ClassVar = ("stops",)
    guard_scales: ClassVar = (1.0,)  # the state at the start is rounding and says nothing

    def vector_field(self, t, y, mode, args):
        slides = jnp.where(mode == 0, 1.0, 0.0)
        return Course(slides * y.rate, slides * (1.0 - 6.0 * t))

    def guards(self, t, y, mode, args):
        return (jnp.where(mode == 0, y.value, 1.0),)

    def transition(self, t, y, mode, guard, args):
        return y, jnp.ones_like(mode)

    def initial_mode(self, t, y, args):
        return jnp.zeros((), int)


@pytest.mark.more
@pytest.mark.parametrize(
    "step", [ss.FixedStep(0.7), ss.FixedStep(0.3), ss.AdaptiveStep(1e-10)], ids=str
)
@pytest.mark.parametrize("method", ["dop853", "tsit5"])
def test_the_zero_it_starts_from_is_not_the_event(step, method):
    integrator = ss.Integrator(method, step)

    @jax.jit
    @jax.vmap
    def run(slope):
        start = Course(0.0 * slope, slope)
        return ss.simulate(Returning(), 0.0, 1.0, start, integrator=integrator, throw=False)

    runs = run(jnp.asarray([-1e-14, -1e-16, 0.0, 1e-16, 1e-14]))
    assert np.all(runs.successful)
    assert np.all(runs.num_events == 1)
    np.testing.assert_allclose(runs.events.t[:, 0], 0.5, rtol=0, atol=1e-9)


def test_what_rests_at_zero_has_its_event_here():
    """The delay was 0/0 there, and the lane went on at the time NaN until its steps were used up."""
    assert float(event_delay(jnp.zeros(()), jnp.zeros(()), jnp.ones((), bool))) == 0.0
    assert float(event_delay(jnp.asarray(0.3), jnp.asarray(-2.0), jnp.ones((), bool))) == 0.15
