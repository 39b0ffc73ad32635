"""Newton's method may end on another branch, or at none: what is refused, and what is said."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, Shooting, _orbits, continue_orbit
from stickslip.continuation._arguments import concrete_guess, problem_of
from stickslip.continuation._corner import led_back
from stickslip.continuation._family import Failure
from stickslip.continuation._orbits import alike
from stickslip.continuation._point import begin, correct, leaps
from stickslip.continuation._points import border

from ._systems import Motion
from .test_doubled import Band, Twisted

pytestmark = pytest.mark.slow


class Rings(ss.AbstractHybridSystem):
    r"""$\dot r = -r(r-1)(r-1.05)(r-1.1)$, $\dot\theta = 1$; beyond $x = a$ it is in another mode.

    The cycles $r = 1$ and $r = 1.1$ have no events where $a > r$, and two where $a < r$.
    """

    a: Any
    mode_names: ClassVar = ("within", "beyond")
    guard_names: ClassVar = ("out", "in")

    def vector_field(self, t, y, mode, args):
        r = (y.x**2 + y.v**2) ** 0.5
        grow = -(r - 1.0) * (r - 1.05) * (r - 1.1)
        return Motion(grow * y.x - y.v, grow * y.v + y.x)

    def guards(self, t, y, mode, args):
        return jnp.where(mode == 0, self.a - y.x, 1.0), jnp.where(mode == 1, y.x - self.a, 1.0)

    def transition(self, t, y, mode, guard, args):
        return y, 1 - mode

    def initial_mode(self, t, y, args):
        return jnp.where(y.x > self.a, 1, 0)


class Growing(ss.AbstractSmoothSystem):
    r"""$\dot r = a - r$, $\dot\theta = 1$."""

    a: Any

    def vector_field(self, t, y, mode, args):
        r = (y.x**2 + y.v**2) ** 0.5
        return Motion((self.a - r) * y.x / r - y.v, (self.a - r) * y.v / r + y.x)


def cycle(r):
    return OrbitGuess(Motion(-r, 0.0), 2 * np.pi, 0, 0.0)


def problem_for(system, guess, value, span=0.2):
    known = concrete_guess(system, guess, None)
    return problem_of(
        system, {"a": value}, [span], known, None, args=None, shooting=Shooting(max_events=64)
    )  # fmt: skip


def begun(problem, guess, value):
    return begin(problem, concrete_guess(problem.system, guess, None), value)


def test_an_orbit_beyond_a_border_is_one_of_a_branch_that_leads_back_to_it():
    """The other cycle has the sequence of modes that is wanted, and its branch passes by."""
    problem = problem_for(Rings(1.02), cycle(1.0), 1.02)
    start = begun(problem, cycle(1.0), 1.02)
    down = start if start.tangent[-1] < 0 else start.backward()
    last, _ = border(problem, down, 0.2, alike(down))
    assert last.value == pytest.approx(1.0, abs=1e-8)
    along = np.eye(last.u.size)[-1:]  # at a = 0.99 both: states in parts of the diameter, a of the span
    moves = ([0.0, 0.0, 0.0, -0.05], [-0.05, 0.0, 0.0, -0.05])
    own, other = (correct(problem, last.u + m, last.modes, last.anchor, along, None) for m in moves)
    assert np.hypot(*other.orbit.y0) == pytest.approx(1.1, abs=1e-9)
    assert own.sequence == other.sequence != last.sequence
    way = led_back(problem, last, own)
    assert way is not None
    assert all(np.hypot(*p.orbit.y0) == pytest.approx(1.0, abs=1e-9) for p in way)
    assert led_back(problem, last, other) is None
    assert led_back(problem, last, start) is None  # the branch itself, back again


def test_an_orbit_that_repeats_itself_is_none_of_the_branch_that_doubles_it():
    """At a = 1e-4 the two are a hundredth apart, and no distance tells them from each other."""
    guesses = [OrbitGuess(Band(1.0, 0.0, p, 0.0), 4 * np.pi) for p in (0.0, 1e-2)]
    problem = problem_for(Twisted(1e-4), guesses[0], 1e-4)
    single, double = (begun(problem, guess, 1e-4) for guess in guesses)
    assert int(single.orbit.repeats) == 2
    assert int(double.orbit.repeats) == 1
    assert leaps(double, single, 1.0)


@pytest.mark.parametrize(
    ("name", "test", "words"),
    [
        ("jump", lambda orbit: 1.0 if orbit.y0.x > -1.013 else -1.0, "jumps"),  # nowhere zero
        ("pole", lambda orbit: 1.0 / (orbit.y0.x + 1.013), "jumps"),
        ("gap", lambda orbit: np.nan if abs(orbit.y0.x + 1.013) < 1e-4 else orbit.y0.x + 1.013, "nan"),
    ],
)
def test_a_change_of_sign_without_a_zero_has_a_question_mark(name, test, words):
    """Of the cycle r = a of the moving ring."""
    branch = continue_orbit(
        Growing(1.0),
        cycle(1.0),
        "a",
        (1.0, 1.1),
        follow=Follow(
            step=0.07, both=False, tests={name: test, "zero": lambda orbit: orbit.y0.x + 1.013}
        ),
    )
    (zero,) = branch["zero"]
    assert zero.value == pytest.approx(1.013, abs=1e-10)
    assert not branch[name]
    (lost,) = branch[name + "?"]
    assert "not located" in lost.words
    assert words in lost.words.lower()
    assert abs(lost.value - 1.013) < 0.01


@pytest.mark.parametrize("reach", [0.1, 0.03])
def test_where_newton_fails_far_away_steps_are_shorter(monkeypatch, reach):
    """No border is searched for there: that takes a hundred times as long, and gets no further."""
    correct, tries = _orbits.correct_from, []

    def near(problem, point, move):
        tries.append(float(np.linalg.norm(move)))
        if tries[-1] >= reach:
            return Failure("not_converged")
        found = correct(problem, point, move)
        return dataclasses.replace(found, evaluations=6 if tries[-1] > 0.1 * reach else 2)

    monkeypatch.setattr(_orbits, "correct_from", near)
    monkeypatch.setattr(_orbits, "border", None)
    branch = continue_orbit(
        Growing(1.0), cycle(1.0), "a", (1.0, 1.1), follow=Follow(step=0.3, both=False)
    )
    assert [(s.label, s.value) for s in branch.specials] == [("EP", pytest.approx(1.1, abs=1e-12))]
    assert len(tries) < 5 * len(branch)
    np.testing.assert_allclose(np.hypot(*map(np.asarray, branch.orbits.y0)), branch.values, rtol=1e-9)
