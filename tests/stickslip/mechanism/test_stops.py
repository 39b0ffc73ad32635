"""Rigid stops against closed forms: impacts, rest, loads that lift, collisions, walls of any shape."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ellipkinc

import stickslip as ss
from stickslip.friction import Coulomb
from tests.stickslip.mechanism._machines import flat
from tests.stickslip.mechanism._stopped import (
    Ball,
    Box,
    DryPendulum,
    Guided,
    Pair,
    Pendulum,
    Pushed,
    Row,
    Wire,
)

FINE = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12))


def names_after(machine, run):
    return [machine.mode_names[int(m)] for m in run.events.mode_after[: int(run.num_events)]]


def times_of(run):
    return np.asarray(run.events.t[: int(run.num_events)])


@pytest.mark.more
def test_impacts_of_a_ball_and_their_limit():
    """Dropped from h, t_n = t_1 (1 + 2 e (1 - e^(n-1)) / (1 - e)); the limit is t_1 (1 + e)/(1 - e)."""
    e, g, h = 0.5, 2.0, 3.0
    ball = Ball(e, rest=0.0, weight=g)
    run = ss.simulate(ball, 0.0, 9.0, ball.state(x=h), throw=False)
    first = np.sqrt(2 * h / g)
    n = np.arange(20)
    np.testing.assert_allclose(
        run.events.t[:20], first * (1 + 2 * e * (1 - e**n) / (1 - e)), rtol=1e-13
    )
    np.testing.assert_allclose(run.events.y_after.v_x[:20], e ** (n + 1) * g * first, rtol=1e-11)
    assert run.result == ss.RESULTS.chattering
    np.testing.assert_allclose(run.t1, first * (1 + e) / (1 - e), atol=1e-6)


def flight(e, g, h):
    """Height at t = 3.5 after two impacts."""
    first, v = (2 * h / g) ** 0.5, (2 * g * h) ** 0.5
    since = 3.5 - first - 2 * e * v / g
    return e**2 * v * since - 0.5 * g * since**2


@pytest.mark.more
def test_derivatives_through_impacts_are_those_of_the_closed_form():
    p = jnp.array([0.5, 2.0, 3.0])

    def end(p):
        ball = Ball(p[0], rest=0.0, weight=p[1])
        return ss.simulate(ball, 0.0, 3.5, ball.state(x=p[2]), saveat=ss.SaveAt(max_events=8)).y1.x

    exact = jax.grad(lambda p: flight(*p))(p)
    np.testing.assert_allclose(end(p), flight(*p), rtol=1e-12)
    # The rate at an impact is that where it is located, to 1e-11 of a step, from where one Newton step
    # leads onto it: to as much of its own size the derivative of its time is known.
    np.testing.assert_allclose(jax.jit(jax.jacfwd(end))(p), exact, rtol=1e-11)
    np.testing.assert_allclose(jax.jit(jax.grad(end))(p), exact, rtol=1e-11)
    many = jax.vmap(end)(p[None] + jnp.linspace(0.0, 0.1, 5)[:, None])
    assert many.shape == (5,)
    assert float(many[0]) == pytest.approx(float(flight(*p)), rel=1e-12)


def test_a_ball_at_rest_leaves_when_the_load_lifts_it():
    """It rests while extra cos(omega t) < weight, and is lifted from there."""
    ball = Ball(0.4, rest=1e-3, extra=1.5, omega=0.3)
    run = ss.simulate(ball, 0.0, 18.5, ball.state(x=0.0))
    leave = (2 * np.pi - np.arccos(1 / 1.5)) / 0.3
    assert names_after(ball, run)[-2:] == ["closed", "open"]
    np.testing.assert_allclose(times_of(run)[-1], leave, rtol=1e-13)
    since = 18.5 - leave
    height = 1.5 / 0.09 * (np.cos(0.3 * leave) - np.cos(0.3 * 18.5)) - 0.5 * since**2
    height -= 1.5 / 0.3 * np.sin(0.3 * leave) * since
    np.testing.assert_allclose(run.y1.x, height, atol=1e-11)


def test_a_ball_rides_a_shaken_table_until_it_falls_faster_than_weight():
    table, omega = 0.5, 2.0
    ball = Ball(0.6, table=table, omega=omega)
    run = ss.simulate(ball, 0.0, 1.5, ball.state(v_x=table * omega))
    assert ball.mode_names[int(run.events.mode_before[0])] == "closed"
    leave = np.arcsin(1.0 / (table * omega**2)) / omega
    np.testing.assert_allclose(times_of(run), [leave], rtol=1e-11)
    since = 1.5 - leave
    x = table * np.sin(omega * leave) + table * omega * np.cos(omega * leave) * since
    np.testing.assert_allclose(run.y1.x, x - 0.5 * since**2, atol=1e-11)


def test_a_moving_stop_gives_its_speed():
    """Newton's law holds for the speeds relative to the table."""
    ball = Ball(0.6, table=0.2, omega=3.0)
    run = ss.simulate(ball, 0.0, 6.0, ball.state(x=1.0))
    count = int(run.num_events)
    assert count == 3
    t = times_of(run)
    speed = 0.6 * np.cos(3.0 * t)
    before, after = (np.asarray(y.v_x[:count]) for y in (run.events.y_before, run.events.y_after))
    np.testing.assert_allclose(after - speed, -0.6 * (before - speed), rtol=1e-10)
    np.testing.assert_allclose(run.events.y_after.x[:count], 0.2 * np.sin(3.0 * t), atol=1e-15)


