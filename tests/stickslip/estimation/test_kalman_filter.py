"""Filter and smoother against the textbook, and against closed forms at one event."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.estimation import Gaussian, Noise, kalman_filter, smooth
from stickslip.systems import CoulombOscillator, Motion, SlidingBlock
from tests.stickslip.estimation._machines import Linear, Pair, Pushed, place, textbook, van_loan

WIDE = np.array([[1e-4, 2e-5], [2e-5, 3e-4]])
UNSEEN = {"x": [np.nan]}


def both(system, t, y, mode, args):
    return {"x": y.x, "v": y.v}


@pytest.mark.parametrize("process", [Pair(0.0, 0.0), Pair(0.01, 0.2)])
def test_a_linear_system_is_filtered_and_smoothed_as_in_the_textbook(process):
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.05, 0.4, 12)) + 0.5
    values = 0.1 * rng.normal(size=(12, 2))
    values[3] = np.nan
    values[[5, 7], [0, 1]] = np.nan
    system, noise = Linear(), Noise({"x": 0.03, "v": 0.1}, process)
    found = kalman_filter(
        system, 0.5, Gaussian(Pair(0.1, -0.2), WIDE), t, {"x": values[:, 0], "v": values[:, 1]}, both,
        noise,
    )  # fmt: skip
    Q, R = np.diag(np.square(process)), np.diag([0.03**2, 0.1**2])
    filtered, smoothed, likelihood = textbook(
        system.matrix, Q, np.eye(2), R, 0.5, t, values, np.array([0.1, -0.2]), WIDE
    )
    later = smooth(found)
    for estimate, truth in ((found.estimate, filtered), (later, smoothed)):
        means = np.stack(estimate.means, axis=1)
        assert np.allclose(means, [m for m, _ in truth], rtol=0.0, atol=1e-9)
        wide = np.stack([P for _, P in truth])
        size = np.sqrt(np.einsum("kii,kjj->kij", wide, wide))
        assert np.max(np.abs(estimate.covariances - wide) / size) < 1e-7
    assert float(found.log_likelihood) == pytest.approx(likelihood, abs=1e-7)
    assert bool(found.result == ss.RESULTS.successful)
    assert np.array_equal(np.isnan(found.innovations), np.isnan(values))
    assert float(found.nis[3]) == 0.0


@pytest.mark.more
def test_a_stop_takes_what_the_saltation_matrix_takes():
    """A block that slows down by 0.3 m/s^2 stops a speed's deviation over 0.3 later."""
    block, a = SlidingBlock(1.0, 0.5, 0.3), 0.3
    found = kalman_filter(
        block, 0.0, Gaussian(Motion(0.0, 1.0), WIDE), [4.0], UNSEEN, place, Noise({"x": 1.0})
    )
    S = np.array([[1.0, 1.0 / a], [0.0, 0.0]])
    assert np.allclose(found.estimate.covariances[0], S @ WIDE @ S.T, rtol=1e-9, atol=0.0)
    assert np.all(found.estimate.covariances[0][1] == 0.0)
    assert float(found.log_likelihood) == 0.0


def test_breaking_loose_and_sticking_again_in_closed_form():
    """Stick to slip at x = 1: S = [[1, 0], [(F_k - F_s)/v_b, 1]], then the spring turns."""
    F_s, F_k, v = 1.0, 0.5, 0.2
    block = CoulombOscillator(1.0, 1.0, F_s, F_k, v)
    wide = np.diag([1e-4, 0.0])
    found = kalman_filter(
        block, 0.0, Gaussian(Motion(0.0, v), wide), [5.7, 10.0], {"x": [np.nan, np.nan]}, place,
        Noise({"x": 1.0}),
    )  # fmt: skip
    rise = (F_k - F_s) / v  # a deviation of x comes loose x/v earlier
    turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    # f+ - f- = (0, F_k - F_s), g = F_s - x, so that S = 1 + (f+ - f-) g_x / (g_x v)
    S = turn @ np.array([[1.0, 0.0], [rise, 1.0]])
    assert np.allclose(found.estimate.covariances[0], S @ wide @ S.T, rtol=1e-8, atol=1e-14)
    # After one more stop the deviation is the same shift in time as at first.
    assert np.all(found.estimate.covariances[1][1] == 0.0)
    assert float(found.estimate.covariances[1][0, 0]) == pytest.approx(1e-4, rel=1e-8)


