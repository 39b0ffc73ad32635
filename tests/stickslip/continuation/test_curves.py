"""Curves of special points over two parameters, against closed forms and independent integration."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import (
    OrbitGuess,
    continue_orbit,
    continue_point,
    orbit_guess,
    periodic_orbit,
)
from tests.stickslip.continuation._systems import (
    Bouncing,
    CoulombForced,
    ForcedBlock,
    Motion,
    TwoStops,
    WeakeningBlock,
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
    branch = continue_orbit(system, orbit, "strength", (0.9, 1.7), step=0.02, forcing_period=whole_turn)
    names, bounds = ("strength", "restitution"), ((0.2, 4.0), (0.1, 0.9))
    for label in ("LP", "PD"):
        curve = continue_point(
            system, branch[label][0], names, bounds, forcing_period=whole_turn, step=0.05
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
        system, periodic_orbit(system, guess, forced=True), "amplitude", (1.1, 2.5), step=0.02,
        forcing_period=of_frequency,
    )  # fmt: skip
    (border,) = branch["GR"]
    assert border.words == "crossing-sliding, 2 events, 4 beyond"
    curve = continue_point(
        system, border, ("amplitude", "frequency"), ((1.0, 2.5), (0.5, 1.2)), step=0.1,
        forcing_period=of_frequency,
    )  # fmt: skip
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


def flip_of(kind):
    w = 1.75
    guess = OrbitGuess(Motion(1.0, 0.0), 4 * np.pi / w)
    orbit = periodic_orbit(kind(0.1, w), guess, forced=True)
    branch = continue_orbit(
        kind(0.1, w), orbit, "frequency", (1.5, 2.0), step=0.02, forcing_period=of_frequency
    )
    return min(branch["PD"], key=lambda point: abs(point.value - 1.7129810362))


@pytest.mark.slow
def test_flip_curve_of_the_forced_block_ends_where_the_orbit_grazes_the_belt():
    curve = continue_point(
        ForcedBlock(0.1, 1.75), flip_of(ForcedBlock), ("frequency", "amplitude"),
        ((1.0, 4.0), (0.0, 4.0)), forcing_period=of_frequency, step=0.03,
    )  # fmt: skip
    assert np.asarray(curve.orbits.multipliers)[:, 0] == pytest.approx(-1.0, abs=1e-9)
    for end in curve.ends:
        assert end.words == "grazes: the sequence of modes ends here"
        assert float(end.orbit.highest.v) == pytest.approx(1.0, abs=1e-5)  # as it is known
    # Nothing is published for the ends; two runs with other steps agree to these digits.
    found = sorted(end.values.tolist() for end in curve.ends)
    np.testing.assert_allclose(found[0], [1.658442369, 0.087601966], atol=1e-8)
    np.testing.assert_allclose(found[1], [2.547012439, 1.320888211], atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "frequency"), [(1.52127, 2.60775), (2.28608, 2.73420)])
def test_flip_curve_of_the_slip_field_passes_the_published_points(amplitude, frequency):
    """Yoshitake, Sueoka; five digits are printed."""
    curve = continue_point(
        Backward(0.1, 1.75), flip_of(Backward), ("frequency", "amplitude"),
        ((1.0, 4.0), (0.05, amplitude)), forcing_period=of_frequency, step=0.05, both=False,
    )  # fmt: skip
    assert curve.ends[1].words == "bounds of amplitude"
    assert curve.values[-1] == pytest.approx([frequency, amplitude], abs=1e-5)


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
        (0.1, (-0.5, 0.5), 0.2, 1.0),
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
        system, orbit, "amplitude", bounds, step=0.05, forcing_period=whole_turn, both=False,
        max_points=20,
    )  # fmt: skip
    border = branch["GR"][0]
    curve = continue_point(
        system, border, ("amplitude", "offset"), (bounds, offsets), forcing_period=whole_turn, step=0.1
    )
    a, b = curve.values.T
    np.testing.assert_allclose(10 * a, np.abs(stop - b), rtol=1e-8)
    (corner,) = [end for end in curve.ends if end.words.startswith("GRGR")]
    np.testing.assert_allclose(corner.values, [0.11, -0.1], atol=5e-8)
    (other,) = [end for end in curve.ends if end is not corner]
    assert other.words.startswith("bounds of ")


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
    branch = continue_orbit(system, orbit, "a", (-0.2, 0.2), step=0.1)
    fold = branch["LP"][0]
    size = (4 * 0.3**3 / 27) ** 0.5
    assert abs(fold.value) == pytest.approx(size, abs=1e-10)
    curve = continue_point(system, fold, ("a", "b"), ((-0.5, 0.5), (-0.5, 1.0)), step=0.05)
    a, b = curve.values.T
    np.testing.assert_allclose(27 * a**2, 4 * b**3, atol=1e-10)
    one, two = sorted(curve.ends, key=lambda end: float(end.values[1]))
    assert one.words.startswith("CP: cusp")
    np.testing.assert_allclose(one.values, 0.0, atol=1e-7)
    assert two.words.startswith("bounds of ")


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


@pytest.mark.slow
def test_torus_points_end_at_strong_resonances():
    system = Pair(-0.05, 0.3)
    orbit = periodic_orbit(system, OrbitGuess(Torus(1.0, 0.0, 0.0, 0.0), 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (-0.1, 0.1), step=0.1)
    (torus,) = branch["NS"]
    assert torus.value == pytest.approx(0.0, abs=1e-9)
    curve = continue_point(system, torus, ("a", "b"), ((-0.1, 0.1), (0.0, 0.6)), step=0.1)
    np.testing.assert_allclose(curve.values[:, 0], 0.0, atol=1e-9)
    low, high = sorted(curve.ends, key=lambda end: float(end.values[1]))
    assert low.words.startswith("R4")
    assert low.values[1] == pytest.approx(1 / 4, abs=1e-9)
    assert high.words.startswith("R3")
    assert high.values[1] == pytest.approx(1 / 3, abs=1e-9)


@pytest.mark.slow
def test_discontinuous_fold_over_the_damping():
    system = WeakeningBlock(belt_speed=0.6, damping=0.5)
    guess = orbit_guess(system, Motion(1.0, 0.1), transient=50.0, max_period=12.0)
    branch = continue_orbit(
        system, periodic_orbit(system, guess), "belt_speed", (0.4, 0.8), step=0.04, both=False,
        max_points=12,
    )  # fmt: skip
    (fold,) = branch["GR"]
    assert fold.words.startswith("grazing-sliding")
    curve = continue_point(system, fold, ("belt_speed", "damping"), ((0.5, 0.9), (0.4, 0.6)), step=0.15)
    assert len(curve) > 5
    for v, c in curve.values[::2]:
        assert discontinuous_fold(c) == pytest.approx(v, abs=1e-8)


class Pitchfork(NamedTuple):
    x: Any
    y: Any
    w: Any


class Symmetric(ss.AbstractSmoothSystem):
    r"""Cycle $r = 1$, and $\dot w = a w - w^3$: at $a = 0$ others, $w = \pm\sqrt a$, part from it."""

    a: Any
    units: ClassVar = {"x": "1", "y": "1", "w": "1"}

    def vector_field(self, t, y, mode, args):
        grow = 1.0 - y.x**2 - y.y**2
        return Pitchfork(grow * y.x - y.y, grow * y.y + y.x, self.a * y.w - y.w**3)


@pytest.mark.slow
def test_the_other_branch_of_a_symmetric_branch_point():
    system = Symmetric(-0.1)
    orbit = periodic_orbit(system, OrbitGuess(Pitchfork(1.0, 0.0, 0.0), 2 * np.pi))
    branch = continue_orbit(system, orbit, "a", (-0.2, 0.2), step=0.06)
    (point,) = branch["BP"]
    assert point.value == pytest.approx(0.0, abs=1e-8)
    other = continue_orbit(system, point, "a", (-0.2, 0.2), step=0.06)
    w, a = np.asarray(other.orbits.y0.w), other.values
    np.testing.assert_allclose(w**2, a, atol=1e-9)
    assert w.min() < -0.3
    assert w.max() > 0.3
    assert np.asarray(other.orbits.stable).all()
    assert (np.diff(w) * np.sign(w[-1] - w[0]) > 0).all()  # in order along it


def test_arguments_of_a_curve():
    system = WeakeningBlock(belt_speed=0.6, damping=0.5)
    with pytest.raises(TypeError, match="point = 1: it must be a BranchPoint of a Branch"):
        continue_point(system, 1, ("belt_speed", "damping"), ((0, 1), (0, 1)))