@pytest.mark.more
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_two_masses_collide(e):
    pair = Pair((1.0, 3.0), e, push=(0.5, 0.0))
    run = ss.simulate(
        pair, 0.0, 1.0, pair.state(y=1.0, v_x=2.0, v_y=-1.0), saveat=ss.SaveAt(max_events=4)
    )
    t = (-3.0 + np.sqrt(9.0 + 1.0)) / 0.5  # 1 = 3 t + t^2 / 4
    np.testing.assert_allclose(run.events.t[0], t, rtol=1e-13)
    before = np.array([2.0 + 0.5 * t, -1.0])
    mean = (before[0] + 3.0 * before[1]) / 4.0
    after = mean + e * (before[0] - before[1]) * np.array([-3.0, 1.0]) / 4.0
    np.testing.assert_allclose(flat(run.events.y_after)[2:, 0], after, rtol=1e-13)
    # The push holds them together after a plastic collision only.
    assert pair.mode_names[int(run.mode1)] == ("closed" if e == 0.0 else "open")
    if e == 0.0:
        force = pair.stop_forces(run.t1, run.y1, run.mode1)["bumper"]
        np.testing.assert_allclose(force, 0.5 * 3.0 / 4.0, rtol=1e-13)
        np.testing.assert_allclose(run.y1.v_y, mean + 0.125 * (1.0 - t), rtol=1e-12)


@pytest.mark.more
@pytest.mark.parametrize("e", [0.0, 0.3])
def test_a_mass_dropped_on_a_block_that_friction_holds(e):
    """The block takes the impulse, for friction is finite; then friction stops it again."""
    M, m, g, limit = 2.0, 1.0, 10.0, (100.0, 50.0)
    machine = Guided((M, m), e, Coulomb(*limit))
    run = ss.simulate(machine, 0.0, 2.0, machine.state(mass=1.0))
    fall = np.sqrt(2 / g)
    common = m * -g * fall / (M + m)
    np.testing.assert_allclose(run.events.t[0], fall, rtol=1e-13)
    first = np.asarray(flat(run.events.y_after))[2:, 0]
    expected = common + e * g * fall * np.array([-m, M]) / (M + m)
    np.testing.assert_allclose(first, expected, rtol=1e-12)
    modes = names_after(machine, run)
    assert modes[0].startswith("slip backward")
    assert modes[-1] == "stick / closed"
    if e == 0.0:
        assert modes == ["slip backward / closed", "stick / closed"]
        brake = (limit[1] - (M + m) * g) / (M + m)
        np.testing.assert_allclose(run.events.t[1] - fall, -common / brake, rtol=1e-12)
        np.testing.assert_allclose(run.y1.block, -(common**2) / (2 * brake), rtol=1e-12)
        np.testing.assert_allclose(
            machine.stop_forces(run.t1, run.y1, run.mode1)["top"], m * g, rtol=1e-13
        )
        np.testing.assert_allclose(
            machine.friction_forces(run.t1, run.y1, run.mode1)["guide"], (M + m) * g, rtol=1e-13
        )
    assert run.y1.mass == run.y1.block


def quarter(amplitude, angle, g=9.81):
    """Time of a pendulum from rest at `amplitude` to `angle`."""
    k = np.sin(0.5 * amplitude) ** 2
    phase = np.arcsin(np.sin(0.5 * angle) / np.sin(0.5 * amplitude))
    return (ellipkinc(np.pi / 2, k) - ellipkinc(phase, k)) / np.sqrt(g)


