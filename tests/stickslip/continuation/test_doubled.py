"""Orbits of several turns, and those that double, where all of them are known in closed form."""

from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, Shooting, continue_orbit, periodic_orbit

pytestmark = pytest.mark.slow


class Band(NamedTuple):
    x: Any
    y: Any
    p: Any
    q: Any


class Twisted(ss.AbstractSmoothSystem):
    r"""Cycle $r = 1$, $\theta = t$ in a band with half a twist: $z = R(\theta/2) w$,
    $\dot w = (a w_1, -w_2) - |w|^2 w$. Multipliers $-e^{2\pi a}, -e^{-2\pi}, e^{-4\pi}$; from $a = 0$
    on there is the orbit $|z|^2 = a$ of period $4\pi$, multipliers $e^{-8\pi a}, e^{-4\pi(1+a)}$."""

    a: Any
    units: ClassVar = {"x": "1", "y": "1", "p": "1", "q": "1"}

    def vector_field(self, t, y, mode, args):
        grow = 1.0 - y.x**2 - y.y**2
        mean, part = 0.5 * (self.a - 1.0), 0.5 * (self.a + 1.0)
        small = mean - y.p**2 - y.q**2
        return Band(
            grow * y.x - y.y,
            grow * y.y + y.x,
            small * y.p + part * (y.x * y.p + y.y * y.q) - 0.5 * y.q,
            small * y.q + part * (y.y * y.p - y.x * y.q) + 0.5 * y.p,
        )


class Saddle(ss.AbstractSmoothSystem):
    r"""Cycle $r = 1$; $\dot p = 0.1 p$, $\dot q = (a - 0.1) q$: at $a = 0$ the multipliers of a saddle
    have the product 1."""

    a: Any
    units: ClassVar = {"x": "1", "y": "1", "p": "1", "q": "1"}

    def vector_field(self, t, y, mode, args):
        grow = 1.0 - y.x**2 - y.y**2
        return Band(grow * y.x - y.y, grow * y.y + y.x, 0.1 * y.p, (self.a - 0.1) * y.q)


def test_a_neutral_saddle_is_no_torus_point():
    guess = OrbitGuess(Band(1.0, 0.0, 0.0, 0.0), 2 * np.pi)
    branch = continue_orbit(Saddle(-0.05), guess, "a", (-0.06, 0.06), follow=Follow(step=0.2))
    found = np.asarray(branch.orbits.multipliers)
    products = np.real(found[:, 0] * found[:, 1])
    assert products.min() < 1.0 < products.max()
    assert [special.label for special in branch.specials] == ["EP", "EP"]


OPTIONS = {"bounds": (-0.1, 0.1), "follow": Follow(step=0.2)}


@pytest.fixture(scope="module")
def twice():
    """The branch of the cycle, from a guess of two turns."""
    guess = OrbitGuess(Band(1.0, 0.0, 0.0, 0.0), 4 * np.pi)
    return continue_orbit(Twisted(-0.05), guess, "a", **OPTIONS)


def test_the_shortest_period_is_taken_where_the_orbit_is_traced_twice(twice):
    """Round twice the multipliers are squares: what is a doubling would be a branch point."""
    np.testing.assert_allclose(np.asarray(twice.orbits.period), 2 * np.pi, rtol=1e-10)
    assert (np.asarray(twice.orbits.repeats) == 1).all()
    (flip,) = twice["PD"]
    assert flip.value == pytest.approx(0.0, abs=1e-9)
    assert not twice["BP"]
    largest = np.asarray(twice.orbits.multipliers)[:, 0]
    np.testing.assert_allclose(largest, -np.exp(2 * np.pi * twice.values), rtol=1e-9)
    assert (np.asarray(twice.orbits.stable) == (twice.values < 0)).all()


def test_an_orbit_of_two_turns_says_so():
    guess = OrbitGuess(Band(1.0, 0.0, 0.0, 0.0), 4 * np.pi)
    found = periodic_orbit(Twisted(-0.05), guess)
    assert int(found.repeats) == 2
    assert complex(found.multipliers[0]) == pytest.approx(np.exp(-0.2 * np.pi), abs=1e-9)
    assert "2 turns of a shorter one" in str(found)


@pytest.mark.parametrize("segments", [1, 2, 3, 8])
def test_orbits_of_twice_the_period_begin_at_the_doubling(twice, segments):
    (flip,) = twice["PD"]
    doubled = continue_orbit(Twisted(-0.05), flip, "a", shooting=Shooting(segments=segments), **OPTIONS)
    a, y = doubled.values, doubled.orbits.y0
    np.testing.assert_allclose(np.asarray(doubled.orbits.period), 4 * np.pi, rtol=1e-9)
    np.testing.assert_allclose(np.asarray(y.p) ** 2 + np.asarray(y.q) ** 2, a, atol=1e-9)
    assert a.min() < 1e-3
    assert doubled["EP"][-1].value == pytest.approx(0.1, abs=1e-12)
    found = np.asarray(doubled.orbits.multipliers)[:, 0]
    np.testing.assert_allclose(found, np.exp(-8 * np.pi * a), rtol=1e-7)
    assert np.asarray(doubled.orbits.stable).all()


class Bubble(Twisted):
    """The same of $10 a (0.1 - a)$: the orbit of period $4\\pi$ begins at $a = 0$ and ends at 0.1."""

    def vector_field(self, t, y, mode, args):
        return Twisted(10 * self.a * (0.1 - self.a)).vector_field(t, y, mode, args)


@pytest.mark.parametrize("step", [0.25, 0.2, 0.07, 0.01])
def test_a_branch_of_doubled_orbits_ends_where_it_meets_the_other_doubling(step):
    """It leaps to the orbit that it doubles at no step, and is not followed into its mirror image."""
    options = {"bounds": (-0.1, 0.2), "follow": Follow(step=step)}
    guess = OrbitGuess(Band(1.0, 0.0, 0.0, 0.0), 2 * np.pi)
    branch = continue_orbit(Bubble(-0.05), guess, "a", **options)
    assert [flip.value for flip in branch["PD"]] == pytest.approx([0.0, 0.1], abs=1e-9)
    for flip, end in zip(branch["PD"], (0.1, 0.0), strict=True):
        doubled = continue_orbit(Bubble(-0.05), flip, "a", **options)
        a, y = doubled.values, doubled.orbits.y0
        size = np.asarray(y.p) ** 2 + np.asarray(y.q) ** 2
        np.testing.assert_allclose(size, 10 * a * (0.1 - a), atol=1e-9)
        assert (np.diff(a) * (end - flip.value) > 0).all()
        (last,) = doubled.specials
        assert last.words == "repeats: a branch of a shorter period is met"
        assert last.value == pytest.approx(end, abs=1e-9)
        assert float(last.orbit.period) == pytest.approx(2 * np.pi, rel=1e-9)
