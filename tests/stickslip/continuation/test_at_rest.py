"""Bodies that rest for a while, or all the time; what lies beside events; against simpler systems."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, orbit_guess, periodic_orbit
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from tests.stickslip.continuation._systems import (
    CoulombForced,
    Cycle,
    Motion,
    Radial,
    Stopped,
    of_frequency,
    whole_turn,
)

pytestmark = pytest.mark.slow


def at_rest_in_between(frequency=0.25):
    """Den Hartog's block, which rests at both ends of its way; guess with the start in a slip."""
    system, period = CoulombForced(2.0, frequency), 2 * np.pi / frequency
    guess = orbit_guess(
        system, Motion(0.1, 0.0), transient=30 * period, max_period=1.1 * period,
        forcing_period=period,
    )  # fmt: skip
    return system, period, periodic_orbit(system, guess, forced=True)


def test_a_body_that_rests_at_the_start_does_not_repeat():
    """Its state is the same for a sixtieth of the period and longer."""
    system, period, orbit = at_rest_in_between()
    times, after = np.asarray(orbit.events.t)[:4], np.asarray(orbit.events.mode_after)[:4]
    (k, *_) = np.flatnonzero(after[:3] == 1)
    middle = 0.5 * (times[k] + times[k + 1])
    assert times[k + 1] - times[k] > period / 30
    run = ss.simulate(system, orbit.t0, middle, orbit.y0, orbit.mode0)
    for turns in (1, 2):
        found = periodic_orbit(
            system, OrbitGuess(run.y1, turns * period, run.mode1, middle), forced=True
        )
        assert bool(found.successful)
        assert int(found.repeats) == turns
        np.testing.assert_allclose(found.multipliers[0], orbit.multipliers[0] ** turns, rtol=1e-8)


def test_borders_do_not_depend_on_the_step():
    """Several within one of the long steps; the branch ends at the bound, not before."""
    system, _, orbit = at_rest_in_between()
    found = []
    for step in (0.02, 0.12):
        branch = continue_orbit(
            system,
            orbit,
            "frequency",
            (0.07, 0.3),
            forcing_period=of_frequency,
            follow=Follow(step=step, tests={"level": lambda orbit: orbit.highest.x - 2.125}),
        )
        found.append([(s.label, s.value) for s in branch.specials])
        assert [end.value for end in branch["EP"]] == pytest.approx([0.07, 0.3], abs=1e-12)
    assert [label for label, _ in found[0]] == [label for label, _ in found[1]]
    assert sum(label == "GR" for label, _ in found[0]) >= 5
    np.testing.assert_allclose(*([value for _, value in one] for one in found), atol=1e-7)


class Pair(AbstractMechanism):
    """Two masses; the second, at rest all the time, is pulled by the spring between them."""

    amplitude: Any
    frequency: Any
    coordinates: ClassVar = {"x": "m", "z": "m"}
    contact_directions: ClassVar = {"a": {"x": 1.0}, "b": {"z": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0, "z": 1.0}

    def forces(self, t, q, v, args):
        between = 0.5 * (q.z - q.x)
        pull = self.amplitude * jnp.cos(self.frequency * t)
        return {"x": pull - q.x - 0.1 * v.x + between, "z": -q.z - between}

    def contacts(self, t, q, v, args):
        return {"a": Contact(Coulomb(0.3, 0.2)), "b": Contact(Coulomb(3.0))}

    def time_scale(self, args):
        return 1.0 / self.frequency


class Alone(AbstractMechanism):
    """The first of them, on a spring to where the second one is."""

    amplitude: Any
    frequency: Any
    place: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"a": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        pull = self.amplitude * jnp.cos(self.frequency * t)
        return {"x": pull - q.x - 0.1 * v.x + 0.5 * (self.place - q.x)}

    def contacts(self, t, q, v, args):
        return {"a": Contact(Coulomb(0.3, 0.2))}

    def time_scale(self, args):
        return 1.0 / self.frequency


def test_a_contact_that_sticks_all_the_time():
    """The orbit, its multipliers and its branch are those of the other mass alone."""
    period = 2 * np.pi / 0.7
    pair, alone = Pair(1.5, 0.7), Alone(1.5, 0.7, 0.1)
    options = {"transient": 30 * period, "max_period": 1.1 * period, "forcing_period": period}
    guess = orbit_guess(pair, pair.state(x=0.5, z=0.1), **options)
    both = periodic_orbit(pair, guess, forced=True)
    one = periodic_orbit(alone, orbit_guess(alone, alone.state(x=0.5), **options), forced=True)
    assert bool(both.successful)
    assert float(both.y0.v_z) == 0.0
    assert int(both.events.count) == int(one.events.count) == 2
    assert float(both.highest.x) == pytest.approx(float(one.highest.x), abs=1e-8)
    # That of the place of the second mass, which may rest anywhere nearby, is 1.
    found = np.sort(np.abs(np.asarray(both.multipliers)))
    np.testing.assert_allclose(
        found, [0.0, *np.sort(np.abs(np.asarray(one.multipliers))), 1.0], atol=1e-9
    )


def test_extremes_are_those_between_events_and_at_them():
    """The stop is not passed, and the speed after the impact counts (SciPy, to the digits given)."""
    system, period = Stopped(1.0), 2 * np.pi
    guess = orbit_guess(
        system, Motion(0.0, 0.0), transient=400 * period, max_period=1.5 * period, forcing_period=period
    )
    orbit = periodic_orbit(system, guess, forced=True)
    assert float(orbit.highest.x) == 1.0
    assert float(orbit.lowest.v) == pytest.approx(-1.3565863501, abs=2e-9)
    assert float(orbit.lowest.x) == pytest.approx(-1.1840600869, abs=2e-9)
    assert float(orbit.highest.v) == pytest.approx(1.7043228068, abs=2e-9)
    block, period, orbit = at_rest_in_between(0.6148)
    for part in (0.0, 0.3, 0.7):
        start = orbit.t0 + part * period
        run = ss.simulate(block, orbit.t0, start, orbit.y0, orbit.mode0)
        found = periodic_orbit(block, OrbitGuess(run.y1, period, run.mode1, start), forced=True)
        assert float(found.highest.x) == pytest.approx(2.8019717716, abs=2e-9)
        assert float(found.lowest.x) == pytest.approx(-2.8019717716, abs=2e-9)


def test_grazing_is_known_as_well_from_the_side_of_impacts():
    """Closed form: A = 0.1; the orbits with impact end there as the root of the distance."""
    system, period = Stopped(0.2), 2 * np.pi
    guess = orbit_guess(
        system, Motion(0.0, 0.0), transient=300 * period, max_period=1.5 * period, forcing_period=period
    )
    for step in (0.02, 0.1):
        branch = continue_orbit(
            system, guess, "amplitude", (0.05, 0.3), forcing_period=whole_turn, follow=Follow(step=step)
        )
        (graze,) = branch["GR"]
        assert graze.value == pytest.approx(0.1, abs=1e-10)
        assert int(graze.orbit.events.count) == 0


@pytest.mark.parametrize("turns", [7, 11])
def test_turns_that_no_part_of_sixty_shows(turns):
    guess = OrbitGuess(Cycle(1.1, 0.0), 2 * np.pi * turns)
    branch = continue_orbit(Radial(0.2), guess, "a", (0.1, 0.3), follow=Follow(step=0.2))
    np.testing.assert_allclose(np.asarray(branch.orbits.period), 2 * np.pi, rtol=1e-9)