@pytest.mark.more
def test_pendulum_against_a_wall():
    """The gap is no linear function of the angle; times are elliptic integrals."""
    e, g, start, wall = 0.6, 9.81, 0.8, 0.3
    machine = Pendulum(wall, e)
    run = ss.simulate(machine, 0.0, 4.0, machine.state(a=start), integrator=FINE)
    angle = -np.arcsin(wall)
    speed = np.sqrt(2 * g * (np.cos(angle) - np.cos(start)))
    times, swing, at = [], start, 0.0
    t = quarter(swing, angle)
    while t < 4.0:
        times.append(t)
        speed *= e
        swing = np.arccos(np.cos(angle) - speed**2 / (2 * g))
        # Up from the wall to -swing and back, or over the bottom to swing and back.
        t += 2 * quarter(swing, angle)
    at = len(times)
    assert int(run.num_events) == at == 3
    np.testing.assert_allclose(run.events.t[:at], times, atol=1e-10)
    np.testing.assert_allclose(
        run.events.y_after.v_a[:at], speed / e**at * e ** np.arange(1, at + 1), rtol=1e-10
    )
    np.testing.assert_allclose(run.events.y_after.a[:at], angle, rtol=1e-15)


@pytest.mark.more
def test_pendulum_comes_to_rest_on_a_wall():
    machine = Pendulum(-0.3, 0.6, rest=1e-2)
    run = ss.simulate(machine, 0.0, 4.0, machine.state(a=0.8))
    assert machine.mode_names[int(run.mode1)] == "closed"
    assert float(run.y1.v_a) == 0.0
    np.testing.assert_allclose(run.y1.a, np.arcsin(0.3), rtol=1e-15)
    # The weight 9.81 sin(a) over the slope cos(a) of the gap.
    force = machine.stop_forces(run.t1, run.y1, run.mode1)["wall"]
    np.testing.assert_allclose(force, 9.81 * np.tan(np.arcsin(0.3)), rtol=1e-13)


@pytest.mark.more
def test_dry_pendulum_gives_up_the_energy_of_its_joint():
    """A contact and a stop of one velocity; swings fall by the friction at every turn."""
    friction, e, wall = 0.3, 0.6, 0.3
    machine = DryPendulum(wall, e, law=Coulomb(0.3))
    run = ss.simulate(machine, 0.0, 2.0, machine.state(a=0.8))
    angle = -np.arcsin(wall)
    drop = 9.81 * (np.cos(angle) - np.cos(0.8)) - friction * (0.8 - angle)
    assert names_after(machine, run)[0] == "slip forward / open"
    np.testing.assert_allclose(run.events.y_before.v_a[0], -np.sqrt(2 * drop), rtol=1e-9)


@pytest.mark.more
def test_a_belt_carries_a_block_to_a_wall():
    """It bounces against sliding friction, always at the speed of the contact; then it is pressed."""
    e, kinetic, belt = 0.6, 0.3, 0.5
    block = Pushed(Coulomb(0.5, kinetic), lambda t: 0.0 * t, e, belt=belt, rest=1e-3)
    run = ss.simulate(block, 0.0, 20.0, block.state(x=0.5))
    start, wall = belt / kinetic, 1.0 - 0.5 - belt**2 / (2 * kinetic)
    times = [start, start + wall / belt]
    speed = belt
    while e * speed > 1e-3:
        speed *= e
        times.append(times[-1] + 2 * speed / kinetic)
    np.testing.assert_allclose(times_of(run), times, rtol=1e-10)
    assert block.mode_names[int(run.mode1)] == "slip backward / open / closed"
    np.testing.assert_allclose(
        block.stop_forces(run.t1, run.y1, run.mode1)["right"], kinetic, rtol=1e-13
    )
    assert float(run.y1.x) == 1.0


@pytest.mark.more
def test_a_mass_comes_to_rest_in_a_corner():
    """Every impact on one plane throws it off the other: rest needs the speeds off both."""
    box = Box(0.5, rest=1e-4)
    run = ss.simulate(box, 0.0, 6.0, box.state(x=-0.2, y=1.0))
    assert box.mode_names[int(run.mode1)] == "closed / closed"
    np.testing.assert_allclose(flat(run.y1), 0.0, atol=1e-18)
    forces = box.stop_forces(run.t1, run.y1, run.mode1)
    # Off the planes: left (0.5, 1) and right (-1, 1); together they bear (0.3, 1).
    np.testing.assert_allclose([forces["left plane"], forces["right plane"]], [1.3 / 1.5, 0.2 / 1.5])


