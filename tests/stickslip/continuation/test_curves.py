"""Curves of special points over two parameters, against closed forms and independent integration."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import (
    Follow,
    OrbitGuess,
    continue_orbit,
    continue_point,
    orbit_guess,
    periodic_orbit,
)
from stickslip.continuation._curves import Place
from stickslip.continuation._point import Point
from tests.stickslip.continuation._systems import (
    Bouncing,
    CoulombForced,
    Motion,
    TwoStops,
    WeakeningBlock,
    closed_branch,
    of_frequency,
    whole_turn,
)


@pytest.mark.slow
def test_fold_and_flip_of_the_ball_are_the_closed_forms():
    e, strength = 0.5, 1.3
    phase = -np.arcsin(np.pi * (1 - e) / (1 + e) / strength)
    start = Motion(strength * np.cos(phase) + np.pi**2 / 2, 0.0)
    system = Bouncing(strength, e)
    orbit = periodic_orbit(system, OrbitGuess(start, 2 * np.pi, 0, phase + np.pi), forced=True)
    branch = continue_orbit(
        system, orbit, "strength", (0.9, 1.7), forcing_period=whole_turn, follow=Follow(step=0.02)
    )
    fold = np.pi * (1 - e) / (1 + e)
    flip = np.hypot(fold, 2 * (1 + e * e) / (1 + e) ** 2)
    assert branch["LP"][0].value == pytest.approx(fold, abs=1e-9)
    assert branch["PD"][0].value == pytest.approx(flip, abs=1e-9)
    assert np.asarray(branch.orbits.determinant) == pytest.approx(e * e, abs=1e-9)
    # In order along the branch, from both halves of it; the fold is the least value.
    assert branch.values.min() >= fold - 1e-9
    assert int(np.argmin(branch.values)) - branch["LP"][0].index in (0, 1)
    at = branch["PD"][0].index
    assert sorted([*branch.values[at : at + 2], flip])[1] == flip
    names, bounds = ("strength", "restitution"), ((0.2, 4.0), (0.1, 0.9))
    for label in ("LP", "PD"):
        curve = continue_point(
            system, branch[label][0], names, bounds, forcing_period=whole_turn, follow=Follow(step=0.05)
        )
        strength, e = curve.values.T
        exact = np.pi * (1 - e) / (1 + e)
        if label == "PD":
            exact = np.hypot(exact, 2 * (1 + e * e) / (1 + e) ** 2)
        assert len(curve) > 15
        np.testing.assert_allclose(strength, exact, rtol=1e-10)
        assert (np.diff(e) * np.diff(e)[0] > 0).all()  # in order, from end to end
        assert np.ptp(e) > 0.7
        assert all(end.words.startswith("bounds of ") for end in curve.ends)
        data = curve.to_dataset()
        assert data.sizes["point"] == len(curve)
        assert data.attrs["label"] == label


def den_hartog(w: float, z: float = 0.05) -> float:
    """Force at which pure slip is lost: after a reversal the force on the block is the kinetic one.

    Half a period from rest at X, backwards, is a linear problem in X and the force's two components.
    """

    def end(X, C, S):
        rate = np.zeros((5, 5))  # of x, v, 1, cos wt, sin wt
        rate[0, 1], rate[1] = 1.0, [-1.0, -2 * z, 1.0, C, -S]
        rate[3, 4], rate[4, 3] = -w, w
        return (expm(rate * np.pi / w) @ [X, 0.0, 1.0, 1.0, 0.0])[:2]

    base = end(0.0, 0.0, 0.0)
    x, v = np.transpose([end(*unit) - base for unit in np.eye(3)])
    _, C, S = np.linalg.solve([x + np.eye(3)[0], v, [-1.0, 1.0, 0.0]], [-base[0], -base[1], -1.0])
    return float(np.hypot(C, S))


@pytest.mark.slow
def test_loss_of_pure_slip_over_the_frequency():
    system, period = CoulombForced(2.0, 1.0), 2 * np.pi
    guess = orbit_guess(
        system, Motion(1.0, 0.0), transient=60 * period, max_period=2.5 * period, forcing_period=period
    )
    branch = continue_orbit(
        system,
        periodic_orbit(system, guess, forced=True),
        "amplitude",
        (1.1, 2.5),
        forcing_period=of_frequency,
        follow=Follow(step=0.02),
    )
    (border,) = branch["GR"]
    assert border.words == "crossing-sliding, 2 events, 4 beyond"
    assert border.value == pytest.approx(1.3770178175, abs=1e-9)
    curve = continue_point(
        system,
        border,
        ("amplitude", "frequency"),
        ((1.0, 2.5), (0.5, 1.2)),
        forcing_period=of_frequency,
        follow=Follow(step=0.1),
    )
    force, w = curve.values.T
    assert w.min() < 0.6
    assert w.max() == pytest.approx(1.2)
    np.testing.assert_allclose(force, [den_hartog(one) for one in w], rtol=1e-8)
    assert (np.asarray(curve.orbits.events.count) == 2).all()


class Backward(ss.AbstractSmoothSystem):
    """The forced block as if its slip field held at all speeds."""

    amplitude: Any
    frequency: Any
    units: ClassVar = {"x": "m", "v": "m/s"}

    def time_scale(self, args):
        return 1.0 / self.frequency

    def vector_field(self, t, y, mode, args):
        u = 1.0 - y.v
        load = self.amplitude * jnp.cos(self.frequency * t)
        return Motion(y.v, -y.x + 1.5 - 1.5 * u + 0.45 * u**3 + load)


def flip_of_the_slip_field():
    w = 1.75
    orbit = periodic_orbit(Backward(0.1, w), OrbitGuess(Motion(1.0, 0.0), 4 * np.pi / w), forced=True)
    branch = continue_orbit(
        Backward(0.1, w),
        orbit,
        "frequency",
        (1.5, 2.0),
        forcing_period=of_frequency,
        follow=Follow(step=0.02),
    )
    return min(branch["PD"], key=lambda point: abs(point.value - 1.7129810362))


@pytest.mark.slow
def test_flip_curve_of_the_forced_block_ends_where_the_orbit_grazes_the_belt():
    curve = continue_point(
        closed_branch().system,
        closed_branch()["PD"][0],
        ("frequency", "amplitude"),
        ((1.0, 4.0), (0.0, 4.0)),
        forcing_period=of_frequency,
        follow=Follow(step=0.03),
    )
    assert np.asarray(curve.orbits.multipliers)[:, 0] == pytest.approx(-1.0, abs=1e-9)
    for end in curve.ends:
        assert end.words == "grazes: the sequence of modes ends here"
        assert float(end.orbit.highest.v) == pytest.approx(1.0, abs=1e-5)  # as it is known
    # Nothing is published for the ends; two runs with other steps agree to these digits.
    found = sorted(end.values.tolist() for end in curve.ends)
    np.testing.assert_allclose(found[0], [1.658442369, 0.087601966], atol=1e-8)
    np.testing.assert_allclose(found[1], [2.547012439, 1.320888211], atol=1e-8)


@pytest.mark.slow
def test_flip_curve_of_the_slip_field_passes_the_published_points():
    """Yoshitake, Sueoka; five digits are printed."""
    curve = continue_point(
        Backward(0.1, 1.75),
        flip_of_the_slip_field(),
        ("frequency", "amplitude"),
        ((1.0, 4.0), (0.05, 2.28608)),
        forcing_period=of_frequency,
        follow=Follow(step=0.03, both=False),
    )
    assert curve.ends[-1].words == "bounds of amplitude"
    assert curve.values[-1] == pytest.approx([2.73420, 2.28608], abs=1e-5)
    frequency, amplitude = curve.values.T
    between = CubicSpline(amplitude, frequency)
    assert between([1.52127, 1.77224, 2.03041]) == pytest.approx([2.60775, 2.66918, 2.71408], abs=2e-5)


def discontinuous_fold(c: float) -> float:
    """Belt speed at which the slip from (1 - c v, v) comes back tangentially to v: by SciPy alone."""

    def slip(t, y, v):
        return [y[1], -y[0] - c * y[1] + 1.0 / (1.0 + 3.0 * (v - y[1]))]

    def greatest(v):
        """Greatest speed of the next turn, over that of the belt; it leaves the stick downwards."""

        def top(t, y, v):
            return slip(t, y, v)[1]

        def beyond(t, y, v):
            return y[1] - v - 0.1

        top.direction, beyond.terminal = -1.0, True
        run = solve_ivp(
            slip, (0.0, 20.0), [1.0 - c * v, v], "DOP853", args=(v,), rtol=1e-12, atol=1e-13,
            events=(top, beyond),
        )  # fmt: skip
        tops = zip(run.t_events[0], run.y_events[0], strict=True)
        return next((y[1] - v for t, y in tops if t > 1.0), 0.1)

    return float(brentq(greatest, 0.5, 0.9, xtol=1e-12))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start", "offsets", "largest", "stop"),
    [
        (-0.3, (-0.5, 0.3), 0.2, -1.2),
        (0.1, (-5.0, 5.0), 0.2, 1.0),  # the curve is steep in the unit of the bounds
        (0.1, (-0.5, 0.3), 2.0, 1.0),  # and flat
    ],
)
def test_borders_of_two_stops_end_where_they_meet(start, offsets, largest, stop):
    """Closed form: they are the lines 10 A = |stop - b|, and meet at A = 0.11, b = -0.1."""
    system, bounds = TwoStops(0.05, start), (0.05, largest)
    orbit = periodic_orbit(system, OrbitGuess(Motion(start, 0.5), 2 * np.pi, 0), forced=True)
    branch = continue_orbit(
        system,
        orbit,
        "amplitude",
        bounds,
        forcing_period=whole_turn,
        follow=Follow(step=0.05, both=False, max_points=20),
    )
    border = branch["GR"][0]
    curve = continue_point(
        system,
        border,
        ("amplitude", "offset"),
        (bounds, offsets),
        forcing_period=whole_turn,
        follow=Follow(step=0.1),
    )
    a, b = curve.values.T
    np.testing.assert_allclose(10 * a[1:-1], np.abs(stop - b[1:-1]), rtol=1e-8)
    np.testing.assert_allclose(10 * a, np.abs(stop - b), rtol=1e-7)  # ends, too
    (corner,) = [end for end in curve.ends if end.words.startswith("GRGR")]
    np.testing.assert_allclose(corner.values, [0.11, -0.1], atol=5e-8)
    (other,) = [end for end in curve.ends if end is not corner]
    assert other.words.startswith("bounds of ")


@pytest.mark.parametrize("away", [1e-3, 1e-7, 1e-12, 0.0])
def test_a_place_led_to_has_a_direction_however_near_it_is(away):
    """A circle: its tangent turns by the arc, and a point is off it by rounding of a whole orbit."""
    old = Place(seen_at([1.0, 0.0]), np.array([0.0, 1.0]), np.array([-1.0, 0.0]), 1.0)
    off = np.array([1e-12, 0.0]) if away else np.zeros(2)
    new = old.led_to(seen_at(np.array([np.cos(away), np.sin(away)]) + off), 1.0)
    np.testing.assert_allclose(new.way, [-np.sin(away), np.cos(away)], atol=1e-6)
    np.testing.assert_allclose(new.normal, [-np.cos(away), -np.sin(away)], atol=1e-6)


def seen_at(u) -> Point:
    """A point of which nothing is known but where it is, and that the plane of orbits is that of u."""
    point = object.__new__(Point)
    for name, value in (("u", np.asarray(u)), ("tangent", np.eye(2))):
        object.__setattr__(point, name, value)
    return point


class Cycle(NamedTuple):
    x: Any
    y: Any


class Cusp(ss.AbstractSmoothSystem):
    r"""$\dot r = r (a + b u - u^3)$, $u = r - 1$, $\dot\theta = 1$: folds at $27a^2 = 4b^3$."""

    a: Any
    b: Any
    units: ClassVar = {"x": "1", "y": "1"}

    def vector_field(self, t, y, mode, args):
        u = jnp.sqrt(y.x**2 + y.y**2) - 1.0
        grow = self.a + self.b * u - u**3
        return Cycle(grow * y.x - y.y, grow * y.y + y.x)


@pytest.mark.slow
def test_folds_of_cycles_end_at_the_cusp():
    system = Cusp(0.0, 0.3)
    orbit = periodic_orbit(system, OrbitGuess(Cycle(1.0 + 0.3**0.5, 0.0), 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (-0.2, 0.2), follow=Follow(step=0.1))
    fold = branch["LP"][0]
    size = (4 * 0.3**3 / 27) ** 0.5
    assert abs(fold.value) == pytest.approx(size, abs=1e-10)
    curve = continue_point(
        system, fold, ("a", "b"), ((-0.5, 0.5), (-0.5, 1.0)), follow=Follow(step=0.05)
    )
    a, b = curve.values.T
    np.testing.assert_allclose(27 * a**2, 4 * b**3, atol=1e-10)
    one, two = sorted(curve.ends, key=lambda end: float(end.values[1]))
    assert one.words.startswith("CP: cusp")
    np.testing.assert_allclose(one.values, 0.0, atol=1e-7)
    assert two.words.startswith("bounds of ")


@pytest.mark.slow
def test_discontinuous_fold_and_its_curve_over_the_damping():
    """Stick-slip orbit and slip cycle end in one point; the latter also in its Hopf point."""
    system = WeakeningBlock(belt_speed=0.6, damping=0.5)
    guess = orbit_guess(system, Motion(1.0, 0.1), transient=50.0, max_period=12.0)
    branch = continue_orbit(
        system,
        periodic_orbit(system, guess),
        "belt_speed",
        (0.4, 0.8),
        follow=Follow(step=0.04, both=False, max_points=60),
    )
    (fold,), (end,) = branch["GR"], branch["EP"]
    assert fold.value == pytest.approx(0.6721494669, abs=1e-9)
    assert float(fold.orbit.period) == pytest.approx(6.4622679113, abs=1e-8)
    assert branch.values.max() <= fold.value
    after = branch.orbits.multipliers[fold.index + 1]
    assert complex(after[0]) == pytest.approx(7.3010363, abs=5e-3)  # 3e-5 beyond the fold
    hopf = (np.sqrt(3 / 0.5) - 1) / 3
    assert end.words.startswith("at_rest")
    assert end.value == pytest.approx(hopf, abs=1e-7)
    stable = np.asarray(branch.orbits.stable)
    assert stable[: fold.index + 1].all()
    assert not stable[fold.index + 1 :].any()
    data = branch.to_dataset()
    assert data.sizes["point"] == len(branch)
    assert data["label"].values.tolist() == ["GR", "HB", "EP"]
    assert data["start_x"].attrs["units"] == "m"
    assert fold.words.startswith("grazing-sliding")
    curve = continue_point(
        system, fold, ("belt_speed", "damping"), ((0.5, 0.9), (0.4, 0.6)), follow=Follow(step=0.15)
    )
    assert len(curve) > 5
    for v, c in curve.values[::2]:
        assert discontinuous_fold(c) == pytest.approx(v, abs=1e-8)


class Pitchfork(NamedTuple):
    x: Any
    y: Any
    w: Any


class Symmetric(ss.AbstractSmoothSystem):
    r"""Cycle $r = 1$, and $\dot w = cb + (a - b^2) w - w^3$: for $cb = 0$ others part from
    it at $a = b^2$: $w = \pm\sqrt{a - b^2}$."""

    a: Any
    b: Any = 0.0
    c: Any = 0.0
    units: ClassVar = {"x": "1", "y": "1", "w": "1"}

    def vector_field(self, t, y, mode, args):
        grow = 1.0 - y.x**2 - y.y**2
        return Pitchfork(
            grow * y.x - y.y, grow * y.y + y.x, self.c * self.b + (self.a - self.b**2) * y.w - y.w**3
        )


@pytest.mark.slow
def test_the_other_branch_of_a_symmetric_branch_point():
    system = Symmetric(-0.1)
    orbit = periodic_orbit(system, OrbitGuess(Pitchfork(1.0, 0.0, 0.0), 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (-0.2, 0.2), follow=Follow(step=0.06))
    (point,) = branch["BP"]
    assert point.value == pytest.approx(0.0, abs=1e-8)
    other = continue_orbit(system, point, "a", (-0.2, 0.2), follow=Follow(step=0.06))
    w, a = np.asarray(other.orbits.y0.w), other.values
    np.testing.assert_allclose(w**2, a, atol=1e-9)
    assert w.min() < -0.3
    assert w.max() > 0.3
    assert np.asarray(other.orbits.stable).all()
    assert (np.diff(w) * np.sign(w[-1] - w[0]) > 0).all()  # in order along it


@pytest.mark.slow
def test_branch_points_have_a_curve_while_the_system_stays_symmetric():
    bounds = ((-0.2, 1.5), (-1.0, 1.0))
    for b, c in ((0.3, 0.0), (0.0, 1.0)):
        system = Symmetric(-0.1, b, c)
        orbit = periodic_orbit(system, OrbitGuess(Pitchfork(1.0, 0.0, 0.0), 2 * np.pi))
        branch = continue_orbit(system, orbit, "a", (-0.2, 0.4), follow=Follow(step=0.06))
        (point,) = branch["BP"]
        if c:  # w = 0 is none for any other b
            with pytest.raises(ValueError, match="point = BranchPoint: it must be one from which"):
                continue_point(system, point, ("a", "b"), bounds, follow=Follow(step=0.1))
            continue
        curve = continue_point(system, point, ("a", "b"), bounds, follow=Follow(step=0.1))
        np.testing.assert_allclose(curve.values[:, 0], curve.values[:, 1] ** 2, atol=1e-9)
        np.testing.assert_allclose(np.asarray(curve.orbits.multipliers)[:, 0], 1.0, atol=1e-9)
        assert [end.words for end in curve.ends] == ["bounds of b"] * 2


def test_arguments_of_a_curve():
    system = WeakeningBlock(belt_speed=0.6, damping=0.5)
    with pytest.raises(TypeError, match="point = 1: it must be a BranchPoint of a Branch"):
        continue_point(system, 1, ("belt_speed", "damping"), ((0, 1), (0, 1)))
