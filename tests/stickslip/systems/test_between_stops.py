"""Oscillator between stops against its exact motion; rest at a stop; complete chattering."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import Motion, OscillatorBetweenStops
from tests.stickslip.systems._closed_forms import (
    between_stops,
    derivatives,
    impacts_of_free_oscillator,
)
from tests.stickslip.systems._systems import STOPS

STEPS = ss.Integrator(step=ss.FixedStep(0.1))


def simulated(t1, v=1.5, **changes):
    system = OscillatorBetweenStops(**{**STOPS, **changes})
    return ss.simulate(
        system, 0.0, t1, Motion(0.0, v), integrator=STEPS, saveat=ss.SaveAt(max_events=64)
    )


def exact(t1, v=1.5, **changes):
    p = {**STOPS, **changes}
    return between_stops(
        t1, p["mass"], p["stiffness"], p["damping"], p["lower"], p["upper"], p["restitution"],
        p["force_amplitude"], p["force_frequency"], 0.0, v,
    )  # fmt: skip


@pytest.mark.more
def test_free_oscillator_between_symmetric_stops():
    free = dict(damping=0.0, force_amplitude=0.0, lower=-0.5, upper=0.5, restitution=0.95)
    solution = simulated(8.0, **free)
    count = int(solution.num_events)
    times, speeds = impacts_of_free_oscillator(1.0, 2.0, 0.5, 0.95, 1.5, count)
    assert count >= 8
    np.testing.assert_allclose(solution.events.t[:count], times, atol=1e-12)
    np.testing.assert_allclose(np.abs(solution.events.y_before.v[:count]), speeds, rtol=1e-12)
    assert [int(g) for g in solution.events.guard[:4]] == [1, 0, 1, 0]


@pytest.mark.more
def test_damped_and_driven():
    values = {name: jnp.asarray(value) for name, value in STOPS.items()}

    def end(values):
        solution = simulated(20.0, **values)
        return jnp.stack(solution.y1), solution

    slopes, solution = jax.jit(jax.jacfwd(end, has_aux=True))(values)
    expected, events = exact(20.0)
    np.testing.assert_allclose(solution.y1, np.real(expected), atol=1e-11)
    times = [np.real(event.t) for event in events]
    assert int(solution.num_events) == len(times) >= 5
    np.testing.assert_allclose(solution.events.t[: len(times)], times, atol=1e-11)
    expected = derivatives(lambda **p: exact(20.0, **p)[0], STOPS)
    for name in STOPS:
        scale = np.max(np.abs(expected[name]))
        np.testing.assert_allclose(slopes[name], expected[name], atol=1e-8 * scale)


@pytest.mark.slow
def test_reverse_mode():
    values = {name: jnp.asarray(value) for name, value in STOPS.items()}
    slopes = jax.jit(jax.grad(lambda values: simulated(20.0, **values).y1.x))(values)
    expected = derivatives(lambda **p: exact(20.0, **p)[0][:1], STOPS)
    for name in STOPS:
        scale = np.max(np.abs(expected[name]))
        np.testing.assert_allclose(slopes[name], expected[name][0], atol=1e-8 * scale)


def pressed(restitution, rest_speed, **options):
    """The spring pulls to a stop at x = 0.5, the drive lifts the mass off when it exceeds that."""
    system = OscillatorBetweenStops(
        1.0, 1.0, lower=0.5, upper=9.0, restitution=restitution, rest_speed=rest_speed,
        force_amplitude=-0.8, force_frequency=0.1,
    )  # fmt: skip
    return ss.simulate(system, 0.0, 25.0, Motion(0.7, 0.0), **options)


@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_rest_at_a_stop_until_the_drive_lifts_it_off(restitution):
    solution = pressed(restitution, 1e-3)
    count = int(solution.num_events)
    names = OscillatorBetweenStops.mode_names
    modes = [names[int(m)] for m in solution.events.mode_before[:count]]
    rest = modes.index("at the lower stop")
    assert int(solution.events.guard[rest]) == 0
    # It leaves when -0.8 cos(0.1 t) exceeds the force of the spring, 0.5.
    lift = np.arccos(-0.5 / 0.8) / 0.1
    assert float(solution.events.t[rest]) == pytest.approx(lift, rel=1e-13)
    assert float(solution.events.y_after.x[rest]) == 0.5
    assert float(solution.y1.x) > 0.5


def test_complete_chattering_ends_with_a_code():
    solution = pressed(0.3, 0.0, throw=False)
    assert bool(solution.result == ss.RESULTS.chattering)
    assert float(solution.t1) < 5.0


def test_start_outside_the_stops_is_refused():
    system = OscillatorBetweenStops(**STOPS)
    solution = ss.simulate(system, 0.0, 1.0, Motion(1.1, 0.0), throw=False)
    assert bool(solution.result == ss.RESULTS.no_admissible_mode)
