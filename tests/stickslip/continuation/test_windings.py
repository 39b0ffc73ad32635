"""Angles that go round p times in q periods of a forcing, or each in its own way: against SciPy."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, orbit_guess, periodic_orbit
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from tests.stickslip.continuation._systems import Motion

TURN = 2 * np.pi


class Rotor(ss.AbstractSmoothSystem):
    r"""$\ddot x = \tau + a\cos t - \dot x/10 - 0.3\sin x - kx$: with a spring $x$ is no angle."""

    torque: Any
    force: Any
    spring: Any
    periods: ClassVar = {"x": TURN}

    def time_scale(self, args):
        return 1.0

    def vector_field(self, t, y, mode, args):
        load = self.torque + self.force * jnp.cos(t) - self.spring * y.x
        return Motion(y.v, load - 0.1 * y.v - 0.3 * jnp.sin(y.x))


def flow(field, slope, y, span):
    """State after a time and its derivative by the first one."""
    size = len(y)

    def both(t, w):
        return np.concatenate([field(t, w[:size]), (slope(w) @ w[size:].reshape(size, size)).ravel()])

    start = np.concatenate([y, np.eye(size).ravel()])
    end = solve_ivp(both, (0, span), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end[:size], end[size:].reshape(size, size)


def locked(torque, force, start, p, q):
    """Start and multipliers of the motion that goes round p times in q periods, by shooting."""
    y = np.array(start)
    for _ in range(12):
        end, matrix = flow(
            lambda t, z: [z[1], torque + force * np.cos(t) - 0.1 * z[1] - 0.3 * np.sin(z[0])],
            lambda z: np.array([[0, 1], [-0.3 * np.cos(z[0]), -0.1]]),
            y, q * TURN,
        )  # fmt: skip
        step = np.linalg.solve(matrix - np.eye(2), y + np.array([p * TURN, 0.0]) - end)
        y = y + step
        if np.max(np.abs(step)) < 1e-11:
            break
    return y, np.linalg.eigvals(matrix)


@pytest.mark.more
@pytest.mark.parametrize(
    ("p", "q", "torque", "force", "start"),
    [
        (1, 2, 0.06, 1.0, (2.7, 0.41)),
        (-1, 2, -0.06, 1.0, (2.8, -0.2)),
        (2, 3, 0.07, 1.0, (3.64, 0.965)),
        (3, 2, 0.15, 1.0, (3.38, 1.27)),
        (1, 1, 0.1, 0.5, (1.4, 1.0)),
        (0, 1, 0.06, 1.0, (5.3, -0.1)),
    ],
)
def test_turns_of_the_guess_are_those_of_the_orbit(p, q, torque, force, start):
    found = periodic_orbit(Rotor(torque, force, 0.0), OrbitGuess(Motion(*start), q * TURN), forced=True)
    assert bool(found.successful)
    assert (int(found.turns.x), int(found.turns.v)) == (p, 0)
    assert (f"whole turns x {p}" in str(found)) == (p != 0)
    y, multipliers = locked(torque, force, start, p, q)
    assert np.array(found.y0) == pytest.approx(y, abs=1e-9)
    assert np.sort_complex(found.multipliers) == pytest.approx(np.sort_complex(multipliers), rel=1e-8)


@pytest.mark.more
def test_turns_may_be_given():
    """From this start the motion does not go round; that which does, once, is another orbit."""
    start, system = Motion(5.89, 0.5), Rotor(0.06, 1.0, 0.0)
    for turns, p in ((None, 0), ({"x": 1}, 1)):
        found = periodic_orbit(system, OrbitGuess(start, 2 * TURN, turns=turns), forced=True)
        assert bool(found.successful)
        assert int(found.turns.x) == p
        # Of another orbit as a guess too, which the motion from its start would not say.
        again = periodic_orbit(Rotor(0.062, 1.0, 0.0), found, forced=True)
        assert int(again.turns.x) == p
    for wrong in ({"v": 1}, {"y": 1}):
        with pytest.raises(ValueError, match=r"guess.turns = '.': it must be names with a period: x"):
            periodic_orbit(system, OrbitGuess(start, 2 * TURN, turns=wrong), forced=True)
    with pytest.raises(TypeError, match=r"guess.turns\['x'\]"):
        periodic_orbit(system, OrbitGuess(start, 2 * TURN, turns={"x": 0.5}), forced=True)


@pytest.mark.more
def test_what_is_no_angle_does_not_return_after_a_turn():
    """A shift by the declared period changes the pull of the spring."""
    guess = OrbitGuess(Motion(1.4, 1.0), TURN, turns={"x": 1})
    found = periodic_orbit(Rotor(0.1, 0.5, 0.02), guess, forced=True)
    assert str(found.result) == "period_differs"


class Both(NamedTuple):
    x: Any
    z: Any
    v: Any
    w: Any


class Geared(ss.AbstractSmoothSystem):
    """Two rotors, coupled by the sine of 2x - 3z, one of them under a torque that swings."""

    torque: Any
    force: Any
    periods: ClassVar = {"x": TURN, "z": TURN}

    def time_scale(self, args):
        return 1.0

    def vector_field(self, t, y, mode, args):
        pull = 0.3 * jnp.sin(2 * y.x - 3 * y.z)
        load = self.torque + self.force * jnp.cos(t)
        return Both(y.v, y.w, load - 0.1 * y.v - 2 * pull, 3 * pull - 0.3 * y.w)


def geared(torque, force):
    def field(t, s):
        x, z, v, w = s
        pull = 0.3 * np.sin(2 * x - 3 * z)
        return np.array([v, w, torque + force * np.cos(t) - 0.1 * v - 2 * pull, 3 * pull - 0.3 * w])

    def slope(s):
        c = 0.3 * np.cos(2 * s[0] - 3 * s[1])
        lower = [[-4 * c, 6 * c, -0.1, 0], [6 * c, -9 * c, 0, -0.3]]
        return np.array([[0, 0, 1, 0], [0, 0, 0, 1], *lower])

    return field, slope


@pytest.mark.slow
@pytest.mark.parametrize(("torque", "force", "slips"), [(0.2, 0.5, 0), (0.1, 1.5, 2), (0.4, 2.5, 8)])
def test_angles_of_which_only_a_difference_matters(torque, force, slips):
    """Both are free together; 2x - 3z goes on by whole turns, of which x or z may have a part."""
    field, slope = geared(torque, force)
    y = solve_ivp(lambda t, s: field(t, s), (0, 60 * TURN), np.zeros(4), "DOP853", rtol=1e-9).y[:, -1]
    guess = OrbitGuess(Both(*y), TURN)
    found = periodic_orbit(Geared(torque, force), guess, forced=True)
    assert bool(found.successful)
    start = np.array(found.y0)
    end, matrix = flow(field, slope, start, TURN)
    gained = np.array(found.turns) * TURN + np.array(found.drift)
    assert end - start == pytest.approx(gained, abs=1e-9)
    assert (2 * gained[0] - 3 * gained[1]) / TURN == pytest.approx(slips, abs=1e-9)
    ours, truth = (np.sort_complex(m) for m in (found.multipliers, np.linalg.eigvals(matrix)))
    assert ours == pytest.approx(truth, abs=1e-8)


class Rubbing(AbstractMechanism):
    """A rotor with a weight drives another one, which rubs in its bearing, half as fast."""

    torque: Any
    coordinates: ClassVar = {"x": "rad", "z": "rad"}
    periods: ClassVar = {"x": TURN, "z": TURN}
    contact_directions: ClassVar = {"bearing": {"z": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0, "z": 1.0}

    def forces(self, t, q, v, args):
        pull = 2.0 * jnp.sin(q.x - 2 * q.z)
        load = self.torque - 0.1 * v.x - 0.5 * jnp.sin(q.x)
        return {"x": load - pull, "z": 2 * pull - 0.2 * v.z}

    def contacts(self, t, q, v, args):
        return {"bearing": Contact(Coulomb(0.05), 1.0)}


@pytest.mark.slow
def test_two_rotors_locked_two_to_one():
    system = Rubbing(0.6)
    guess = orbit_guess(system, system.state(v_x=3.0, v_z=1.5), transient=150.0, max_period=8.0)
    orbit = periodic_orbit(system, guess)
    assert (int(orbit.turns.x), int(orbit.turns.z)) == (2, 1)

    def field(t, s):
        pull = 2.0 * np.sin(s[0] - 2 * s[1])
        load = 0.6 - 0.1 * s[2] - 0.5 * np.sin(s[0])
        return np.array([s[2], s[3], load - pull, 2 * pull - 0.2 * s[3] - 0.05 * np.sign(s[3])])

    def slope(s):
        c = 2.0 * np.cos(s[0] - 2 * s[1])
        lower = [[-0.5 * np.cos(s[0]) - c, 2 * c, -0.1, 0], [2 * c, -4 * c, 0, -0.2]]
        return np.array([[0, 0, 1, 0], [0, 0, 0, 1], *lower])

    start = np.array(orbit.y0)
    end, matrix = flow(field, slope, start, float(orbit.period))
    assert end - start == pytest.approx([2 * TURN, TURN, 0, 0], abs=1e-9)
    ours = np.sort_complex(np.append(orbit.multipliers, orbit.trivial))
    assert ours == pytest.approx(np.sort_complex(np.linalg.eigvals(matrix)), abs=1e-8)

    branch = continue_orbit(
        system, orbit, "torque", (0.55, 0.9), follow=Follow(step=0.1, max_points=15)
    )
    assert [end.words for end in branch["EP"]] == ["bounds", "bounds"]
    assert set(np.asarray(branch.orbits.turns.x)) == {2}
    assert set(np.asarray(branch.orbits.turns.z)) == {1}