def test_a_drifting_force_goes_through_a_stop():
    """The noise gathered before the stop is moved by S, and what comes in stick stays a force."""
    system, q = Pushed(static_force=1.0, kinetic_force=0.5, belt_speed=0.0), 0.01
    mean = system.state(x=-0.7, v_x=0.4, d=-0.7)
    run = ss.simulate(system, 0.0, 3.0, mean)
    assert int(run.num_events) == 1
    stop = float(run.events.t[0])
    found = kalman_filter(
        system, 0.0, Gaussian(mean, np.zeros((3, 3))), [3.0], UNSEEN, place,
        Noise({"x": 1.0}, system.state(d=q)),
    )  # fmt: skip
    order = [0, 2, 1]  # the flattened state has the speed last
    A = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    _, W = van_loan(A, np.diag([0.0, 0.0, q**2]), stop)
    S = np.diag([1.0, 0.0, 1.0])  # the speed is nothing where it stops: x does not change
    W = S @ W @ S
    W[2, 2] += q**2 * (3.0 - stop)
    assert np.allclose(found.estimate.covariances[0][np.ix_(order, order)], W, rtol=1e-7, atol=1e-12)


@pytest.mark.more
def test_a_stuck_body_keeps_the_speed_of_its_belt_whatever_is_measured():
    system = Pushed(static_force=1.0, kinetic_force=0.5, belt_speed=0.2)
    t = np.linspace(0.5, 3.0, 6)
    found = kalman_filter(
        system, 0.0, Gaussian(system.state(v_x=0.2), 1e-4 * np.eye(3)), t,
        {"x": 0.2 * t + 0.02, "v": 0.3 + 0.0 * t},
        lambda system, t, y, mode, args: {"x": y.x, "v": y.v_x},
        Noise({"x": 1e-3, "v": 0.01}, system.state(x=0.0, v_x=0.1, d=0.1)),
    )  # fmt: skip
    assert np.all(np.asarray(found.estimate.means.v_x) == 0.2)
    sd = found.estimate.sense(lambda system, t, y, mode, args: {"v": y.v_x, "x": y.x})[1]
    assert np.all(sd["v"] == 0.0)
    assert np.all(sd["x"] > 0.0)
    assert np.all(smooth(found).means.v_x == 0.2)


@pytest.mark.more
def test_a_correction_beyond_a_guard_decides_the_mode_anew():
    system = Pushed(belt_speed=0.2)
    names = system.mode_names
    start = Gaussian(system.state(x=0.5, v_x=0.2), system.state(d=1.0))
    seen = lambda system, t, y, mode, args: {"d": y.d}  # noqa: E731
    found = kalman_filter(system, 0.0, start, [0.5, 0.6], {"d": [1.9, 1.9]}, seen, Noise({"d": 1e-3}))
    assert names[int(found.predicted.modes[0])] == "stick"
    assert names[int(found.estimate.modes[0])] == "slip forward"
    assert float(found.estimate.means.v_x[1]) > 0.2
    back = kalman_filter(
        system, 0.0, Gaussian(system.state(x=0.5, v_x=0.3), system.state(v_x=1.0)), [0.01],
        {"v": [0.1]}, lambda s, t, y, m, a: {"v": y.v_x}, Noise({"v": 1e-3}),
    )  # fmt: skip
    assert names[int(back.predicted.modes[0])] == "slip forward"
    assert names[int(back.estimate.modes[0])] == "slip backward"


def test_a_correction_through_a_guard_makes_its_event_good():
    """The spring pulls with 1.02 N where 1 N holds: the block came loose 0.1 s ago."""
    system, names = Pushed(belt_speed=0.2), Pushed().mode_names
    mean, spread = system.state(x=0.9, v_x=0.2), system.state(x=0.05, d=0.01)
    found = kalman_filter(
        system, 0.0, Gaussian(mean, spread), [0.4, 0.5], {"x": [1.02, np.nan]}, place,
        Noise({"x": 1e-9}),
    )  # fmt: skip
    assert names[int(found.predicted.modes[0])] == "stick"
    assert names[int(found.estimate.modes[0])] == "slip backward"
    state = [getattr(found.estimate.means, n)[0] for n in ("x", "v_x", "d")]
    assert np.allclose(state, [1.02, 0.2 - 0.5 * 0.1, 0.0], atol=1e-9)
    P, S = np.diag([1e-18, 1e-4, 0.0]), np.eye(3)  # x, d, v_x
    S[2, :2] = -2.5, 2.5
    assert np.allclose(found.estimate.covariances[0], S @ P @ S.T, rtol=1e-6, atol=1e-15)
    assert np.all(np.asarray(found.flags) == 0)
    later = kalman_filter(
        system, 0.0, Gaussian(mean, spread), [0.2, 0.4, 0.5],
        {"x": [np.nan, 1.02, 1.02], "v": [np.nan, np.nan, 0.11]},
        lambda s, t, y, m, a: {"x": y.x, "v": y.v_x}, Noise({"x": 1e-4, "v": 1e-4}),
    )  # fmt: skip
    assert names[int(later.estimate.modes[1])] == "slip backward"
    # Backwards through the event: the speed measured later says how strong the force was before.
    smoothed, last = smooth(later), later.estimate
    for k in range(2):
        assert float(smoothed.means.d[k]) == pytest.approx(float(last.means.d[2]), rel=1e-7)
        assert float(smoothed.covariances[k, 1, 1]) == pytest.approx(
            float(last.covariances[2, 1, 1]), rel=1e-5
        )


