"""Events where integrators go wrong; each has a defined answer."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid import raise_failures
from tests.stickslip.hybrid._systems import Circle, Flight, Parabola, State, StickSlip, fixed


def test_guard_violated_at_the_start_fires_at_the_start():
    run = ss.simulate(Circle(0.5), 0.0, 1.0, State(0.2, 0.0), "above", integrator=fixed(0.4))
    assert run.events.t[0] == 0.0
    assert run.flags & 4
    assert run.mode1 == 1


def test_guard_that_starts_at_zero_and_rises_does_not_fire():
    """x = sin t starts on the level and rises; the first event is the fall at pi."""
    run = ss.simulate(Circle(0.0), 0.0, 4.0, State(0.0, 1.0), "above", integrator=fixed(0.7))
    assert run.num_events == 1
    assert abs(run.events.t[0] - np.pi) < 1e-7  # the step of 0.7 is coarse; the event is not
    assert run.flags == 0


def test_guard_that_starts_at_zero_and_falls_fires_at_once():
    run = ss.simulate(Circle(0.0), 0.0, 2.0, State(0.0, -1.0), "above", integrator=fixed(0.7))
    assert abs(run.events.t[0]) < 1e-14
    assert run.num_events == 1


def test_guard_that_starts_below_zero_by_rounding_does_not_fire_before_the_start():
    """x = -9e-13 - sin t has passed the level 9e-13 s before the run begins."""

    class Metres(Circle):
        guard_scales: ClassVar = (1.0, 1.0)

    run = ss.simulate(Metres(), 0.0, 1.0, State(-9e-13, -1.0), "above", integrator=fixed(0.4))
    assert float(run.events.t[0]) == 0.0
    assert float(run.events.y_after.x[0]) == -9e-13
    assert run.num_events == 1


def test_guard_that_is_zero_for_a_while_fires_where_that_ends():
    """At 1.3 s; the search in the step of 4 s looks at 2 s and at 1 s."""

    class Late(Circle):
        def guards(self, t, y, mode, args):
            return jnp.where(mode == 0, -jnp.maximum(t - 1.3, 0.0), 1.0), jnp.ones(())

    run = ss.simulate(Late(), 0.0, 8.0, State(1.0, 0.0), "above", integrator=fixed(4.0))
    np.testing.assert_allclose(run.events.t[0], 1.3, rtol=1e-12)
    assert run.num_events == 1


def test_run_ends_where_the_second_of_two_guards_has_no_value_any_more():
    class Lost(Circle):
        def guards(self, t, y, mode, args):
            return jnp.ones(()), 1.0 + jnp.sqrt(1.0 - t)

    run = ss.simulate(Lost(), 0.0, 2.0, State(1.0, 0.0), "above", integrator=fixed(0.3), throw=False)
    assert run.result == ss.RESULTS.nonfinite
    np.testing.assert_allclose(run.t1, 0.9, rtol=1e-12)


def test_short_rise_from_zero_within_one_step():
    """From zero with a small upward speed the ball is back on the floor after 0.02, in one step."""
    run = ss.simulate(
        Flight(),
        0.0,
        0.015,
        State(0.0, 0.01),
        integrator=fixed(1.0, "rk4"),
        saveat=ss.SaveAt(max_events=32),
    )
    assert run.num_events == 0
    run = ss.simulate(
        Flight(),
        0.0,
        0.025,
        State(0.0, 0.01),
        integrator=fixed(1.0, "rk4"),
        saveat=ss.SaveAt(max_events=32),
    )
    assert run.num_events == 1
    assert abs(run.events.t[0] - 0.02) < 1e-15


@pytest.mark.parametrize("depth", [0.1, 1e-3, 1e-6, 1e-10])
def test_excursion_within_one_step_is_found(depth):
    """A parabola dips below the level for a time much shorter than the step; it is convex."""
    run = ss.simulate(
        Parabola(0.0), 0.0, 4.0, State(1.0 - depth, -(2.0**0.5)), integrator=fixed(1.1, "rk4")
    )
    assert run.num_events == 2
    half = (2 * depth) ** 0.5
    np.testing.assert_allclose(
        run.events.t[:2], [2**0.5 - half, 2**0.5 + half], rtol=0, atol=1e-15 / half
    )


def test_excursion_without_dip_detection_needs_a_bounded_step():
    level = -1.0 + 1e-4
    blind = ss.Integrator(step=ss.FixedStep(1.1), detect_dips=False)
    missed = ss.simulate(Circle(level), 0.0, 6.0, State(1.0, 0.0), integrator=blind)
    assert missed.num_events == 0
    step = ss.AdaptiveStep(1e-10, 1e-10, dtmax=0.01)
    bounded = ss.Integrator(step=step, detect_dips=False)
    found = ss.simulate(Circle(level), 0.0, 6.0, State(1.0, 0.0), integrator=bounded)
    assert found.num_events == 2


def test_two_crossings_of_one_section_in_one_step():
    section = ss.Section(lambda system, t, y, dy, mode, args: y.x + 0.999, "both")
    run = ss.simulate(
        Parabola(-9.0), 0.0, 4.0, State(0.0, -(2.0**0.5)), saveat=ss.SaveAt(sections=section),
        integrator=fixed(1.3, "rk4"),
    )  # fmt: skip
    half = (2 * 1e-3) ** 0.5
    assert run.crossings[0].count == 2
    np.testing.assert_allclose(
        run.crossings[0].t[:2], [2**0.5 - half, 2**0.5 + half], rtol=0, atol=1e-13
    )


def test_event_at_an_output_time_comes_first():
    """The release of the block at F_s/v = 5 falls on an output: the output is after the event."""
    run = ss.simulate(
        StickSlip(0.2), 0.0, 6.0, State(0.0, 0.2), saveat=ss.SaveAt(ts=[4.0, 5.0, 5.0, 6.0])
    )
    assert abs(run.events.t[0] - 5.0) < 1e-13
    assert run.outputs.count == 4
    np.testing.assert_allclose(run.outputs.y.x[:3], [0.8, 1.0, 1.0], atol=1e-13)


def test_event_at_the_end():
    run = ss.simulate(StickSlip(0.2), 0.0, 5.0, State(0.0, 0.2))
    assert abs(run.y1.x - 1.0) < 1e-14
    assert run.result == ss.RESULTS.successful
    later = ss.simulate(StickSlip(0.2), 0.0, 5.0 + 1e-9, State(0.0, 0.2))
    assert later.num_events == 1


def test_two_sided_in_one_step_fire_in_order():
    class Two(Circle):
        guard_names: ClassVar = ("first", "second")
        mode_names: ClassVar = ("none", "one", "both")

        def guards(self, t, y, mode, args):
            return (
                jnp.where(mode == 0, y.x - 0.5, 1.0),
                jnp.where(mode == 1, y.x - 0.48, 1.0),
            )

        def transition(self, t, y, mode, guard, args):
            return y, mode + 1

    run = ss.simulate(Two(), 0.0, 2.0, State(1.0, 0.0), 0, integrator=fixed(0.3))
    np.testing.assert_allclose(run.events.t[:2], np.arccos([0.5, 0.48]), rtol=0, atol=1e-11)
    assert run.num_events == 2


def test_both_guards_of_one_mode_the_nearer_one_wins():
    class Band(Circle):
        guard_names: ClassVar = ("low", "high")

        def guards(self, t, y, mode, args):
            return y.x + 0.5, 1e-3 * (0.9 - y.v)

        def transition(self, t, y, mode, guard, args):
            return State(y.x, 0.0 * y.v), mode

    # sin t from x = -0.2: v starts at 0.95 > 0.9? no: the band is left at its low end first.
    run = ss.simulate(Band(), 0.0, 1.2, State(-0.2, -0.6), 0, integrator=fixed(1.0))
    phase = np.arctan2(0.6, -0.2)
    time = np.arccos(-0.5 / np.hypot(0.2, 0.6)) - phase
    assert run.events.guard[0] == 0
    assert abs(run.events.t[0] - time) < 1e-8


def test_zeno_ends_with_a_code_not_a_hang():
    """A bouncing ball's impacts accumulate at t = (1 + e)/(1 - e) sqrt(2 x0/g)."""
    run = ss.simulate(
        Flight(),
        0.0,
        10.0,
        State(0.5, 0.0),
        integrator=fixed(0.5, "rk4"),
        saveat=ss.SaveAt(max_events=200),
        throw=False,
    )
    assert run.result == ss.RESULTS.chattering
    assert abs(run.t1 - 3.0) < 1e-6
    n = int(run.events.count)
    expected = 1.0 + 2.0 * np.cumsum(0.5 ** np.arange(1, 20))
    np.testing.assert_allclose(run.events.t[1:20], expected, rtol=0, atol=1e-12)
    assert n > 40


