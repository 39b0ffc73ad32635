"""Derivatives of crossings between stiff phases, and of what depends on the steps alone.

The derivative is computed in a run of its own. Its steps after a stiff phase end elsewhere than those
of the motion: rounding chooses them. Differences of runs know nothing of that.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.hybrid._loop_state import Known
from stickslip.mechanism import AbstractMechanism, Contact


class Damped(AbstractMechanism):
    """A forced oscillator with a damper of a hundredth of its mass, which sticks and slips."""

    frequency: Any
    limit: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"damper": {"y": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 0.01}

    def forces(self, t, q, v, args):
        between = 0.5 * (q.y - q.x)
        return {"x": 0.1 * jnp.cos(self.frequency * t) - q.x - 0.04 * v.x + between, "y": -between}

    def contacts(self, t, q, v, args):
        return {"damper": Contact(Coulomb(self.limit))}

    def time_scale(self, args):
        return 1.0 / self.frequency


TURNS = ss.Section(lambda system, t, y, dy, mode, args: y.v_x, "both")
P = jnp.array([1.092723, 0.102039])


def run(p, **kept):
    system = Damped(p[0], p[1])
    return ss.simulate(system, 0.0, 12.0, system.state(), throw=False, saveat=ss.SaveAt(**kept))


def crossings(p):
    """Times, places and slopes at four crossings; the damper slips before the last two."""
    found = run(p, sections=TURNS, max_crossings=8).crossings[0]
    return jnp.concatenate([found.t[:4], found.y.x[:4], found.dy.v_x[:4]])


def differences(function, p, h=1e-4):
    """Of the fourth order, from one program."""
    steps = h * jnp.array([1.0, -1.0, 2.0, -2.0])[:, None, None] * jnp.eye(p.size)[None]
    values = jax.jit(jax.vmap(jax.vmap(function)))(p[None, None] + steps)
    near, far = values[0] - values[1], values[2] - values[3]
    return ((8 * near - far) / (12 * h)).T


@pytest.fixture(scope="module")
def slopes():
    return differences(crossings, P)


class Harmonic(ss.AbstractSmoothSystem):
    """From (1, 0) its speed changes sign at multiples of pi over its frequency."""

    frequency: Any

    def vector_field(self, t, y, mode, args):
        x, v = y
        return v, -self.frequency * self.frequency * x


def test_crossings_of_an_oscillator_have_slopes_in_closed_form():
    turns = ss.Section(lambda system, t, y, dy, mode, args: y[1], "both")

    def found(w):
        kept = ss.SaveAt(sections=turns, max_crossings=4, max_events=None)
        row = ss.simulate(Harmonic(w), 0.0, 10.0, (1.0, 0.0), throw=False, saveat=kept).crossings[0]
        return jnp.stack([row.t[:3], row.y[0][:3], row.dy[1][:3]])

    w, k, sign = 1.1, np.arange(1, 4), np.array([-1.0, 1.0, -1.0])
    slopes = jax.jit(jax.jacfwd(found))(w)
    np.testing.assert_allclose(slopes, [-k * np.pi / w**2, 0.0 * k, -2.0 * w * sign], rtol=0, atol=1e-8)


@pytest.mark.more
@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev], ids=["forward", "reverse"])
def test_crossings_have_the_derivatives_of_the_motion(mode, slopes):
    found = jax.jit(mode(crossings))(P)
    assert jnp.max(jnp.abs(slopes[:, 1])) > 0.3
    np.testing.assert_allclose(found, slopes, rtol=0, atol=1e-7)


@pytest.mark.more
@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev], ids=["forward", "reverse"])
def test_fused_lanes_have_the_same_derivatives(mode, slopes):
    found = ss.map_lanes(mode(crossings), executor="fused")(jnp.stack([P, 1.001 * P]))
    np.testing.assert_allclose(found[0], slopes, rtol=0, atol=1e-7)


@pytest.mark.more
def test_steps_have_no_derivatives():
    """Their times are those that the integrator chose: forward they are not numbers, reverse raises."""

    def place(p):
        kept = run(p, steps=True, max_rows=128)
        return kept.steps.y.x[40], kept.y1.x

    step, end = jax.jit(jax.jacfwd(place))(P)
    assert jnp.all(jnp.isnan(step))
    assert jnp.all(jnp.isfinite(end))
    with pytest.raises(NotImplementedError, match="SaveAt\\(steps=True\\)"):
        jax.grad(lambda p: place(p)[0])(P)
    np.testing.assert_allclose(jax.jit(jax.grad(lambda p: place(p)[1]))(P), end, rtol=1e-9)


def linearized(function):
    return lambda p: jax.vmap(jax.linearize(function, p)[1])(jnp.eye(p.size))


@pytest.mark.more
@pytest.mark.parametrize(
    "mode", [jax.jacfwd, linearized, jax.jacrev], ids=["forward", "map", "reverse"]
)
def test_rows_of_another_motion_have_no_derivatives(mode, monkeypatch):
    """Where a run for a derivative alone meets other events, the rows of logs belong to others."""
    monkeypatch.setattr(Known, "is_met", lambda known, lane: lane.events < 0)

    def both(p):
        found = run(p, max_events=8)
        return found.events.t[1], found.y1.x

    of_event, of_end = mode(lambda p: both(p)[0])(P), mode(lambda p: both(p)[1])(P)
    # Forward mode has the rows and their derivatives from one run.
    assert jnp.all(jnp.isfinite(of_event) if mode is jax.jacfwd else jnp.isnan(of_event))
    assert jnp.all(jnp.isfinite(of_end))
