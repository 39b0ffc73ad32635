"""Periodic orbits against numbers computed independently (SciPy, DOP853 at 1e-12, events, Newton)."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import stickslip as ss
from stickslip.continuation import (
    ORBITS,
    OrbitGuess,
    Shooting,
    continue_orbit,
    orbit_guess,
    periodic_orbit,
)
from stickslip.systems import CoulombOscillator
from stickslip.systems import Motion as Place
from tests.stickslip.continuation._systems import (
    Bouncing,
    CocoStickSlip,
    ForcedBlock,
    Motion,
    Plane,
    PolarPieces,
    Sliding,
    WeakeningBlock,
)

LEINE = WeakeningBlock(belt_speed=0.2, damping=0.0)
PERIOD = 12.0010312948


@pytest.fixture(scope="module")
def leine():
    guess = orbit_guess(LEINE, Motion(1.135, 0.0), transient=50.0, max_period=40.0)
    return periodic_orbit(LEINE, guess)


@pytest.mark.more
def test_block_on_a_belt(leine):
    assert bool(leine.successful)
    assert float(leine.period) == pytest.approx(PERIOD, abs=2e-10)
    times = np.asarray(leine.events.t[:2])
    assert times[1] - times[0] == pytest.approx(4.2959995255, abs=2e-10)
    assert float(leine.events.y_before.x[1]) == pytest.approx(-0.5410063539, abs=2e-10)
    assert int(leine.events.count) == 2
    assert float(leine.highest.x) == pytest.approx(1.1339446764, abs=2e-10)
    assert float(leine.highest.v) == pytest.approx(0.2, abs=1e-12)


@pytest.mark.more
def test_stick_takes_one_direction_exactly(leine):
    assert np.asarray(leine.multipliers).tolist() == [0.0]
    assert float(leine.trivial) == pytest.approx(1.0, abs=1e-10)
    assert int(leine.rank) == 1
    assert bool(leine.stable)


@pytest.mark.more
def test_newton_takes_few_evaluations(leine):
    """Of steps whose own noise, to their tolerance, is below that of the residual."""
    assert int(leine.steps) <= 8
    assert float(leine.residual) <= 1e-11
    assert float(leine.closing_error) < 1e-10
    steps = ss.Integrator("dop853", ss.AdaptiveStep(1e-13, 1e-14))
    guess = OrbitGuess(Motion(1.135, 0.0), 11.0, LEINE.mode_names.index("slip"))
    found = periodic_orbit(LEINE, guess, shooting=Shooting(integrator=steps))
    assert int(found.steps) <= 9
    assert float(found.residual) <= 1e-12
    assert float(found.period) == pytest.approx(PERIOD, abs=1e-10)


@pytest.mark.parametrize(
    ("start", "mode", "period"),
    [
        (Motion(1.135, 0.0), None, 11.0),
        (Motion(0.3, 0.2), "stick", 12.5),
        (Motion(0.0, -0.8), "slip", 12.0),
    ],
)
def test_the_orbit_does_not_depend_on_where_it_begins(leine, start, mode, period):
    found = periodic_orbit(
        LEINE, OrbitGuess(start, period, LEINE.mode_names.index(mode) if mode else 1)
    )
    assert bool(found.successful)
    assert float(found.period) == pytest.approx(PERIOD, abs=2e-10)
    assert found.multipliers.tolist() == [0.0]


@pytest.mark.slow
@pytest.mark.parametrize("segments", [3, 4])
def test_several_pieces_give_the_same_orbit(leine, segments):
    """Multiple shooting; some knots are in the stick, and the multiplier is zero all the same."""
    start = OrbitGuess(Motion(0.0, -0.8), 12.0, 1)
    found = periodic_orbit(LEINE, start, shooting=Shooting(segments=segments))
    assert bool(found.successful)
    assert float(found.period) == pytest.approx(PERIOD, abs=2e-10)
    assert found.multipliers.tolist() == [0.0]
    assert float(found.trivial) == pytest.approx(1.0, abs=1e-9)


def test_what_is_no_orbit_is_not_reported():
    """The equilibrium, and a period that fits nothing."""
    rest = 1.0 / 1.6
    codes = [
        periodic_orbit(LEINE, OrbitGuess(Motion(rest, v), period, 1)).result
        for v, period in ((0.0, 6.0), (1e-9, 6.28))
    ]
    assert all(bool(code != ORBITS.successful) for code in codes)


def test_a_forced_system_is_not_taken_for_a_free_one(leine):
    """Its state may return after any time, at another phase of the load."""
    with pytest.raises(ValueError, match="depends on the time"):
        periodic_orbit(ForcedBlock(0.1, 1.75), OrbitGuess(Motion(1.0, 0.0), 7.0))
    with pytest.raises(ValueError, match="depends on the time"):
        continue_orbit(ForcedBlock(0.1, 1.75), leine, "frequency", (1.5, 2.0))


@pytest.mark.slow
def test_a_batch_is_what_each_is_alone(leine):
    speeds = jnp.array([0.15, 0.2, 0.25])

    def period(speed):
        system = WeakeningBlock(speed, jnp.asarray(0.0))
        return periodic_orbit(system, OrbitGuess(leine.y0, PERIOD, leine.mode0))

    batch = jax.vmap(period)(speeds)
    assert np.asarray(batch.successful).all()
    assert float(batch.period[1]) == pytest.approx(PERIOD, abs=2e-10)
    assert "3 orbits" in str(batch)


def test_a_second_call_compiles_nothing(leine):
    assert periodic_orbit_compilations(0.21, leine) == 0


def periodic_orbit_compilations(speed, orbit):
    seen = []

    def listen(event, duration, **_):
        if "backend_compile" in event:
            seen.append(event)

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        periodic_orbit(WeakeningBlock(speed, 0.0), OrbitGuess(orbit.y0, PERIOD, orbit.mode0))
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)
    return len(seen)


@pytest.mark.slow
def test_polar_pieces():
    """Radial maps in closed form (COCO, `piecewise`)."""
    guess = orbit_guess(PolarPieces(1.0, 2.0, 1.5), Plane(1.0, 0.1), transient=30.0, max_period=12.0)
    for beta, period, multiplier in (
        (2.0, 4.810271606, 0.00243051142),
        (5.0, 4.199141384, 0.000748165138),
    ):
        found = periodic_orbit(PolarPieces(1.0, beta, 1.5), guess)
        assert float(found.period) == pytest.approx(period, abs=1e-9)
        assert complex(found.multipliers[0]) == pytest.approx(multiplier, abs=1e-11)
        assert float(found.determinant) == pytest.approx(float(found.determinant_by_events), abs=1e-12)


@pytest.mark.slow
def test_flip_of_the_forced_block():
    """Two orbits of this period exist; that of the guess at w = 1.75 is followed to the flip."""
    found = OrbitGuess(Motion(1.0, 0.0), 4 * np.pi / 1.75)
    for w in (1.75, 1.73, 1.72, 1.7129810362):
        guess = OrbitGuess(found.y0, 4 * np.pi / w, found.mode0)
        found = periodic_orbit(ForcedBlock(0.1, w), guess, forced=True)
        assert bool(found.successful)
    assert complex(found.multipliers[0]) == pytest.approx(-1.0, abs=1e-8)
    assert float(found.determinant) == pytest.approx(float(found.determinant_by_events), abs=1e-10)


@pytest.mark.more
def test_a_speed_that_stick_holds_is_not_a_free_place():
    """No field and no guard of the stick depends on it; the other multipliers are those of SciPy."""
    period, system = np.pi / 0.92, CocoStickSlip(0.5)

    def stick(t, y):
        return [y[1], (0.5 * np.sin(0.92 * t) / (1.0 - y[0])) ** 2 - 0.04 * y[1] - y[0]]

    x, v = solve_ivp(stick, (0.0, 60 * period), [0.0, 0.0], "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
    found = periodic_orbit(system, OrbitGuess(Sliding(x, v, 0.0), period, 0), forced=True)
    assert np.asarray(found.multipliers)[2] == 0.0
    product = complex(np.prod(np.asarray(found.multipliers)[:2]))
    assert product == pytest.approx(np.exp(-0.04 * period), abs=1e-11)
    assert not np.any(np.asarray(found.neutral))
    assert found.place == ""
    assert int(found.rank) == 2
    assert bool(found.stable)


@pytest.mark.slow
def test_coco_stick_slip():
    """All of the period in stick: the speed of slip is held, and no multiplier is 1 for it."""
    period = np.pi / 0.92
    found = orbit_guess(
        CocoStickSlip(0.5), Sliding(0.0, 0.0, 0.0), transient=100 * period, max_period=1.5 * period,
        forcing_period=period,
    )  # fmt: skip
    for voltage, largest in ((0.50, 0.2338973340), (0.55, 0.3200134031)):
        system = CocoStickSlip(voltage)
        found = periodic_orbit(system, found, forced=True)
        assert np.asarray(found.multipliers)[2] == 0.0
        product = complex(np.prod(np.asarray(found.multipliers)[:2]))
        assert product == pytest.approx(np.exp(-0.04 * period), abs=1e-11)
        assert float(found.highest.x) == pytest.approx(largest, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("strength", [1.1, 1.3, 1.5, 1.55])
def test_ball_on_a_vibrating_table(strength):
    """One impact per period, in closed form (Holmes 1982); the determinant is $e^2$."""
    e = 0.5
    speed = np.pi * (1 - e) / (1 + e)
    phase = -np.arcsin(speed / strength)
    start = Motion(strength * np.cos(phase) + np.pi**2 / 2, 0.0)
    system = Bouncing(strength, e)
    found = periodic_orbit(system, OrbitGuess(start, 2 * np.pi, 0, phase + np.pi), forced=True)
    assert bool(found.successful)
    assert float(found.determinant) == pytest.approx(e * e, abs=1e-11)
    assert float(found.determinant_by_events) == pytest.approx(e * e, abs=1e-11)
    assert bool(found.stable) == (strength < np.hypot(speed, 2 * (1 + e * e) / (1 + e) ** 2))


@pytest.mark.slow
def test_ten_thousand_orbits_against_the_closed_form():
    """Period $2D/v_b + 2(\\pi - \\arctan(D\\omega/v_b))/\\omega$ of the stick-slip oscillator."""
    rng = np.random.default_rng(0)
    speeds, kinetic = rng.uniform(0.05, 0.5, 10_000), rng.uniform(0.2, 0.9, 10_000)

    def orbit(speed, force):
        system = CoulombOscillator(1.0, 1.0, 1.0, force, speed)
        guess = orbit_guess(system, Place(x=force, v=speed), transient=40.0, max_period=60.0)
        found = periodic_orbit(system, guess)
        return found.period, found.successful, found.multipliers

    mapped = ss.map_lanes(orbit, executor="portable")
    period, good, multipliers = mapped(jnp.asarray(speeds), jnp.asarray(kinetic))
    drop = 1.0 - kinetic
    want = 2 * drop / speeds + 2 * (np.pi - np.arctan(drop / speeds))
    assert np.asarray(good).all()
    assert np.abs(np.asarray(period) - want).max() < 1e-9
    assert np.all(np.asarray(multipliers) == 0.0)


class Unheeded(ss.AbstractHybridSystem):
    r"""Mode 0: $\dot x = -y$, $\dot y = x$. Mode 1: $\dot x = \dot y = 1$; it is that of all states."""

    mode_names: ClassVar = ("turns", "goes")
    guard_names: ClassVar = ()

    def vector_field(self, t, y, mode, args):
        turns = mode == 0
        grow = 1.0 - y.x**2 - y.y**2
        return Plane(jnp.where(turns, grow * y.x - y.y, 1.0), jnp.where(turns, grow * y.y + y.x, 1.0))

    def guards(self, t, y, mode, args):
        return ()

    def transition(self, t, y, mode, guard, args):
        return y, mode

    def initial_mode(self, t, y, args):
        return 1


@pytest.mark.slow
def test_an_orbit_in_a_mode_that_the_system_does_not_give_is_refused():
    found = periodic_orbit(Unheeded(), OrbitGuess(Plane(1.0, 0.1), 6.3, mode0=0))
    assert float(found.residual) < 1e-11
    assert str(found.result) == "not_reproduced"


class VanDerPol(ss.AbstractSmoothSystem):
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, 0.3 * (1.0 - y.x**2) * y.v - y.x)


def test_steps_of_few_digits_find_an_orbit_to_these_and_its_shortest_period():
    """They reproduce it to their own tolerance only, and its two halves are as far apart."""

    def back(u):
        def field(t, y):
            return [y[1], 0.3 * (1.0 - y[0] ** 2) * y[1] - y[0]]

        end = solve_ivp(field, (0.0, u[1]), [u[0], 0.0], method="DOP853", rtol=1e-12, atol=1e-12)
        return end.y[:, -1] - [u[0], 0.0]

    x, period = root(back, [2.0, 6.3]).x
    guess = OrbitGuess(Motion(2.0, 0.0), 12.63)
    steps = Shooting(integrator=ss.Integrator(step=ss.AdaptiveStep(1e-7)))
    orbit = periodic_orbit(VanDerPol(), guess, shooting=steps)
    assert bool(orbit.successful)
    assert int(orbit.repeats) == 2
    assert float(orbit.period) == pytest.approx(2.0 * period, abs=1e-6)
    assert float(orbit.highest.x) == pytest.approx(x, abs=1e-6)