def test_rising_and_both_directions_of_guards():
    class Words(Circle):
        guard_directions: ClassVar = ("falling", "rising")

        def guards(self, t, y, mode, args):
            above = mode == 0
            return jnp.where(above, y.x - 0.5, 1.0), jnp.where(above, -1.0, y.x - 0.5)

    run = ss.simulate(Words(), 0.0, 7.0, State(1.0, 0.0), 0, integrator=fixed(0.3))
    np.testing.assert_allclose(run.events.t[:2], np.array([1, 5]) * np.pi / 3, rtol=0, atol=1e-10)

    class Counter(Circle):
        mode_names: ClassVar = ("any",)
        guard_names: ClassVar = ("v passes 1/2",)
        guard_directions: ClassVar = ("both",)

        def guards(self, t, y, mode, args):
            return (y.v - 0.5,)

        def transition(self, t, y, mode, guard, args):
            return y, mode

    # v = -sin t passes 1/2 upwards at 7 pi/6 and downwards at 11 pi/6.
    run = ss.simulate(Counter(), 0.0, 8.0, State(1.0, 0.0), 0, integrator=fixed(0.3))
    np.testing.assert_allclose(run.events.t[:2], np.array([7, 11]) * np.pi / 6, rtol=0, atol=1e-10)
    assert run.num_events == 2
    assert run.flags == 0


