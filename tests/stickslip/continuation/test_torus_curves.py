"""Curves of torus points over two parameters, against closed forms."""

from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import (
    Follow,
    OrbitGuess,
    continue_orbit,
    continue_point,
    periodic_orbit,
)


class Torus(NamedTuple):
    x: Any
    y: Any
    p: Any
    q: Any


class Pair(ss.AbstractSmoothSystem):
    r"""Cycle $r = 1$ of period $2\pi$, with a pair of multipliers $e^{2\pi(a \pm i b)}$."""

    a: Any
    b: Any
    units: ClassVar = {"x": "1", "y": "1", "p": "1", "q": "1"}

    def vector_field(self, t, y, mode, args):
        grow = 1.0 - y.x**2 - y.y**2
        small = self.a - y.p**2 - y.q**2
        # The pair is coupled to the cycle: its period does not depend on it.
        return Torus(
            grow * y.x - y.y, grow * y.y + y.x, small * y.p - self.b * y.q + 0.1 * y.p * grow,
            small * y.q + self.b * y.p,
        )  # fmt: skip


class Beside(NamedTuple):
    torus: Any
    u: Any
    w: Any


class BesideUndamped(Pair):
    """The same with an oscillator that nothing drives or damps: its pair stays on the unit circle."""

    units: ClassVar = {"torus.x": "1", "torus.y": "1", "torus.p": "1", "torus.q": "1"}

    def vector_field(self, t, y, mode, args):
        return Beside(super().vector_field(t, y.torus, mode, args), y.w, -2.0 * y.u)


def test_a_torus_point_is_seen_beside_a_mode_without_damping():
    """The pair on the circle was the nearest to it on both sides of the point, and hid it."""
    system = BesideUndamped(-0.05, 0.3)
    start = Beside(Torus(1.0, 0.0, 0.0, 0.0), 0.0, 0.0)
    orbit = periodic_orbit(system, OrbitGuess(start, 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (-0.1, 0.1), follow=Follow(step=0.1))
    (torus,) = branch["NS"]
    assert torus.value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_torus_points_pass_strong_resonances():
    """Of multipliers $e^{2\\pi(a \\pm ib)}$ the pair is a third or a fourth root of 1 there."""
    system = Pair(-0.05, 0.3)
    orbit = periodic_orbit(system, OrbitGuess(Torus(1.0, 0.0, 0.0, 0.0), 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (-0.1, 0.1), follow=Follow(step=0.1))
    (torus,) = branch["NS"]
    assert torus.value == pytest.approx(0.0, abs=1e-9)
    curve = continue_point(
        system,
        torus,
        ("a", "b"),
        ((-0.1, 0.1), (0.05, 0.45)),
        follow=Follow(values=((), (0.3, 0.2)), step=0.1),
    )
    np.testing.assert_allclose(curve.values[:, 0], 0.0, atol=1e-9)
    found = {special.label: special for special in curve.specials}
    for label, b in (("R4", 1 / 4), ("R3", 1 / 3)):
        assert found[label].values[1] == pytest.approx(b, abs=1e-9)
        assert float(found[label].system.b) == found[label].values[1]
        low, high = sorted(curve.values[found[label].index : found[label].index + 2, 1])
        assert low <= b <= high
    assert sorted(float(point.values[1]) for point in curve["UZ"]) == [0.2, 0.3]
    assert [end.words for end in curve.ends] == ["bounds of b"] * 2
    assert [float(end.system.b) for end in curve.ends] == [end.values[1] for end in curve.ends]


class Real(Pair):
    r"""The same with the pair $e^{2\pi(a \pm i\sqrt b)}$, which is real for b < 0."""

    def vector_field(self, t, y, mode, args):
        grow = 1.0 - y.x**2 - y.y**2
        small = self.a - y.p**2 - y.q**2
        return Torus(grow * y.x - y.y, grow * y.y + y.x, small * y.p - self.b * y.q, small * y.q + y.p)


@pytest.mark.slow
def test_torus_points_end_where_the_pair_becomes_real():
    system = Real(-0.05, 0.09)
    orbit = periodic_orbit(system, OrbitGuess(Torus(1.0, 0.0, 0.0, 0.0), 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (-0.1, 0.1), follow=Follow(step=0.1))
    curve = continue_point(
        system, branch["NS"][0], ("a", "b"), ((-0.1, 0.1), (-0.2, 0.2)), follow=Follow(step=0.1)
    )
    (one,) = curve["R1"]
    np.testing.assert_allclose(one.values, 0.0, atol=1e-8)
    (end,) = [end for end in curve.ends if end.words.startswith("R1")]
    np.testing.assert_array_equal(end.values, one.values)
    assert [round(float(point.values[1]), 9) for point in (*curve["R4"], *curve["R3"])] == [
        0.0625, 0.111111111,
    ]  # fmt: skip


class Ring(Pair):
    r"""The same with multipliers $e^{2\pi(a^2 + b^2 - 0.04 \pm 0.3i)}$."""

    def vector_field(self, t, y, mode, args):
        return Pair(self.a**2 + self.b**2 - 0.04, 0.3).vector_field(t, y, mode, args)


@pytest.mark.slow
def test_a_curve_that_comes_round_is_closed():
    system = Ring(0.0, 0.1)
    orbit = periodic_orbit(system, OrbitGuess(Torus(1.0, 0.0, 0.0, 0.0), 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (0.0, 0.3), follow=Follow(step=0.1))
    (torus,) = branch["NS"]
    assert torus.value == pytest.approx(np.sqrt(0.03), abs=1e-9)
    curve = continue_point(
        system, torus, ("a", "b"), ((-0.5, 0.5), (-0.5, 0.5)), follow=Follow(step=0.05)
    )
    a, b = curve.values.T
    np.testing.assert_allclose(np.hypot(a, b), 0.2, atol=1e-9)
    assert curve.ends[-1].words.startswith("closed")
    turned = np.unwrap(np.arctan2(b, a))
    assert abs(turned[-1] - turned[0]) == pytest.approx(2 * np.pi, abs=0.3)  # once, not twice
