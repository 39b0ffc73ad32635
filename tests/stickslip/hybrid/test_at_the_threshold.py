"""A block that stops just where friction can hold it: rounding decides what comes next, and says so."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.hybrid.status import GRAZING
from stickslip.mechanism import AbstractMechanism, Contact
from tests.stickslip.mechanism._machines import Oscillator


def runs(start, mass, stiffness, limit, tolerance, t0=0.0):
    """Friction that drops to a half: a swing is shorter by limit / stiffness than the last.

    `start` in units of limit / stiffness: from 4 the block turns at -3, 2 and -1, where the spring
    pulls just as strongly as friction can hold.
    """

    def one(start, mass, stiffness, limit):
        block = Oscillator(mass, stiffness, Coulomb(limit, 0.5 * limit), 0.0)
        length, period = limit / stiffness, 2 * jnp.pi * jnp.sqrt(mass / stiffness)
        solver = ss.Integrator("dop853", ss.AdaptiveStep(tolerance))
        y0 = block.state(x=start * length)
        run = ss.simulate(block, t0, t0 + 4.0 * period, y0, integrator=solver, throw=False)
        return run.y1.x / length, run.num_events, run.flags, run.successful

    found = jax.jit(jax.vmap(one))(*np.broadcast_arrays(start, mass, stiffness, limit))
    return map(np.asarray, found)


@pytest.mark.more
def test_a_stop_at_the_very_threshold_is_flagged():
    rng = np.random.default_rng(0)
    scales = 10.0 ** rng.uniform(-3, 3, (3, 60))
    for tolerance in (1e-6, 1e-11):
        _, _, flags, ok = runs(4.0, *scales, tolerance)
        assert np.all(ok)
        assert np.all(flags & GRAZING), f"{tolerance}: {np.sum(flags == 0)} of 60 not flagged"


@pytest.mark.more
def test_round_numbers_are_flagged():
    masses, stiffnesses, limits = np.meshgrid([0.5, 1.0, 2.0], [0.5, 1.0, 2.0, 4.0], [0.25, 1.0, 8.0])
    rows = [a.ravel() for a in (masses, stiffnesses, limits)]
    _, _, flags, _ = runs(4.0, *rows, 1e-10)
    assert np.all(flags & GRAZING)


@pytest.mark.more
def test_beside_the_threshold_the_motion_is_that_of_the_closed_form():
    # Of the flagged ones nothing is claimed; at a distance of 1e-5 none is flagged any more.
    distances = 10.0 ** np.arange(-13.0, -1.9, 0.5)
    for sign in (-1.0, 1.0):
        x, _, flags, ok = runs(4.0 + sign * distances, 1.0, 1.0, 1.0, 1e-10)
        # It holds at -1 + distance; at -1 - distance it gives way and turns once more, near zero.
        rest = -1.0 + distances if sign < 0 else 0.0 + distances
        assert np.all(ok)
        told = flags == 0
        np.testing.assert_allclose(x[told], rest[told], atol=1e-7)
        assert np.all(told[distances > 0.9999e-5])
        # One that just gives way goes on as the closed form says; one that just holds is told.
        assert sign > 0 or not np.any(told[distances < 1e-8])


@pytest.mark.more
def test_a_start_at_rest_at_the_threshold():
    _, events, flags, _ = runs([1.0, 0.999, -1.0, 0.5], 1.0, 1.0, 1.0, 1e-10)
    assert list(flags & GRAZING) == [GRAZING, 0, GRAZING, 0]
    assert np.all(events == 0)


class Held(AbstractMechanism):
    """A block that friction can just hold, beside one on a spring that turns and stops."""

    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"held": {"x": 1.0}, "slides": {"y": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 0.5, "y": -q.y}

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(0.5)), Contact(Coulomb(0.5))]


@pytest.mark.more
def test_what_rests_on_zero_does_not_disturb_what_is_located_beside_it():
    """A swing lasts half a period and is shorter by 1 m than the last."""
    found = ss.simulate(Held(), 0.0, 20.0, Held().state(y=3.0), throw=False)
    assert bool(found.successful)
    assert int(found.flags) == GRAZING
    np.testing.assert_allclose(found.events.t[:3], np.pi * np.arange(1, 4), rtol=1e-10)
    np.testing.assert_allclose(found.y1.y, 0.0, atol=1e-9)
    assert float(found.y1.x) == 0.0
    assert int(found.num_events) == 3
