"""What a run returns: end state, outputs, steps, event log, crossings; convergence."""

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from tests.stickslip.hybrid._systems import Circle, Pendulum, State, StickSlip, fixed, stick_slip_motion

START = State(0.0, 0.2)


@pytest.fixture(scope="module")
def run():
    return ss.simulate(
        StickSlip(0.2),
        0.0,
        50.0,
        START,
        saveat=ss.SaveAt(
            ts=jnp.linspace(0.0, 50.0, 11),
            steps=True,
            max_rows=512,
            sections=(
                ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.3, "rising"),
                ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.3, "falling"),
                ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.3, "both"),
                ss.Section(lambda system, t, y, dy, mode, args: dy.v + 0.2, "rising"),
            ),
            max_events=32,
        ),
        integrator=ss.Integrator(step=ss.AdaptiveStep(1e-13, 1e-13)),
    )


@pytest.mark.more
def test_end_state_equals_the_closed_form(run):
    x, times = stick_slip_motion(50.0, 0.2)
    assert abs(run.y1.x - x) < 5e-11
    assert run.num_events == len(times)


def test_event_times_and_modes(run):
    _, times = stick_slip_motion(50.0, 0.2)
    n = len(times)
    np.testing.assert_allclose(run.events.t[:n], times, rtol=0, atol=1e-11)
    assert np.isnan(run.events.t[n:]).all()
    np.testing.assert_array_equal(run.events.guard[:n], np.arange(n) % 2)
    np.testing.assert_array_equal(run.events.mode_before[:n], np.arange(n) % 2)
    np.testing.assert_array_equal(run.events.mode_after[:n], 1 - np.arange(n) % 2)
    # A guard is at rounding level at its event, and sticking is exact.
    np.testing.assert_allclose(run.events.y_before.x[:n:2], 1.0, rtol=0, atol=2e-15)
    np.testing.assert_array_equal(run.events.y_after.v[:n], 0.2)


def test_outputs_are_landed_on(run):
    expected = [stick_slip_motion(t, 0.2)[0] if t > 0 else 0.0 for t in np.linspace(0, 50, 11)]
    np.testing.assert_allclose(run.outputs.y.x, expected, rtol=0, atol=5e-11)
    np.testing.assert_array_equal(run.outputs.t, np.linspace(0, 50, 11))


def test_crossings_of_a_section(run):
    """x = 0.3 is passed in stick at t = (0.3 - x)/v, and in slip where the cosine says."""
    rising, falling, both, _ = run.crossings
    _, times = stick_slip_motion(50.0, 0.2)
    releases, returns = times[::2], times[1::2]
    x_return = stick_slip_motion(times[1] + 1e-13, 0.2)[0]
    starts = np.concatenate([[0.0], returns])
    expected = starts + (0.3 - np.concatenate([[0.0], np.full(len(returns), x_return)])) / 0.2
    np.testing.assert_allclose(rising.t[: len(expected)], expected[expected < 50], atol=1e-11, rtol=0)
    amplitude, phase = np.hypot(0.5, 0.2), np.arctan2(0.2, 0.5)
    expected_fall = releases + phase + np.arccos((0.3 - 0.5) / amplitude)
    expected_fall = expected_fall[expected_fall < 50]
    np.testing.assert_allclose(falling.t[: len(expected_fall)], expected_fall, atol=1e-11, rtol=0)
    assert both.count == rising.count + falling.count
    np.testing.assert_allclose(
        both.t[: both.count],
        np.sort(np.concatenate([rising.t[: rising.count], falling.t[: falling.count]])),
        atol=1e-12,
    )
    np.testing.assert_allclose(both.y.x[: both.count], 0.3, atol=1e-14)


def test_section_on_an_acceleration_counts_jumps_at_their_event(run):
    """a + 0.2 jumps from 0.2 to -0.3 at release; it rises where x falls through 0.7."""
    _, times = stick_slip_motion(50.0, 0.2)
    amplitude, phase = np.hypot(0.5, 0.2), np.arctan2(0.2, 0.5)
    expected = times[::2] + phase + np.arccos((0.7 - 0.5) / amplitude)
    expected = expected[expected < 50]
    crossing = run.crossings[3]
    assert crossing.count == len(expected)
    np.testing.assert_allclose(crossing.t[: len(expected)], expected, atol=1e-11, rtol=0)
    np.testing.assert_allclose(crossing.dy.v[: len(expected)], -0.2, atol=1e-12)


