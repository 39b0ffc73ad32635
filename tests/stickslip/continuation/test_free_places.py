"""Orbits whose place nothing holds: each is one of a family, against closed forms."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, orbit_guess, periodic_orbit
from stickslip.continuation._closing import Closure, Frame, equations
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from tests.stickslip.continuation._systems import Motion, whole_turn

TURN = 2 * np.pi
DAMPING = 0.3


class Sled(ss.AbstractSmoothSystem):
    r"""$\ddot x = g + f\cos t - 0.3\dot x - kx$: for $k = 0$ its place is free, and it drifts."""

    force: Any
    pull: Any
    stiffness: Any

    def vector_field(self, t, y, mode, args):
        load = self.pull + self.force * jnp.cos(t)
        return Motion(y.v, load - DAMPING * y.v - self.stiffness * y.x)

    def time_scale(self, args):
        return 1.0


@pytest.fixture(scope="module")
def sled():
    return lambda *numbers: periodic_orbit(
        Sled(*numbers), OrbitGuess(Motion(5.0, 0.1), TURN), forced=True
    )


@pytest.mark.more
def test_the_place_is_that_of_the_guess(sled):
    found = sled(2.0, 0.0, 0.0)
    assert float(found.y0.x) == 5.0
    # v = a cos t + b sin t
    assert float(found.y0.v) == pytest.approx(2 * DAMPING / (1 + DAMPING**2), abs=1e-11)
    assert found.multipliers.tolist() == [1.0, pytest.approx(np.exp(-DAMPING * TURN), abs=1e-11)]
    assert bool(found.stable)
    assert float(found.drift.x) == pytest.approx(0.0, abs=1e-11)
    assert str(found).endswith("place free along x")


@pytest.mark.more
def test_a_drift_is_said_and_a_spring_is_seen(sled):
    found = sled(2.0, 0.6, 0.0)
    assert float(found.drift.x) == pytest.approx(TURN * 0.6 / DAMPING, abs=1e-10)
    assert "in a period moves on x by 12.566" in str(found)
    for stiffness in (0.5, 1e-6):
        held = sled(2.0, 0.6, stiffness)
        assert not np.any(held.neutral)
        roots = np.exp(TURN * np.roots([1.0, DAMPING, stiffness]))
        assert np.sort_complex(held.multipliers) == pytest.approx(np.sort_complex(roots), abs=1e-9)


def test_an_orbit_beside_its_anchor_has_a_residual_along_the_family():
    """By hand, in parts of 2 m and 0.5 m/s: the map x + v + 0.3, v / 2 + 0.05 has a free place x."""
    size, anchor, zero = jnp.array([2.0, 0.5]), jnp.array([5.0, 0.1]), jnp.zeros(2)
    shift = jnp.array([[1.0, 0.0], [0.0, 0.0]])
    frame = Frame(0.0, TURN, False, anchor, zero, size, shift, np.full(2, np.inf), zero)

    def found_from(u):
        x, v = u * size
        end = jnp.stack([x + v + 0.3, 0.5 * v + 0.05])
        none = jnp.zeros(1, jnp.int32)
        return Closure(end / size - u, end[None], none, none == 0, none, none, none, none)

    begin = jnp.array([7.0, 0.2]) / size
    residual, jacobian, found = jax.jit(lambda u: equations(found_from, u, frame, 1))(begin)
    np.testing.assert_allclose(residual, [(7.0 - 5.0) / 2.0, (0.15 - 0.2) / 0.5], rtol=1e-14)
    np.testing.assert_allclose(jacobian, [[1.0, 0.0], [0.0, 0.5 - 1.0]], atol=1e-14)
    np.testing.assert_allclose(found.neutral, shift, atol=1e-14)


@pytest.mark.slow
def test_a_branch_does_not_run_along_the_family(sled):
    found = sled(2.0, 0.6, 0.0)
    branch = continue_orbit(
        Sled(2.0, 0.6, 0.0),
        found,
        "force",
        (1.0, 4.0),
        forcing_period=whole_turn,
        follow=Follow(step=0.1),
    )
    assert [(s.label, s.words) for s in branch.specials] == [("EP", "bounds"), ("EP", "bounds")]
    assert np.asarray(branch.orbits.stable).all()
    assert np.asarray(branch.orbits.drift.x) == pytest.approx(TURN * 2.0, abs=1e-9)
    with pytest.raises(ValueError, match="is not at others"):
        continue_orbit(Sled(2.0, 0.6, 0.0), found, "stiffness", (0.0, 1.0), forcing_period=whole_turn)


class Pendulum(ss.AbstractSmoothSystem):
    """Without damping: its orbits are a family, by energy."""

    length: Any

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, -jnp.sin(y.x) / self.length)


@pytest.mark.slow
def test_a_family_by_energy_is_refused():
    found = periodic_orbit(Pendulum(1.0), OrbitGuess(Motion(1.0, 0.0), 6.7))
    with pytest.raises(ValueError, match="family, by a conserved quantity"):
        continue_orbit(Pendulum(1.0), found, "length", (0.5, 2.0))


class Pair(NamedTuple):
    x1: Any
    x2: Any
    v1: Any
    v2: Any


class Coupled(ss.AbstractSmoothSystem):
    """Two bodies in space with a hard spring between them, one of them pushed."""

    force: Any

    def vector_field(self, t, y, mode, args):
        away = y.x1 - y.x2
        pull = away + away**3 + 0.2 * (y.v1 - y.v2)
        return Pair(y.v1, y.v2, self.force * jnp.cos(t) - pull - 0.1 * y.v1, 0.5 * (pull - 0.1 * y.v2))

    def time_scale(self, args):
        return 1.0


@pytest.mark.slow
def test_both_are_shifted_together():
    found = periodic_orbit(Coupled(1.0), OrbitGuess(Pair(0.0, 0.3, 0.1, 0.0), TURN), forced=True)
    places = np.asarray(found.neutral)[:2, :2]
    assert places @ np.ones(2) == pytest.approx([1.0, 1.0], abs=1e-12)
    assert np.trace(places) == pytest.approx(1.0, abs=1e-12)
    # The mean of the momenta: the rest of the multipliers are the growth of volume.
    volume = np.prod(np.asarray(found.multipliers))
    assert volume == pytest.approx(np.exp(-TURN * (0.3 + 0.15)), abs=1e-10)


class Turning(ss.AbstractSmoothSystem):
    r"""Rotor, $\ddot x = \tau - \dot x/10$: it does nothing but turn."""

    torque: Any
    periods: ClassVar = {"x": TURN}

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.torque - 0.1 * y.v)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [9.0, -9.9])
def test_what_only_turns_comes_round(speed):
    torque = np.copysign(0.9, speed)
    found = periodic_orbit(Turning(torque), OrbitGuess(Motion(0.2, speed), TURN / 9.0))
    assert float(found.period) == pytest.approx(TURN / 9.0, abs=1e-10)
    assert complex(found.multipliers[0]) == pytest.approx(np.exp(-0.1 * TURN / 9.0), abs=1e-10)


class Body(AbstractMechanism):
    """On the ground under $f\\cos t$, with friction 1: it never sticks for $f^2 > 1 + \\pi^2/4$."""

    force: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": self.force * jnp.cos(t)}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(1.0), 1.0)}

    def time_scale(self, args):
        return 1.0


class Placeless(Body):
    cyclic: ClassVar = ("x",)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Body, Placeless])
def test_a_body_on_the_ground(kind):
    """The same with the place as a state that is free as without it."""
    system = kind(2.0)
    guess = orbit_guess(
        system, system.state(), transient=20 * TURN, max_period=7.0, forcing_period=TURN
    )
    orbit = periodic_orbit(system, guess, forced=True)
    branch = continue_orbit(
        system,
        orbit,
        "force",
        (1.1, 4.0),
        forcing_period=whole_turn,
        follow=Follow(step=0.05, max_points=60),
    )
    assert [s.label for s in branch.specials] == ["EP", "GR", "EP"]
    assert sorted(s.value for s in branch["EP"]) == pytest.approx([1.1, 4.0], abs=1e-8)
    assert branch["GR"][0].value == pytest.approx(np.hypot(1.0, np.pi / 2), abs=1e-8)
    assert np.asarray(branch.orbits.stable).all()
