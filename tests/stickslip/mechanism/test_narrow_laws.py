"""Friction that weakens within a tiny speed: the step that ends at rest has to see it."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

import stickslip as ss
from stickslip.friction import Stribeck
from stickslip.hybrid import _event_decision
from stickslip.mechanism import AbstractMechanism, Contact

STATIC, KINETIC = 1.0, 0.6


class Thrown(AbstractMechanism):
    """1 kg on rough ground."""

    speed: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Stribeck(STATIC, KINETIC, self.speed))}


def stop(start, speed):
    """When and where it comes to rest."""

    def friction(v):
        return KINETIC + (STATIC - KINETIC) * np.exp(-((v / speed) ** 2))

    edges = [v for v in (0.0, speed, 3.0 * speed, 10.0 * speed) if v < start] + [start]
    pieces = list(zip(edges[:-1], edges[1:], strict=True))

    def total(f):
        return sum(scipy.integrate.quad(f, a, b, epsabs=0, epsrel=1e-13)[0] for a, b in pieces)

    return total(lambda v: 1.0 / friction(v)), total(lambda v: v / friction(v))


def stopped(number, integrator=None):
    """Starts, Stribeck speeds, and when and where each block stops."""
    rng = np.random.default_rng(8)
    start, speed = rng.uniform(0.5, 3.0, number), 10 ** rng.uniform(-4, -0.5, number)

    @jax.jit
    @jax.vmap
    def run(start, speed):
        block = Thrown(speed)
        begin = block.state(v_x=start)
        found = ss.simulate(block, 0.0, 10.0, begin, integrator=integrator, throw=False)
        return found.events.t[0], found.y1.x, found.num_events, found.flags

    t, x, events, flags = run(jnp.asarray(start), jnp.asarray(speed))
    np.testing.assert_array_equal(events, 1)
    assert not np.any(flags)
    true = np.array([stop(*row) for row in zip(start, speed, strict=True)])
    return np.abs(t - true[:, 0]), np.abs(x - true[:, 1])


@pytest.mark.parametrize("number", [60, pytest.param(2000, marks=pytest.mark.slow)])
def test_when_and_where_a_block_comes_to_rest(number):
    late, off = stopped(number)
    assert np.max(late) < 1e-8
    assert np.max(off) < 1e-8


def test_without_the_error_of_the_last_step_most_are_wrong(monkeypatch):
    """The fault this file is about, planted: what ends on an event is not judged by its error."""
    monkeypatch.setattr(_event_decision, "SECTION", _event_decision.COLLAPSED)
    another = ss.Integrator(max_steps=99_999)  # or the program of the test above were used
    late, _ = stopped(60, another)
    assert np.mean(late > 1e-6) > 0.3