def test_steps_hold_both_sides_of_an_event(run):
    count = int(run.steps.count)
    t, mode = np.asarray(run.steps.t[:count]), np.asarray(run.steps.mode[:count])
    assert np.all(np.diff(t) >= 0)
    at_event = np.flatnonzero(np.isclose(t, run.events.t[2], rtol=0, atol=1e-12))
    assert list(mode[at_event]) == [0, 1]


def test_interpolate_has_the_accuracy_of_the_method(run):
    ts = jnp.linspace(0.0, 49.9, 313)
    y = ss.interpolate(StickSlip(0.2), run, ts)
    expected = [stick_slip_motion(t, 0.2)[0] if t > 0 else 0.0 for t in np.asarray(ts)]
    np.testing.assert_allclose(y.x, expected, rtol=0, atol=1e-9)
    outside = ss.interpolate(StickSlip(0.2), run, jnp.asarray([-1e-9, 50.0 + 1e-9]))
    assert np.all(np.isnan(outside.x))


def test_attempts_are_few(run):
    """One of five ends beyond an event or is too long; the search of an event takes two or three."""
    assert int(run.stats.num_attempts) <= 205


def test_a_log_may_be_full():
    """The third event of the second lane has no row."""
    *_, events = stick_slip_motion(30.0, 0.2)
    ends = 0.5 * (events[1:3] + events[2:4])
    found = jax.vmap(
        lambda end: ss.simulate(
            StickSlip(0.2), 0.0, end, START, saveat=ss.SaveAt(max_events=2), throw=False
        )
    )(jnp.asarray(ends))
    np.testing.assert_array_equal(found.result == ss.RESULTS.successful, [True, False])
    np.testing.assert_array_equal(found.result == ss.RESULTS.max_events_reached, [False, True])


def test_str_says_what_happened(run):
    assert "11 events" in str(run)
    assert "derivative flags: none" in str(run)


@pytest.mark.more
@pytest.mark.parametrize(
    ("method", "order"),
    [("rk4", 4), ("tsit5", 5), ("dop853", 8), (dfx.Heun(), 2), (dfx.Bosh3(), 3), (dfx.Kvaerno3(), 3)],
    ids=lambda p: p if isinstance(p, str | int) else type(p).__name__,
)
def test_order_between_and_across_events(method, order):
    """Error of x(T) of the stick-slip motion halves as h^order, although events cut the steps."""
    x, _ = stick_slip_motion(21.0, 0.31)
    hs = {2: (0.05, 0.025), 3: (0.1, 0.05), 4: (0.2, 0.1), 5: (0.3, 0.15), 8: (0.8, 0.4)}[order]

    def end(h):
        return ss.simulate(
            StickSlip(0.31),
            0.0,
            21.0,
            State(0.0, 0.31),
            0,
            integrator=fixed(h, method),
            saveat=ss.SaveAt(max_events=None),
        ).y1.x

    errors = [abs(float(end(h)) - x) for h in hs]
    measured = np.log2(errors[0] / errors[1])
    assert measured > order - 0.6, (measured, errors)


def test_adaptive_error_follows_the_tolerance():
    def error(tolerance, method):
        step = ss.AdaptiveStep(tolerance, tolerance)
        y1 = ss.simulate(
            Pendulum(), 0.0, 30.0, State(2.0, 0.0), integrator=ss.Integrator(method, step)
        ).y1
        energy = 0.5 * y1.v**2 - jnp.cos(y1.x)
        return abs(float(energy) + np.cos(2.0))

    for method in ("dop853", "tsit5"):
        assert error(1e-6, method) < 1e-4
        assert error(1e-11, method) < 1e-9