@pytest.mark.more
def test_a_run_that_fails_says_so_and_has_no_numbers():
    block = SlidingBlock(1.0, 0.5, 0.3)
    found = kalman_filter(
        block, 0.0, Gaussian(Motion(0.0, 1.0), WIDE), [1.0, 2.0], {"x": [0.8, 1.5]}, place,
        Noise({"x": 0.1}), integrator=ss.Integrator(max_steps=1),
    )  # fmt: skip
    assert bool(found.result == ss.RESULTS.max_steps_reached)
    assert float(found.log_likelihood) == -np.inf
    assert np.all(np.isnan(found.estimate.means.x))


@pytest.mark.more
def test_lanes_are_runs_of_their_own():
    t, x = np.linspace(0.5, 6.0, 5), np.linspace(0.1, 0.6, 5)

    def one(force, row):
        system = Pushed(kinetic_force=force)
        start = Gaussian(system.state(v_x=0.2), 1e-4 * jnp.eye(3))
        noise = Noise({"x": 0.01}, system.state(d=0.05))
        return kalman_filter(system, 0.0, start, t, {"x": row}, place, noise)

    forces, rows = jnp.asarray([0.4, 0.6]), jnp.stack([x, x + 0.05])
    lanes = jax.vmap(one)(forces, rows)
    for i in range(2):
        alone = one(forces[i], rows[i])
        assert np.allclose(lanes.estimate.covariances[i], alone.estimate.covariances, rtol=1e-7)
        assert float(lanes.log_likelihood[i]) == pytest.approx(float(alone.log_likelihood), rel=1e-9)
    smoothed = jax.vmap(smooth)(lanes)
    assert np.allclose(smoothed.means.x[1], smooth(one(forces[1], rows[1])).means.x, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": [1.0, 0.5]}, r"t\[1\] = 0.5: it must be above the one before it"),
        ({"t0": 2.0}, r"t\[0\] = 0.5: it must be at least t0 = 2.0"),
        ({"measured": {"y": [0.0, 0.0]}}, r"measured = \['y'\]: it must be of x"),
        ({"measured": {"x": [0.0, np.inf]}}, r"measured\['x'\]\[1\] = inf: it must be finite, or NaN"),
        ({"measured": {"x": [0.0]}}, r"measured\['x'\] = \[0.0\], of shape \(1,\)"),
        ({"measure": lambda s, t, y, m, a: {"v": y.v}}, r"measure\(.*\) = \['v'\]: it must be"),
        ({"noise": Noise({"x": 0.1}, Pair(0.0, 1.0))}, r"noise.process = .*: it must be a state"),
        ({"start": Gaussian(Motion(0.0, 1.0), WIDE, "stuck")}, r"start.mode = 'stuck'"),
    ],
)
def test_wrong_arguments_are_named(change, message):
    good = {
        "system": SlidingBlock(1.0, 0.5, 0.3), "t0": 0.0, "start": Gaussian(Motion(0.0, 1.0), WIDE),
        "t": [0.5, 1.0], "measured": {"x": [0.4, 0.8]}, "measure": place, "noise": Noise({"x": 0.1}),
    }  # fmt: skip
    with pytest.raises((TypeError, ValueError), match=message):
        kalman_filter(**(good | change))


def test_a_covariance_that_cannot_be_is_named():
    for wrong in ([[1.0, 2.0], [2.0, 1.0]], [[1.0, 0.5], [0.0, 1.0]], [[0.0, 1e-9], [1e-9, 1.0]]):
        with pytest.raises(ValueError, match=r"spread = .* positive semidefinite"):
            Gaussian(Motion(0.0, 1.0), wrong)