def test_lanes_fail_each_in_their_own_way():
    class Mixed(Circle):
        fate: object = 0

        def vector_field(self, t, y, mode, args):
            blow = jnp.where(self.fate == 1, 5.0 * y.x * y.x, -y.x)
            return State(y.v, blow)

        def transition(self, t, y, mode, guard, args):
            return y, jnp.where(self.fate == 2, -1, jnp.where(self.fate == 3, mode, 1 - mode))

        def guards(self, t, y, mode, args):
            trap = jnp.where(self.fate == 3, -1.0, y.x - self.level)
            return jnp.where(mode == 0, trap, 1.0), jnp.where(mode == 0, 1.0, self.level - y.x)

    def lane(fate):
        return ss.simulate(
            Mixed(0.0, 1.0, fate), 0.0, 12.0, State(1.0, 0.0), 0,
            integrator=fixed(0.1, "rk4"), saveat=ss.SaveAt(max_events=20), throw=False,
        )  # fmt: skip

    run = jax.vmap(lane)(jnp.array([0, 1, 2, 3]))
    names = [
        next(n for n in ("successful", "nonfinite", "no_admissible_mode", "chattering")
             if bool((run.result == getattr(ss.RESULTS, n))[i])) for i in range(4)
    ]  # fmt: skip
    assert names == ["successful", "nonfinite", "no_admissible_mode", "chattering"]
    np.testing.assert_allclose(run.events.t[0, :2], [np.pi / 2, 3 * np.pi / 2], atol=1e-5)
    assert np.isfinite(np.asarray(run.y1.x)).all()


@pytest.mark.more
def test_good_lanes_are_not_disturbed_by_bad_ones():
    def lane(v):
        return ss.simulate(
            StickSlip(v),
            0.0,
            20.0,
            State(0.0 * v, v),
            0,
            integrator=fixed(0.3),
            throw=False,
            saveat=ss.SaveAt(max_events=16),
        )

    alone = jax.vmap(lane)(jnp.array([0.2, 0.3]))
    mixed = jax.vmap(lane)(jnp.array([0.2, jnp.nan, 0.3]))
    np.testing.assert_array_equal(mixed.y1.x[jnp.array([0, 2])], alone.y1.x)
    assert not bool(mixed.successful[1])


@pytest.mark.more
def test_throw_raises_the_message():
    given = StickSlip(0.2), 0.0, 50.0, State(0.0, 0.2)
    # Outside of a transformation the error keeps what was computed, and says nothing of compilers.
    message = r"^max_events_reached \(the run got to t = [0-9.]+ s\): The log of events is full"
    with pytest.raises(ss.SimulationError, match=message) as caught:
        ss.simulate(*given, saveat=ss.SaveAt(max_events=3))
    kept = ss.simulate(*given, saveat=ss.SaveAt(max_events=3), throw=False)
    jax.tree.map(np.testing.assert_array_equal, caught.value.solution.y1, kept.y1)
    assert 0.0 < float(kept.t1) < 50.0
    with pytest.raises(Exception, match="log of events is full"):
        jax.jit(lambda: ss.simulate(*given, saveat=ss.SaveAt(max_events=3)))()
    many = jax.vmap(
        lambda v: ss.simulate(*given[:3], State(0.0, v), saveat=ss.SaveAt(max_events=3), throw=False)
    )
    found = many(jnp.array([0.2, 0.1]))
    with pytest.raises(ss.SimulationError, match=r"^1 of 2 runs failed:\n  1 max_events_reached: "):
        raise_failures(found, jnp.array([True, False]))
    with pytest.raises(ValueError, match=r"successful.*one flag, or of the shape of the results"):
        raise_failures(found, jnp.array([True, False, True]))


@pytest.mark.more
def test_max_steps_and_crossings_have_codes():
    few = ss.Integrator(step=ss.FixedStep(0.1), max_steps=20)
    run = ss.simulate(Circle(-2.0), 0.0, 50.0, State(1.0, 0.0), integrator=few, throw=False)
    assert run.result == ss.RESULTS.max_steps_reached
    assert run.t1 < 3.0
    section = ss.Section(lambda system, t, y, dy, mode, args: y.v, "both")
    run = ss.simulate(
        Circle(-2.0),
        0.0,
        50.0,
        State(1.0, 0.0),
        saveat=ss.SaveAt(sections=section, max_crossings=3),
        throw=False,
    )
    assert run.result == ss.RESULTS.max_crossings_reached
    assert run.crossings[0].count == 3


@pytest.mark.more
def test_adaptive_step_gives_up_at_dtmin():
    class Wall(Circle):
        def vector_field(self, t, y, mode, args):
            return State(1.0 / jnp.sqrt(1.0 - y.x), 0.0 * y.v)

    step = ss.AdaptiveStep(1e-8, 1e-8, dtmin=1e-9)
    run = ss.simulate(
        Wall(-5.0), 0.0, 2.0, State(0.0, 0.0), integrator=ss.Integrator(step=step), throw=False
    )
    assert run.result == ss.RESULTS.dt_min_reached
    assert abs(run.t1 - 2.0 / 3.0) < 1e-3  # the solution ends at t = 2/3
