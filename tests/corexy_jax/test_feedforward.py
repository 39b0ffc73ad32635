"""Voltages without belt slip against Newton's equations, SciPy's optimisers and the exact engine."""

import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

import corexy_jax as cx
import stickslip as ss

MACHINE = cx.CoreXYParameters(P1=20.0, P2=30.0, mu_1s_b=3.0, mu_2s_b=3.0)
CORNER = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.25, 0.05))
CORRECTED = cx.Errata.corrected()


@functools.cache
def plan(volts: float = 24.0, **options) -> cx.Feedforward:
    return cx.feedforward(MACHINE, CORNER, volts=volts, **options)


@functools.cache
def check(volts: float = 24.0) -> cx.RollingCheck:
    return cx.check_rolling(plan(volts))


def needed(found: cx.CoreXYSolution, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Friction coefficients that the belts need and the voltages, by the paper's Eqs. (77)-(84)."""
    y = jax.tree.map(lambda a: a[row], found.y)
    a = jax.tree.map(lambda a: a[row], found.a)
    p, senses = found.parameters, found.senses[row]
    volts = found.voltage(found.t[row])
    torques = [cx.motor_torque(p, v, w) for v, w in zip(volts, (y.omega_1, y.omega_2), strict=True)]
    ground = [-2.0 * p.mu_k * P * p.r_f * s for P, s in ((p.P1, senses[4]), (p.P2, senses[5]))]
    need = cx.needed_friction(p, (a.alpha_1, a.alpha_2), tuple(torques), tuple(ground), CORRECTED)
    return np.array([need.mu_1s, need.mu_2s]), np.array(volts)


@pytest.mark.more
@pytest.mark.parametrize("volts", [24.0, pytest.param(2.5, marks=pytest.mark.slow)])
def test_the_collar_follows_the_path_with_both_motors_rolling(volts):
    found, made = check(volts), plan(volts)
    assert np.all(found.rolls)
    np.testing.assert_allclose(found.slip, 0.0, atol=1e-15)
    assert np.all(found.solution.dmn == 1)
    assert found.deviation < 1e-12
    assert found.end_error < 1e-12
    assert found.at_rest
    assert int(found.solution.flags) == 0
    assert str(found).startswith("both motors roll all the time; the collar ends ")
    for t, place in zip(made.leg_times, CORNER, strict=True):
        np.testing.assert_allclose(made.at(t), place, atol=1e-14)


@pytest.mark.more
def test_the_limits_are_kept_and_reached():
    found, made = check().solution, plan()
    # Of a line along which all contacts slide the forces are told; the last leg is one.
    t, begin, end = np.asarray(found.t), *(float(a) for a in made.leg_times[2:])
    rows = np.flatnonzero((t > begin + 0.03 * (end - begin)) & (t < begin + 0.99 * (end - begin)))
    shares = np.array([needed(found, row)[0] for row in rows]) / 3.0
    np.testing.assert_allclose(np.max(shares, axis=1), 0.9, rtol=1e-9)
    limits = 3.0 * 2.0 * np.array([20.0, 30.0])
    assert np.all(np.abs(made.belt_force) <= 0.9 * limits * (1.0 + 1e-9))


def fastest(p: cx.CoreXYParameters, direction: np.ndarray, sign: float, margin: float) -> float:
    """Greatest acceleration along a line, from the equations of each part by SciPy: forces of the
    belts, of what may stand still, and of what slides."""
    m_x = p.m + 8.0 * p.J_passive / p.r**2
    m_y = p.M + p.m + 4.0 * p.J_passive / p.r**2
    c = 2.0 * 2.0**0.5
    loads = (p.m * p.g + c * (p.P1 + p.P2), (p.M + p.m) * p.g, c * p.P1, c * p.P2)
    loads = np.array([float(a) for a in loads])
    lines = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    turns = lines @ direction
    turns[np.abs(turns) < 1e-12] = 0.0
    # Unknown: a, both belt forces, friction of the four lines.
    balance = np.zeros((2, 7))
    balance[:, 0] = np.array([m_x, m_y]) * direction
    balance[:, 1:3] = -np.array([[1.0, 1.0], [1.0, -1.0]])
    balance[:, 3:] = lines.T
    belts = [margin * 2.0 * float(mu * P) for mu, P in ((p.mu_1s_b, p.P1), (p.mu_2s_b, p.P2))]
    kinetic = [(float(p.mu_k) * n * np.sign(s),) * 2 for n, s in zip(loads, turns, strict=True)]
    static = [(-margin * float(p.mu_s) * n, margin * float(p.mu_s) * n) for n in loads]
    friction = [k if s else r for k, r, s in zip(kinetic, static, turns, strict=True)]
    bounds = [(None, None), *((-b, b) for b in belts), *friction]
    cost = np.eye(7)[0] * -sign
    found = scipy.optimize.linprog(cost, A_eq=balance, b_eq=np.zeros(2), bounds=bounds)
    assert found.success
    return float(found.x[0])


def test_it_is_the_shortest_time():
    """Along every leg the times are those of the greatest acceleration and braking, but for the first
    piece, in which friction at rest must break."""
    made = plan()
    starts = np.diff(np.asarray(made.leg_times))
    for leg, (a, b) in enumerate(itertools.pairwise(CORNER)):
        way = np.subtract(b, a)
        length = float(np.hypot(*way))
        up, down = (fastest(MACHINE, way / length, sign, 0.9) for sign in (1.0, -1.0))
        assert up > 0.0 > down
        best = np.sqrt(2.0 * length * (1.0 / up - 1.0 / down))
        assert best * (1.0 - 1e-9) < starts[leg] < best * 1.004, leg


@pytest.mark.more
def test_just_weaker_belts_slip():
    made = plan(margin=0.999)
    held = cx.check_rolling(made, cx.with_values(MACHINE, {"mu_1s_b": 2.998, "mu_2s_b": 2.998}))
    assert np.all(held.rolls)
    slipped = cx.check_rolling(made, cx.with_values(MACHINE, {"mu_1s_b": 2.99, "mu_2s_b": 2.99}))
    assert not slipped.rolls[0]
    assert slipped.slip[0] > 1e-4
    assert 0.0 < slipped.first_slip[0] < made.leg_times[1]


@pytest.mark.more
def test_wrong_tensions_slip_unless_the_plan_knows_of_them():
    loose = cx.with_values(MACHINE, {"P1": 14.0, "P2": 21.0})
    found = cx.check_rolling(plan(), loose)
    assert not np.any(found.rolls)
    assert "belt 1 slips from" in str(found)
    assert "belt 2 slips from" in str(found)
    assert found.end_error > 0.01
    careful = plan(tension_error=0.3)
    assert float(careful.end) < 1.6 * float(plan().end)
    for one in (0.7, 1.3):
        for two in (0.7, 1.3):
            wrong = cx.with_values(MACHINE, {"P1": 20.0 * one, "P2": 30.0 * two})
            assert np.all(cx.check_rolling(careful, wrong).rolls), (one, two)


@pytest.mark.slow
def test_the_voltage_limit_is_kept_and_the_time_tends_to_the_shortest():
    """Along y with equal tensions both motors do the same: one equation, solved in closed form."""
    p = cx.CoreXYParameters(mu_1s_b=10.0, mu_2s_b=10.0)
    volts, length = 2.5, 0.3
    m = float(p.M + p.m + 4.0 * p.J_passive / p.r**2 + 2.0 * p.J / p.r**2)
    push = float(2.0 * p.K_t / p.R / p.r)
    drag = push * float(p.K_e / p.r)
    dry = 0.1 * float((p.M + p.m) * p.g + (2.0 * 2.0**0.5 + 2.0) * (p.P1 + p.P2))
    rate = drag / m

    def motion(t, v, force):  # m v' = force - drag v
        last = (force - dry) / drag
        return last + (v - last) * np.exp(-rate * t), last * t + (v - last) / rate * (
            1.0 - np.exp(-rate * t)
        )

    def left(turn):
        v, way = motion(turn, 0.0, push * volts)
        rest = -(push * volts + dry) / drag
        stop = np.log((v - rest) / -rest) / rate
        return way + motion(stop, v, -push * volts)[1] - length, turn + stop

    turn = scipy.optimize.brentq(lambda t: left(t)[0], 1e-3, 1.0)
    best = left(turn)[1]
    late = []
    for steps in (10, 40, 160):
        made = cx.feedforward(p, [[0.0, 0.0], [0.0, length]], volts=volts, steps=steps)
        late.append(float(made.leg_times[-1]) / best - 1.0)
        ends = np.linspace(0.0, float(made.end), 5001)
        both = np.array(jax.vmap(made.voltage)(jnp.asarray(ends)))
        assert np.max(np.abs(both)) <= volts * (1.0 + 1e-9)
    assert late[0] > late[1] > late[2] > 0.0
    assert late[2] < 3e-3
    assert abs(4.0 * late[2] - late[1]) < 5e-4  # of first order in the length of the pieces


@pytest.mark.slow
def test_derivatives_of_the_end_exist_through_all_events():
    """Where the collar ends when both motors get a little more voltage: forward, and differences."""
    made = plan()
    system_of = lambda gain: cx.CoreXY(  # noqa: E731
        MACHINE,
        cx.Ramps(made.voltage.times, gain * made.voltage.v1, gain * made.voltage.v2,
                 gain * made.voltage.slope_1, gain * made.voltage.slope_2),
    )  # fmt: skip

    @jax.jit
    def end(gain):
        system = system_of(gain)
        run = ss.simulate(
            system, 0.0, 1.25 * made.end, system.state(), saveat=ss.SaveAt(max_events=None)
        )
        return jnp.stack([run.y1.x, run.y1.y]), run.flags

    value, slope = jax.jvp(lambda g: end(g)[0], (1.001,), (1.0,))
    high, low = (end(1.001 + h)[0] for h in (1e-6, -1e-6))
    assert np.linalg.norm(slope) > 0.1
    np.testing.assert_allclose(slope, (high - low) / 2e-6, rtol=1e-5)
    assert np.linalg.norm(value - np.array(CORNER[-1])) > 1e-5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mu_1s_b": 0.2, "mu_2s_b": 0.2}, "belts and voltage are too weak against the friction"),
        ({"mu_1s_b": 1.6, "mu_2s_b": 1.6}, "these contacts do not start as they must:"),
    ],
)
def test_what_cannot_be_reached_is_refused(change, words):
    with pytest.raises(ValueError, match=rf"points\[1\] = \[0.3, 0.0\], {words}"):
        cx.feedforward(cx.with_values(MACHINE, change), CORNER[:2], volts=24.0)
    with pytest.raises(ValueError, match=r"points\[2\] = \[0.3, 0.0\]: it must be another place"):
        cx.feedforward(MACHINE, [*CORNER[:2], CORNER[1]], volts=24.0)