def test_zero_length_run_and_output_at_start():
    run = ss.simulate(Circle(), 1.5, 1.5, State(1.0, 0.0), saveat=ss.SaveAt(ts=[1.5]))
    assert run.t1 == 1.5
    assert run.y1.x == 1.0
    np.testing.assert_array_equal(run.outputs.y.x, [1.0])
    assert run.result == ss.RESULTS.successful


def test_terminal_section_ends_the_run_on_the_section():
    section = ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.25, "falling", terminal=True)
    exact = ss.Integrator(step=ss.AdaptiveStep(1e-14, 1e-14))
    run = ss.simulate(
        Circle(level=-2.0),
        0.0,
        9.0,
        State(1.0, 0.0),
        saveat=ss.SaveAt(sections=section),
        integrator=exact,
    )
    assert run.result == ss.RESULTS.event_occurred
    assert abs(run.t1 - np.arccos(0.25)) < 1e-13
    assert abs(run.y1.x - 0.25) < 1e-15


def test_time_dependent_input_through_args():
    class Forced(Pendulum):
        def vector_field(self, t, y, mode, args):
            return State(y.v, args["force"] * jnp.cos(t))

    run = ss.simulate(Forced(), 0.0, 2.0, State(0.0, 0.0), args={"force": 3.0})
    assert abs(run.y1.x - 3.0 * (1 - np.cos(2.0))) < 1e-10


@pytest.mark.more
def test_one_lane_is_the_same_under_vmap_and_in_chunks():
    speeds = jnp.linspace(0.2, 0.4, 7)

    def end(v):
        return ss.simulate(
            StickSlip(v),
            0.0,
            20.0,
            State(0.0 * v, v),
            0,
            integrator=fixed(0.3),
            saveat=ss.SaveAt(max_events=16),
        )

    together = jax.jit(jax.vmap(end))(speeds)
    x = [stick_slip_motion(20.0, float(v))[0] for v in speeds]
    np.testing.assert_allclose(together.y1.x, x, rtol=0, atol=1e-10)
    for executor, chunk in (("portable", 3), ("fused", 4), ("fused", 64)):
        chunks = ss.map_lanes(end, executor=executor, chunk_size=chunk)(speeds)
        np.testing.assert_allclose(chunks.y1.x, together.y1.x, rtol=0, atol=1e-13)
        np.testing.assert_allclose(chunks.events.t, together.events.t, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(chunks.sequence, together.sequence)


@pytest.mark.more
def test_recorded_sections_do_not_change_the_motion():
    sections = (
        ss.Section(lambda system, t, y, dy, mode, args: dy.v + 0.2, "rising"),
        ss.Section(lambda system, t, y, dy, mode, args: dy.v, "both"),
    )

    def end(sections):
        return ss.simulate(StickSlip(0.2), 0.0, 20.0, START, saveat=ss.SaveAt(sections=sections))

    bare, cut = end(()), end(sections)
    assert int(cut.crossings[0].count) > 0
    assert int(cut.stats.num_accepted) == int(bare.stats.num_accepted)
    assert int(cut.stats.num_attempts) == int(bare.stats.num_attempts)
    np.testing.assert_allclose(cut.y1.x, bare.y1.x, rtol=0, atol=1e-14)


@pytest.mark.more
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_short_excursion_through_a_section_is_seen_from_both_sides(side):
    """x = cos(t - 3) is above 0.999 for 0.09 s, between two ends of steps of 0.21 s."""

    def gap(system, t, y, dy, mode, args):
        return side * (0.999 - y.x)

    both, falling = (
        ss.simulate(
            Circle(-5.0), 0.0, 6.0, State(float(np.cos(3.0)), float(np.sin(3.0))),
            saveat=ss.SaveAt(sections=ss.Section(gap, direction)), integrator=fixed(0.21),
        ).crossings[0]
        for direction in ("both", "falling")
    )  # fmt: skip
    half = np.arccos(0.999)
    assert (int(both.count), int(falling.count)) == (2, 1)
    np.testing.assert_allclose(both.t[:2], [3.0 - half, 3.0 + half], rtol=0, atol=1e-10)
    np.testing.assert_allclose(falling.t[0], 3.0 - side * half, rtol=0, atol=1e-10)
