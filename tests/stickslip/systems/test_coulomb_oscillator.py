"""Block on a belt against its closed form: end state, event times, derivatives, unusual starts."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion
from tests.stickslip.systems._closed_forms import BeltCycle, derivatives

# Steps of 0.2 s: at order 8 the motion at unit frequency is right to 3e-12 over 50 s, event times too.
STEPS = ss.Integrator(step=ss.FixedStep(0.2))


def run(v, static, kinetic, t1, **options):
    system = CoulombOscillator(1.0, 1.0, static, kinetic, v)
    return ss.simulate(system, 0.0, t1, Motion(0.0, v), integrator=STEPS, throw=False, **options)


def cycle(v=0.2, static=1.0, kinetic=0.5):
    return BeltCycle(1.0, 1.0, static, kinetic, v)


def test_closed_form_is_periodic_and_meets_the_numbers_of_the_task():
    v = np.linspace(0.2, 0.4, 11)
    one = cycle(v)
    moments = one.first_slip + np.linspace(0.0, 3.0, 50)[:, None] * one.period
    later = moments + one.period
    np.testing.assert_allclose(one.position(moments), one.position(later), atol=1e-13)
    slopes = derivatives(
        lambda v, static, kinetic: cycle(v, static, kinetic).position(30.0),
        {"v": 0.2, "static": 1.0, "kinetic": 0.5},
    )
    np.testing.assert_allclose(
        list(slopes.values()), [16.2232182593, -5.1724137931, 5.1724137931], atol=6e-11
    )


@pytest.mark.more
def test_every_belt_at_once():
    """25,000 belts in one call: state at 50 s to 1e-10, times of all events to 1e-11."""

    def lane(v):
        solution = run(v, 1.0, 0.5, 50.0, saveat=ss.SaveAt(max_events=16))
        return solution.y1.x, solution.events.t, solution.events.mode_after, solution.flags

    v = np.linspace(0.2, 0.4, 25_000)
    x, times, modes, flags = map(np.asarray, ss.map_lanes(lane)(v))
    assert np.max(np.abs(x - cycle(v).position(50.0))) <= 1e-10

    expected = cycle(v).events(16)
    happened = expected < 50.0
    # Where an event falls on the end to rounding, either answer is right.
    clear = np.abs(expected - 50.0) > 1e-9
    assert np.array_equal(np.isfinite(times)[clear], happened[clear])
    both = happened & np.isfinite(times)
    assert np.max(np.abs(times - expected)[both]) <= 1e-11
    assert np.all(modes[:, ::2][both[:, ::2]] == 0)
    assert np.all(modes[:, 1::2][both[:, 1::2]] == 1)
    assert np.all(flags == 0)


@functools.cache
def slopes_of_all_belts(transform):
    """dx(30)/d(v, F_s, F_k) over the range of v."""

    def lane(v):
        def end(p):
            return run(*p, 30.0, saveat=ss.SaveAt(max_events=None)).y1.x

        return transform(end)((v, jnp.ones_like(v), jnp.full_like(v, 0.5)))

    v = np.linspace(0.2, 0.4, 2001)
    return v, np.stack(ss.map_lanes(lane)(v), axis=-1)


@pytest.mark.more
@pytest.mark.parametrize("transform", [jax.jacfwd, jax.grad], ids=["forward", "reverse"])
def test_derivatives_over_all_belts(transform):
    v, slopes = slopes_of_all_belts(transform)
    exact = derivatives(
        lambda v, static, kinetic: cycle(v, static, kinetic).position(30.0),
        {"v": v, "static": 1.0, "kinetic": 0.5},
    )
    exact = np.stack([np.broadcast_to(d, v.shape) for d in exact.values()], axis=-1)
    differentiable = cycle(v).distance_to_event(30.0) > 1e-6
    assert np.mean(differentiable) > 0.99
    error = np.abs(slopes - exact)[differentiable]
    exact = np.abs(exact[differentiable])
    assert np.max(error / np.max(exact, axis=-1, keepdims=True)) <= 1e-8
    # Each one by itself too, wherever it is not passing through zero.
    relative = error[exact > 1e-2] / exact[exact > 1e-2]
    assert np.max(relative) <= 1e-8


def test_derivatives_at_the_first_belt():
    v, slopes = slopes_of_all_belts(jax.jacfwd)
    assert v[0] == 0.2
    np.testing.assert_allclose(slopes[0], [16.2232182593, -5.1724137931, 5.1724137931], rtol=1e-10)


def test_weaker_static_than_kinetic_friction():
    """Faster than the belt at first, then held up to the kinetic force (Filippov's sliding mode)."""
    v_b, static, kinetic, x, v = 0.2, 0.5, 1.0, 0.6, 0.4
    system = CoulombOscillator(1.0, 1.0, static, kinetic, v_b)
    solution = ss.simulate(system, 0.0, 3.0, Motion(x, v), integrator=STEPS)
    # Harmonic about -F_k/k while faster than the belt.
    u, size = x + kinetic, np.hypot(x + kinetic, v)
    catch = np.arccos(v_b / size) - np.arctan2(u, v)
    held = u * np.cos(catch) + v * np.sin(catch) - kinetic
    assert static < held < kinetic
    leave = catch + (kinetic - held) / v_b
    np.testing.assert_allclose(solution.events.t[:2], [catch, leave], atol=1e-12)
    assert [system.mode_names[m] for m in solution.events.mode_after[:2]] == [
        "stick",
        "slip backward",
    ]
    end = kinetic + v_b * np.sin(3.0 - leave)
    np.testing.assert_allclose(solution.y1.x, end, atol=1e-12)