@pytest.mark.more
def test_an_impact_pushes_on_what_touches():
    """Plastic: three masses go on together; the momentum is that of one. Elastic ones hand it on."""
    row = Row((1.0, 1.0, 1.0), (), 0.0, stiffness=0.0, drive=0.0)
    run = ss.simulate(row, 0.0, 2.0, row.state(x_0=-1.0, x_2=-0.2, v_x_0=1.0))
    np.testing.assert_allclose(flat(run.y1)[3:], 1 / 3, rtol=1e-15)
    assert row.mode_names[int(run.mode1)] == "closed / closed"
    row = Row((1.0, 1.0, 1.0), (), 1.0, stiffness=0.0, drive=0.0)
    run = ss.simulate(row, 0.0, 2.0, row.state(x_0=-1.0, x_2=0.0, v_x_0=1.0))
    np.testing.assert_allclose(flat(run.y1)[3:], [0.0, 0.0, 1.0], atol=1e-15)


@pytest.mark.more
def test_two_stops_reached_in_one_instant():
    """A middle mass is met from both sides at once: one after the other, and flagged."""
    row = Row((1.0, 1.0, 1.0), (), 0.5, rest=0.0, stiffness=0.0, drive=0.0)
    run = ss.simulate(row, 0.0, 5.0, row.state(x_0=-1.0, x_2=1.0, v_x_0=1.0, v_x_2=-1.0))
    assert int(run.num_events) >= 2
    np.testing.assert_allclose(run.events.t[:2], 1.2, rtol=1e-13)
    assert not run.differentiable
    speeds = np.asarray(flat(run.y1))[3:]
    np.testing.assert_allclose(speeds.sum(), 0.0, atol=1e-14)
    assert (np.diff(speeds) >= -1e-14).all()


@pytest.mark.more
def test_a_bead_slides_on_a_curve():
    """Closed on a stop whose direction turns: it swings in the bowl y = x^2 without loss."""
    wire = Wire(0.0)
    start = wire.state(x=0.5, y=0.25)
    run = ss.simulate(wire, 0.0, 20.0, start, integrator=FINE)
    assert wire.mode_names[int(run.mode1)] == "closed"
    assert int(run.num_events) == 0
    np.testing.assert_allclose(wire.energy(run.y1), wire.energy(start), rtol=1e-9)
    np.testing.assert_allclose(run.y1.y, run.y1.x**2, atol=1e-8)
    # At the lowest point it bears the weight and the centripetal force m v^2 / R, R = 1/2.
    low = wire.state(v_x=0.4)
    closed = wire.mode_names.index("closed")
    np.testing.assert_allclose(wire.stop_forces(0.0, low, closed)["bowl"], 1.0 + 2 * 0.4**2)


@pytest.mark.more
@pytest.mark.parametrize("size", [1e-9, *(pytest.param(s, marks=pytest.mark.slow) for s in (1.0, 1e6))])
def test_no_length_is_special(size):
    """The same motion in nanometres and in thousands of kilometres."""

    def runs(scale):
        block = Pushed(
            Coulomb(0.5 * scale, 0.3 * scale), lambda t: scale * jnp.sin(0.7 * t), 0.6,
            width=scale, rest=1e-6 * scale,
        )  # fmt: skip
        run = ss.simulate(block, 0.0, 20.0, block.state(x=0.5 * scale))
        return np.asarray(flat(run.y1)) / scale, run.sequence

    (found, sequence), (expected, other) = runs(size), runs(0.7)
    np.testing.assert_allclose(found, expected, rtol=1e-7)
    assert sequence == other


def test_a_stop_that_is_only_touched_is_flagged():
    """It has no speed left at the stop: rounding decides whether there is an impact."""
    up = Ball(0.5, weight=-1.0)
    run = ss.simulate(up, 0.0, 5.0, up.state(x=0.5, v_x=-1.0))
    assert not run.differentiable
    higher = ss.simulate(up, 0.0, 5.0, up.state(x=0.5, v_x=-0.9))
    assert higher.differentiable
    assert int(higher.num_events) == 0
    lower = ss.simulate(up, 0.0, 5.0, up.state(x=0.5, v_x=-1.1))
    assert lower.differentiable
    assert int(lower.num_events) == 1


@pytest.mark.parametrize(
    ("x", "v", "mode"),
    [
        (1.0, 0.0, "open"),
        (0.0, 0.0, "closed"),
        (0.0, 1.0, "open"),
        (0.0, -1.0, "open"),  # the impact is the first event
        (-1e-9, 0.0, None),
    ],
)
def test_where_a_run_begins(x, v, mode):
    ball = Ball(0.5)
    number = int(ball.initial_mode(0.0, ball.state(x=x, v_x=v), None))
    assert number == (-1 if mode is None else ball.mode_names.index(mode))
    if v < 0.0:
        run = ss.simulate(ball, 0.0, 0.5, ball.state(x=x, v_x=v))
        np.testing.assert_allclose(run.y1.x, 0.5 * 0.5 - 0.125, rtol=1e-12)
