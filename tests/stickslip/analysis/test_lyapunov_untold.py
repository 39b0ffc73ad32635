"""Lyapunov exponents that cannot be told are not numbers, and a word says why."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.analysis import (
    _growth,
    lyapunov_diagram,
    lyapunov_spectrum,
    lyapunov_spectrum_of_map,
    two_trajectory_exponent,
)
from stickslip.systems import BouncingBall, CoulombOscillator, Motion

from ._chaos import Flow, Point, lorenz

SMOOTH = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=10_000_000)
BLOCK = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
ZERO = jnp.asarray(0.0)


@pytest.mark.parametrize("start", [0.3, 2.0])
def test_an_orbit_that_leaves_the_finite_numbers(start):
    """Logistic map at 5: almost every orbit runs off to minus infinity. It came out as stable."""
    found = lyapunov_spectrum_of_map(lambda x: 5 * x * (1 - x), start, iterations=200)
    assert np.isnan(found.exponents).all()
    assert np.isnan(found.error).all()
    assert found.words.tolist() == ["failed"]
    assert np.isnan(found.kaplan_yorke_dimension)


def test_words_of_what_is_told(monkeypatch):
    """The identity is neutral; a constant map forgets all."""
    assert lyapunov_spectrum_of_map(lambda x: x, 0.3, iterations=40).words.tolist() == ["ok"]
    forgets = lyapunov_spectrum_of_map(lambda x: 0 * x + 0.5, 0.3, iterations=40)
    assert forgets.words.tolist() == ["lost"]
    assert np.isneginf(forgets.exponents).all()


def test_a_block_at_rest_and_one_that_stops_early():
    """On a belt that stands still it sticks: nothing moves, no deviation either."""
    speeds = np.array([0.0, 0.2])
    options = {"segment": 2.0, "segments": 20, "executor": "portable"}
    spectrum = {"integrator": SMOOTH}
    start = lambda system: Motion(0.0, system.belt_speed)  # noqa: E731
    found = lyapunov_diagram(BLOCK, {"belt_speed": speeds}, start, spectrum=spectrum, **options)
    words = np.array(found.exponent_status.attrs["flag_meanings"].split())[found.exponent_status.values]
    assert words.tolist() == [["at_rest", "at_rest"], ["ok", "lost"]]
    assert np.isnan(found.exponents[0]).all()
    assert np.isfinite(found.exponents[1, 0])
    # A rest whose linear field decides is told: the eigenvalues.
    rest = lyapunov_spectrum(lorenz(0.5), Point(0.0, 0.0, 0.0), segment=0.5, segments=40, warm_up=40)
    assert rest.words.tolist() == ["ok"] * 3
    np.testing.assert_allclose(rest.exponents[1], -8 / 3, rtol=1e-3)

    # Carried by the belt for ever, it moves: the stick holds its speed, and no event says so.
    carried = eqx.tree_at(lambda block: block.stiffness, BLOCK, 1e-9)
    found = lyapunov_spectrum(carried, Motion(0.0, 0.2), segment=2.0, segments=20, integrator=SMOOTH)
    assert found.words.tolist() == ["ok", "lost"]
    np.testing.assert_allclose(found.exponents, [0.0, -np.inf], atol=1e-12)

    few = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=5)
    lost = lyapunov_spectrum(BLOCK, Motion(0.0, 0.2), segment=2.0, segments=20, integrator=few)
    assert lost.words.tolist() == ["failed", "failed"]
    assert np.isnan(lost.exponents).all()
    assert np.isnan(lost.kaplan_yorke_dimension)


def two(system, start, **options):
    options = {"segment": 1.0, "segments": 20, "integrator": SMOOTH, **options}
    return jax.jit(lambda: two_trajectory_exponent(system, start, **options))()


def test_two_motions_that_merge_saturate_or_fail():
    decay = Flow(jnp.diag(jnp.array([-4.0, -4.0, -4.0])), ZERO, ZERO)
    offset = Point(1.0, 1.0, 1.0)
    assert two(decay, offset, distance=1e-3, warm_up=0).words == "ok"
    # Two balls come to rest on one floor: the distance is zero from then on, not ever smaller.
    ball = two(BouncingBall(0.5, 9.81, 0.7, 0.02), Motion(1.0, 0.0), distance=1e-6, warm_up=0)
    assert ball.words == "merged"
    assert np.isnan(ball.exponent)
    assert np.isnan(ball.error)
    # Lorenz: e^(0.9 t) from 1e-8 is the size of the attractor after 23; as printed, 0.9 is not seen.
    printed = two(lorenz(), Point(1.0, 1.0, 20.0), segment=2.0, renormalise=False)
    assert printed.words == "saturated"
    assert np.isnan(printed.exponent)
    assert 0.0 < float(printed.running[-1]) < 0.7
    assert float(printed.distance[-1]) > 1.0
    few = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=5)
    assert two(lorenz(), Point(1.0, 1.0, 20.0), integrator=few).words == "failed"


def test_rounding_is_no_distance():
    """A rotation about a place 1e6 away: a distance of 1e-9 is what rounding makes of it."""
    turning = Flow(jnp.array([[0.0, -1.0, 1e6], [1.0, 0.0, -1e6], [0.0, 0.0, 0.0]]), ZERO, ZERO)
    found = two(turning, Point(1e6, 1e6 + 1.0, 1.0), components="x", distance=1e-9)
    assert found.words == "merged"
    assert np.isnan(found.exponent)


def test_a_growth_that_is_not_finite_is_not_lost():
    for bad in (np.nan, np.inf):
        images = jnp.array([[1.0, 0.0], [0.0, bad]])
        assert np.isnan(_growth.orthonormalised(images)[1]).all()
