"""Lyapunov exponents against closed forms, published values and a computation by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.analysis import (
    LyapunovSpectrum,
    _tangent,
    lyapunov_spectrum,
    lyapunov_spectrum_of_map,
    two_trajectory_exponent,
    volume_growth,
)
from stickslip.analysis._growth import averaged, first_frame, orthonormalised
from stickslip.systems import CoulombOscillator, Motion, OscillatorBetweenStops

from ._chaos import Flow, Impacts, Point, lorenz

SMOOTH = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=10_000_000)
FINE = ss.Integrator("tsit5", ss.AdaptiveStep(1e-11, 1e-11), max_steps=10_000_000)
BY_HAND = Impacts(c=0.05, e=0.8, P=1.0, Omega=2.8, stop=0.0)
START = Motion(x=0.1, v=0.0)


@jax.jit
def smooth_spectrum(system, u0):
    return lyapunov_spectrum(
        system, u0, segment=0.5, segments=1600, warm_up=40, transient=20.0, integrator=SMOOTH
    )


def impacting(**changes):
    p = {**BY_HAND._asdict(), **changes}
    return OscillatorBetweenStops(
        1.0, 1.0, damping=p["c"], lower=p["stop"], upper=100.0, restitution=p["e"], rest_speed=0.0,
        force_amplitude=p["P"], force_frequency=p["Omega"],
    )  # fmt: skip


def agree(value, exact, error, at_most):
    """Within three of its own errors, which must be small themselves, and those of the integrator."""
    assert float(error) < at_most
    assert abs(float(value) - exact) <= 3 * float(error) + 1e-7


# Smooth flows


def test_linear_flow_has_the_real_parts_of_its_eigenvalues():
    matrix = np.array([[-0.3, 0.8, 0.1], [-0.9, -0.1, 0.0], [0.3, 0.2, -1.1]])
    zero = jnp.asarray(0.0)
    found = smooth_spectrum(Flow(jnp.asarray(matrix), zero, zero), Point(0.3, 0.1, -0.2))
    exact = np.sort(np.linalg.eigvals(matrix).real)[::-1]
    for i in range(3):
        agree(found.exponents[i], exact[i], found.error[i], 2e-3)
    np.testing.assert_allclose(found.sum, np.trace(matrix), atol=1e-6)


def test_fixed_point_of_lorenz():
    """Below rho = 1 the origin attracts: its eigenvalues."""
    found = smooth_spectrum(lorenz(0.5), Point(0.1, 0.2, 0.3))
    exact = np.sort([-8 / 3, *np.linalg.eigvals([[-10.0, 10.0], [0.5, -1.0]])])[::-1]
    np.testing.assert_allclose(found.exponents, exact, atol=1e-4)
    assert float(found.kaplan_yorke_dimension) == 0.0


def test_limit_cycle_has_zero_and_its_floquet_exponent():
    """r' = r (0.2 - r^2), z' = -0.7 z: 0 along the circle, -0.4 across, -0.7 off the plane."""
    matrix = np.array([[0.2, -1.3, 0.0], [1.3, 0.2, 0.0], [0.0, 0.0, -0.7]])
    flow = Flow(jnp.asarray(matrix), jnp.asarray(0.0), jnp.asarray(1.0))
    found = smooth_spectrum(flow, Point(0.5, 0.0, 0.1))
    for value, exact, error in zip(found.exponents, (0.0, -0.4, -0.7), found.error, strict=True):
        agree(value, exact, error, 2e-3)
    assert float(found.running[-1, 0]) == pytest.approx(float(found.exponents[0]), abs=1e-12)


def test_lorenz():
    """Sprott 2003: 0.9056, 0, -14.572, dimension 2.062; the sum is the divergence -41/3."""
    found = smooth_spectrum(lorenz(), Point(1.0, 1.0, 20.0))
    for value, exact, error in zip(found.exponents, (0.9056, 0.0, -14.5723), found.error, strict=True):
        agree(value, exact, error, 0.02)
    np.testing.assert_allclose(found.sum, -41 / 3, rtol=1e-6)
    assert float(found.kaplan_yorke_dimension) == pytest.approx(2.062, abs=3e-3)
    assert bool(found.result == ss.RESULTS.successful)


# Maps


def test_maps():
    """Logistic at 4: ln 2. Tent of slope s: ln s exactly. Henon: 0.4192, sum ln 0.3."""
    logistic = lyapunov_spectrum_of_map(
        lambda x: 4 * x * (1 - x), 0.2345, iterations=20_000, transient=100
    )
    agree(logistic.exponents[0], np.log(2), logistic.error[0], 0.01)
    slope = 1.99  # at 2 the orbit ends at 0: each step shifts out a binary digit
    tent = lyapunov_spectrum_of_map(
        lambda x: slope * jnp.where(x < 0.5, x, 1 - x), 0.2345, iterations=200
    )
    np.testing.assert_allclose(tent.exponents, np.log(slope), rtol=1e-13)
    assert float(tent.error[0]) < 1e-12
    henon = lyapunov_spectrum_of_map(
        lambda z: (1 - 1.4 * z[0] ** 2 + z[1], 0.3 * z[0]), (0.1, 0.1), iterations=40_000, transient=100
    )
    agree(henon.exponents[0], 0.4192, henon.error[0], 0.01)
    np.testing.assert_allclose(henon.sum, np.log(0.3), rtol=1e-12)


# Events


@jax.jit
def short(restitution):
    """Growth of a frame over 30 s, a batch; segments in step with the computation by hand."""

    def lane(e):
        found = lyapunov_spectrum(
            impacting(e=e), START, segment=1.5, segments=20, warm_up=0, blocks=2, integrator=FINE
        )
        return found.local.sum(axis=0) * 1.5

    return jax.vmap(lane)(restitution)


def by_hand(e):
    return BY_HAND._replace(e=e).growth(START, 30.0, np.asarray(first_frame(2, 2)))


def test_impacts_equal_the_computation_by_hand():
    """Same frame, same time: growth of both directions through a dozen impacts; a batch."""
    found = np.asarray(short(jnp.array([0.8, 0.82])))
    np.testing.assert_allclose(found, [by_hand(0.8), by_hand(0.82)], atol=1e-6)
    assert found[0, 0] > 3.0
    assert found[1, 0] < 0.0

    @jax.jit
    def volume():
        return volume_growth(impacting(), START, duration=30.0, integrator=FINE, max_events=64)

    np.testing.assert_allclose(found[0].sum(), 30.0 * volume(), atol=1e-7)


def test_without_saltation_the_impacts_are_wrong(monkeypatch):
    """The planted fault: event times that do not move with the state. The test above must see it."""
    right = _tangent.WithDeviations.transition

    def frozen(self, t, y, mode, guard, args):
        """As if every deviated motion met the event at the same time: jump Jacobian, no saltation."""
        after, new = right(self, t, y, mode, guard, args)

        def through(d):
            return jax.jvp(lambda s: self.system.transition(t, s, mode, guard, args)[0], (y.y,), (d,))[
                1
            ]

        return after._replace(deviations=jax.vmap(through, -1, -1)(y.deviations)), new

    monkeypatch.setattr(_tangent.WithDeviations, "transition", frozen)
    # Another limit of steps, so that no program compiled without the fault is used again.
    faulty = lyapunov_spectrum(
        impacting(), START, segment=1.5, segments=20, warm_up=0, blocks=2,
        integrator=ss.Integrator("tsit5", max_steps=99_999),
    )  # fmt: skip
    assert not np.allclose(faulty.local.sum(axis=0) * 1.5, by_hand(0.8), atol=0.5)


@pytest.mark.slow
def test_impacts_over_a_long_time_and_by_two_trajectories():
    options = dict(segment=1.5, segments=2000, transient=150.0, integrator=FINE)
    found = jax.jit(lambda: lyapunov_spectrum(impacting(), START, **options))()
    # The computation by hand has an error too: parts from different starts, their beginnings left out.
    parts = []
    for x in np.linspace(0.1, 0.6, 8):
        whole, first = (BY_HAND.growth((x, 0.1), t, np.eye(2)) for t in (600.0, 100.0))
        parts.append((whole - first) / 500.0)
    exact, spread = np.mean(parts, axis=0), np.std(parts, axis=0, ddof=1) / 8**0.5
    for i in range(2):
        agree(found.exponents[i], exact[i], np.hypot(found.error[i], spread[i]), 0.025)
    two = jax.jit(lambda: two_trajectory_exponent(impacting(), START, distance=1e-7, **options))()
    agree(two.exponent, exact[0], np.hypot(two.error, spread[0]), 0.025)


@jax.jit
def belt_spectrum(system, y0):
    return lyapunov_spectrum(
        system, y0, segment=2.0, segments=60, warm_up=10, integrator=SMOOTH, components=None
    )


def test_stick_slip_cycle_has_zero_and_minus_infinity():
    """One direction is along the cycle, the other is lost whenever the block comes to stick."""
    system = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    found = belt_spectrum(system, Motion(0.0, 0.2))
    assert abs(float(found.exponents[0])) <= 3 * float(found.error[0])
    assert float(found.error[0]) < 0.05
    assert float(found.exponents[1]) == -np.inf
    assert np.isnan(found.error[1])
    cycles = 120.0 / (5.0 + 2 * np.pi - 2 * np.arctan(2.5))
    # Lost when the slip ends; what takes its place, against the stick, is lost when that ends.
    assert abs(int(found.lost[1]) - 2 * cycles) <= 2
    assert int(found.lost[0]) == 0
    assert float(found.sum) == -np.inf


# The parts


def test_lost_direction_is_replaced():
    images = jnp.array([[1.0, 2.0, 0.3], [0.0, 0.0, 0.1], [2.0, 4.0, 0.7]])
    q, logs = orthonormalised(images)
    np.testing.assert_allclose(q.T @ q, np.eye(3), atol=1e-14)
    assert np.isneginf(np.asarray(logs)).tolist() == [False, True, False]


def test_error_sees_noise_and_drift():
    noise = np.random.default_rng(1).standard_normal((4000, 1))
    mean, error = averaged(jnp.asarray(noise), 10)
    assert 0.3 / 4000**0.5 < float(error[0]) < 3 / 4000**0.5
    drift = 1 / np.arange(1.0, 1001)[:, None]  # a shear: ln(t)/t on its way to 0
    mean, error = averaged(jnp.asarray(drift), 10)
    assert abs(float(mean[0])) <= 3 * float(error[0])


# Bad input


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"segment": 0.0}, "segment = 0.0: it must be finite and positive"),
        ({"segments": 2}, "segments = 2: it must be an integer of at least 4"),
        ({"segments": 12}, "segments = 12: it must be at least 2 blocks = 20"),
        ({"warm_up": -1}, "warm_up = -1"),
        ({"blocks": 1}, "blocks = 1"),
        ({"exponents": 3}, "exponents = 3: it must be at most 2"),
        ({"transient": -1.0}, "transient = -1.0"),
        ({"components": ("x", "w")}, r"components = \('x', 'w'\): .* of x, v"),
        ({"components": ()}, "components"),
    ],
)
def test_wrong_arguments(changes, message):
    options = {"segment": 1.0, "segments": 20, **changes}
    with pytest.raises(ValueError, match=message):
        lyapunov_spectrum(impacting(), START, **options)
    with pytest.raises(TypeError, match="system is a str"):
        lyapunov_spectrum("oscillator", START, segment=1.0, segments=20)


def test_wrong_arguments_of_the_others():
    with pytest.raises(ValueError, match=r"distance = 0\.0"):
        two_trajectory_exponent(impacting(), START, segment=1.0, segments=20, distance=0.0)
    with pytest.raises(ValueError, match="segments = 3"):
        lyapunov_spectrum_of_map(lambda x: x, 0.1, iterations=3)
    with pytest.raises(TypeError, match="function"):
        lyapunov_spectrum_of_map(2.0, 0.1, iterations=100)
    with pytest.raises(ValueError, match=r"duration = -1\.0"):
        volume_growth(impacting(), START, duration=-1.0)
    assert LyapunovSpectrum.__doc__
