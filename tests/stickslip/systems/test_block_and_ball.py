"""Sliding block and bouncing ball against their closed forms; the end of a Zeno sequence."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import BouncingBall, Motion, SlidingBlock
from tests.stickslip.systems._closed_forms import (
    ball,
    bounces,
    derivatives,
    limit_of_bounces,
    throw,
)

THROW = {"mass": 2.0, "kinetic_force": 1.0, "force": 0.3, "v": 2.0}
BALL = {"gravity": 9.81, "restitution": 0.7, "height": 1.0}


def thrown(t1, mass=2.0, kinetic_force=1.0, force=0.3, v=2.0, static_force=1.5, **options):
    system = SlidingBlock(mass, static_force, kinetic_force, force)
    return ss.simulate(system, 0.0, t1, Motion(0.0, v), **options)


def dropped(t1, gravity=9.81, restitution=0.7, height=1.0, rest_speed=1e-3, **options):
    system = BouncingBall(0.5, gravity, restitution, rest_speed)
    return ss.simulate(system, 0.0, t1, Motion(height, 0.0), **options)


@pytest.mark.parametrize("t1", [1.5, 9.0], ids=["moving", "at rest"])
def test_thrown_block(t1):
    solution = thrown(t1)
    x, v, stop = throw(**THROW, t=t1)
    assert float(solution.y1.x) == pytest.approx(x, rel=1e-13)
    assert float(solution.y1.v) == pytest.approx(v, abs=1e-13)
    if stop < t1:
        assert float(solution.events.t[0]) == pytest.approx(stop, rel=1e-13)
        assert float(solution.y1.v) == 0.0
        assert SlidingBlock.mode_names[int(solution.mode1)] == "rest"
        assert int(solution.num_events) == 1


@pytest.mark.more
@pytest.mark.parametrize("t1", [1.5, 9.0], ids=["moving", "at rest"])
def test_derivatives_of_the_throw(t1):
    exact = derivatives(lambda **p: throw(**p, t=t1)[0], THROW)
    slopes = jax.grad(lambda p: thrown(t1, **p).y1.x)(THROW)
    assert {k: float(s) for k, s in slopes.items()} == pytest.approx(exact, rel=1e-12, abs=1e-13)


@pytest.mark.more
def test_derivatives_of_the_time_of_the_stop():
    exact = derivatives(lambda **p: throw(**p, t=9.0)[2], THROW)
    slopes = jax.jacfwd(lambda p: thrown(9.0, **p).events.t[0])(THROW)
    assert {k: float(s) for k, s in slopes.items()} == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(
    ("force", "static_force", "kinetic_force", "after"),
    [
        (0.9, 1.0, 0.5, "rest"),
        (-0.9, 1.0, 0.5, "rest"),
        (-1.1, 1.0, 0.5, "slip backward"),
        (1.1, 1.0, 0.5, "slip forward"),
        # Kinetic above static friction: no slip can begin below the kinetic force.
        (0.9, 0.5, 1.0, "rest"),
        (-1.1, 0.5, 1.0, "slip backward"),
    ],
)
def test_start_at_rest(force, static_force, kinetic_force, after):
    system = SlidingBlock(1.0, static_force, kinetic_force, force)
    solution = ss.simulate(system, 0.0, 2.0, Motion(0.0, 0.0))
    assert system.mode_names[int(solution.mode1)] == after
    a = 0.0 if after == "rest" else force - np.sign(force) * kinetic_force
    np.testing.assert_allclose([solution.y1.x, solution.y1.v], [2 * a, 2 * a], atol=1e-14)


def test_flight_and_impacts_of_the_ball():
    solution = dropped(1.9)
    np.testing.assert_allclose(solution.y1, ball(**BALL, t=1.9), atol=1e-12)
    times, speeds = bounces(**BALL, count=int(solution.num_events))
    assert len(times) >= 4
    np.testing.assert_allclose(solution.events.t[: len(times)], times, atol=1e-13)
    np.testing.assert_allclose(solution.events.y_before.v[: len(times)], -speeds, rtol=1e-12)


@pytest.mark.more
def test_derivatives_of_the_flight():
    exact = derivatives(lambda **p: ball(**p, t=1.9)[0], BALL)
    slopes = jax.grad(lambda p: dropped(1.9, **p).y1.x)(BALL)
    assert {k: float(s) for k, s in slopes.items()} == pytest.approx(exact, rel=1e-10)


def test_ball_comes_to_rest_below_the_rest_speed():
    solution = dropped(4.0)
    times, speeds = bounces(**BALL, count=100)
    # Rest begins with the first impact that would leave no more than the rest speed.
    last = int(np.argmax(0.7 * speeds <= 1e-3))
    assert int(solution.num_events) == last + 1
    assert float(solution.events.t[last]) == pytest.approx(times[last], rel=1e-12)
    assert BouncingBall.mode_names[int(solution.mode1)] == "rest"
    assert solution.y1 == Motion(0.0, 0.0)


def test_endless_bounces_end_with_a_code():
    """Without a rest speed the impacts accumulate: the engine says so, at the time of the limit."""
    limit = limit_of_bounces(9.81, 0.5, 1.0)
    solution = dropped(4.0, restitution=0.5, rest_speed=0.0, throw=False)
    assert bool(solution.result == ss.RESULTS.chattering)
    assert float(solution.t1) == pytest.approx(limit, abs=1e-6)
    few = dropped(4.0, restitution=0.5, rest_speed=0.0, throw=False, saveat=ss.SaveAt(max_events=10))
    assert bool(few.result == ss.RESULTS.max_events_reached)
    times, _ = bounces(9.81, 0.5, 1.0, 10)
    np.testing.assert_allclose(few.events.t, times, rtol=1e-13)


@pytest.mark.more
def test_gravity_per_lane():
    """Lanes whose last impacts differ in number keep to themselves."""
    gravity = jnp.linspace(1.0, 15.0, 33)
    solution = jax.vmap(lambda g: dropped(1.9, gravity=g))(gravity)
    exact = [ball(float(g), 0.7, 1.0, 1.9) for g in gravity]
    np.testing.assert_allclose(np.stack(solution.y1, axis=-1), exact, atol=1e-11)


def test_start_below_the_ground_is_refused():
    system = BouncingBall(1.0, 9.81, 0.5)
    solution = ss.simulate(system, 0.0, 1.0, Motion(-0.1, 0.0), throw=False)
    assert bool(solution.result == ss.RESULTS.no_admissible_mode)
