"""Parameters, inputs, kinematics, motors, contacts and modes, each against its formula."""

import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
from corexy_jax._contact_motion import contact_motion
from corexy_jax._contacts import (
    CONTACT_NAMES,
    NORMALS,
    Line,
    contact_loads,
    line_force,
    line_masses,
    sliding_speeds,
    static_limits,
)
from corexy_jax._modes import MODE_DMN, NUM_MODES, SIGNS, mode_number, mode_signs
from tests.corexy_jax._random import frictions, machine


def refused(error, text):
    return pytest.raises(error, match=re.escape(text))


def test_tables_of_the_paper():
    p = cx.CoreXYParameters()
    table = dict(m=0.5, M=1.0, J=1e-3, J_passive=5e-4, r=0.05, R=0.9, K_t=2.0, K_e=0.03, mu_s=0.4)
    table |= dict(mu_k=0.1, mu_1k_b=0.2, mu_2k_b=0.2, r_f=0.05)
    assert {name: float(getattr(p, name)) for name in table} == table
    rows = {1: (20, 20, 10, 5, 10, 0.1), 2: (30, 30, 20, 10, 1e-3, 1e-3), 3: (20, 30, 20, 10, 10, 10)}
    for number, row in rows.items():
        p, v = cx.scenario(number)
        assert (float(p.P1), float(p.P2), float(v.v01), float(v.v02)) == row[:4]
        assert (float(p.mu_1s_b), float(p.mu_2s_b)) == row[4:]
        assert float(v.frequency) == 0.5


@pytest.mark.parametrize("name", ["m", "M", "J", "J_passive", "r", "R", "K_t", "P1", "P2", "g"])
def test_positive_parameters(name):
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=rf"^{name} = .*positive"):
            cx.CoreXYParameters(**{name: bad})


def test_bad_input_is_named():
    with refused(ValueError, "mu_2s_b = -0.1"):
        cx.CoreXYParameters(mu_2s_b=-0.1)
    with refused(TypeError, "tension = 3.0: it must be left out"):
        cx.CoreXYParameters(tension=3.0)
    with refused(TypeError, "m = 'heavy'"):
        cx.CoreXYParameters(m="heavy")
    with refused(ValueError, "number = 4"):
        cx.scenario(4)
    with refused(ValueError, "frequency = 0"):
        cx.Harmonic(1.0, 1.0, 0.0)
    with refused(ValueError, "v2 = [1.0], of shape (1,)"):
        cx.PiecewiseStep([0.0, 1.0], [1.0, 2.0], [1.0])
    with refused(ValueError, "times[1] = 0.0: it must be above"):
        cx.Sampled([0.0, 0.0], [1.0, 2.0], [1.0, 2.0])
    with refused(ValueError, "one row"):
        cx.PiecewiseStep([0.0], [1.0], [1.0])
    with refused(TypeError, "function"):
        cx.UserVoltage(3.0)
    with refused(TypeError, "a pair of numbers [V]"):
        cx.UserVoltage(lambda t, args: t)
    with refused(TypeError, "a pair of numbers [V]"):
        cx.UserVoltage(lambda t, args: (t, "2"))
    with refused(TypeError, "such as ConstantVoltage(v1, v2)"):
        cx.CoreXY(cx.CoreXYParameters(), 5.0)
    p, v = cx.scenario(1)
    with refused(ValueError, "method = 'exact'"):
        cx.simulate(p, v, method="exact")
    with refused(ValueError, "rows = 1"):
        cx.simulate(p, v, rows=1)
    with refused(ValueError, "t1 = 0.0"):
        cx.simulate(p, v, 0.0)
    with refused(ValueError, "t1 = 1.0: it must be a multiple"):
        cx.simulate(p, v, 1.0, method="as_printed", dt=0.3, rows=2)
    with refused(TypeError, "A2 = 'yes'"):
        cx.Errata(A2="yes")


def test_harmonic_and_square_wave():
    t = np.linspace(0.0, 6.0, 1201)[1:-1] + 1e-4
    for shape, wave in ((cx.Harmonic, lambda a: a), (cx.SquareWave, np.sign)):
        v1, v2 = jax.vmap(shape(10.0, 5.0, 0.7))(jnp.asarray(t))
        angle = 2 * np.pi * 0.7 * t
        np.testing.assert_allclose(v1, 10.0 * wave(np.sin(angle)), atol=1e-12)
        np.testing.assert_allclose(v2, 5.0 * wave(np.cos(angle)), atol=1e-12)
    wave = cx.SquareWave(1.0, 1.0, 0.7)
    piece = jnp.arange(9.0)
    ends = jax.vmap(wave.piece_end)(piece)
    np.testing.assert_allclose(ends, (np.arange(9) + 1) / 2.8)
    np.testing.assert_array_equal(jax.vmap(wave.piece_of)(ends + 1e-9), piece + 1)


@pytest.mark.more
def test_a_constant_voltage_is_a_table_of_it():
    """The run is that under the same voltages held from row to row."""
    p = cx.CoreXYParameters()
    ends = [
        cx.simulate(p, voltage, 0.2, rows=3).y
        for voltage in (
            cx.ConstantVoltage(6.0, 2.0), cx.PiecewiseStep([0.0, 9.0], [6.0, 0.0], [2.0, 0.0])
        )
    ]  # fmt: skip
    assert float(ends[0].x[-1]) > 1e-3
    for one, other in zip(*ends, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-12)


def test_tables_of_voltages():
    times, v1, v2 = [0.0, 1.0, 1.5, 4.0], [1.0, -2.0, 3.0, 0.5], [0.0, 4.0, 4.0, -1.0]
    t = np.linspace(0.0, 5.0, 401) + 1e-5
    held = jax.vmap(cx.PiecewiseStep(times, v1, v2))(jnp.asarray(t))
    row = np.searchsorted(times, t, side="right") - 1
    np.testing.assert_array_equal(held[0], np.array(v1)[row])
    np.testing.assert_array_equal(held[1], np.array(v2)[row])
    linear = jax.vmap(cx.Sampled(times, v1, v2))(jnp.asarray(t))
    np.testing.assert_allclose(linear[0], np.interp(t, times, v1), atol=1e-14)
    np.testing.assert_allclose(linear[1], np.interp(t, times, v2), atol=1e-14)
    voltage = cx.Sampled(times, v1, v2)
    ends = [float(voltage.piece_end(jnp.asarray(float(k)))) for k in range(5)]
    assert ends[:3] == times[1:]
    assert min(ends[3:]) > 1e100
    user = cx.UserVoltage(lambda t, a: (a * t, 2.0), 3.0)
    assert [float(v) for v in user(0.5)] == [1.5, 2.0]


def test_voltages_have_derivatives():
    def at(amplitude):
        return (
            cx.Harmonic(amplitude, 1.0)(0.3)[0]
            + cx.Sampled([0.0, 1.0], [amplitude, 0.0], [0.0, 1.0])(0.3)[0]
        )

    expected = np.sin(2 * np.pi * 0.5 * 0.3) + 0.7
    np.testing.assert_allclose(jax.grad(at)(2.0), expected, rtol=1e-14)


def test_pulleys_and_motors():
    pulleys = cx.passive_pulleys(0.3, -0.2, 0.05)
    expected = np.array([-6.0, 2.0, 2.0, 6.0, -6.0, 10.0, 10.0, 6.0])
    np.testing.assert_allclose(pulleys, expected, rtol=1e-14)
    np.testing.assert_allclose(cx.virtual_pulleys(0.3, -0.2, 0.05), [2.0, 10.0], rtol=1e-14)
    p = cx.CoreXYParameters()
    np.testing.assert_allclose(cx.motor_torque(p, 10.0, 50.0), 2 * (10 - 0.03 * 50) / 0.9)
    np.testing.assert_allclose(cx.voltage_for_torque(p, cx.motor_torque(p, 7.0, 3.0), 3.0), 7.0)


def test_contacts_are_the_parts_taken_together():
    """Loads and masses of the eight contacts against the sum over all pulleys and rails."""
    for seed in range(5):
        p = machine(seed)
        q = np.random.default_rng(seed).normal(size=4)
        speeds = NORMALS @ q
        np.testing.assert_allclose(sliding_speeds(Line(*q)), speeds, rtol=1e-14)
        passive = np.array(cx.passive_pulleys(q[0], q[1], p.r))
        tension = np.repeat([p.P1, p.P2], 4)
        lost = np.sum(np.sqrt(2) * tension * p.r_f * np.abs(passive))
        lost += p.m * p.g * abs(q[0]) + (p.M + p.m) * p.g * abs(q[1])
        lost += np.sum(2 * np.array([p.P1, p.P2]) * (p.r_f / p.r) * np.abs(q[2:]))
        lost += np.sum(2 * np.array([p.P1, p.P2]) * np.abs(speeds[6:]))
        np.testing.assert_allclose(np.array(contact_loads(p)) @ np.abs(speeds), lost, rtol=1e-12)
        energy = p.m * (q[0] ** 2 + q[1] ** 2) + p.M * q[1] ** 2
        energy += p.J_passive * np.sum(passive**2) + p.J * np.sum((q[2:] / p.r) ** 2)
        np.testing.assert_allclose(np.array(line_masses(p)) @ q**2, energy, rtol=1e-12)
        forces = np.random.default_rng(seed + 9).normal(size=8)
        np.testing.assert_allclose(line_force(tuple(forces)), forces @ NORMALS, rtol=1e-13)


def test_friction_of_the_parts_is_that_of_the_contacts():
    """Kinetic friction through DMN4 of the paper and through the contact normals, corrected."""
    for seed in range(3):
        p = machine(seed)
        q = np.random.default_rng(seed).normal(size=4)
        senses = np.sign(NORMALS @ q)
        ground = cx.ground_friction(p, p.mu_k, cx.SlipDirections(*map(jnp.asarray, senses[:6])))
        belts = cx.belt_friction(p, senses[6], senses[7])
        f = ground._replace(f_1_b=belts[0], f_2_b=belts[1])
        model = cx.dynamic_model(4, p, f, (0.0, 0.0), cx.Errata.corrected())
        mu = np.array([float(p.mu_k)] * 6 + [float(p.mu_1k_b), float(p.mu_2k_b)])
        expected = (-senses * mu * np.array(contact_loads(p))) @ NORMALS
        np.testing.assert_allclose((model.b + model.tau) / p.r, expected[:2], rtol=1e-12)
        motors = [
            cx.slipping_motor(p, 0.0, f.tau_1_0, belts[0]),
            cx.slipping_motor(p, 0.0, f.tau_2_0, belts[1]),
        ]
        np.testing.assert_allclose(np.array(motors) * p.J / p.r, expected[2:], rtol=1e-12)


def test_dead_zones_of_scenario_2():
    """6.89 N m along x and 3.69 N m along y against 1.2 N m that the belts can give."""
    p, _ = cx.scenario(2)
    limits = np.array([float(n) for n in static_limits(p)]) * float(p.r)
    x, y, u, w, *_, belt_1, belt_2 = limits
    np.testing.assert_allclose([x + u + w, y + u + w, belt_1 + belt_2], [6.886, 3.688, 1.2], atol=1e-3)


def test_modes_are_the_faces_of_the_arrangement():
    """Every sign vector that random and degenerate velocities have, and no other."""
    assert NUM_MODES == 369
    rng = np.random.default_rng(0)
    found = set()
    for _ in range(300):
        for rest in itertools.product((0, 1), repeat=4):
            held = rng.permutation(8)[: sum(rest)]
            _, size, basis = np.linalg.svd(np.vstack([NORMALS[held], np.zeros((1, 4))]))
            null = basis[np.sum(size > 1e-9) :]
            v = rng.normal(size=len(null)) @ null if len(null) else np.zeros(4)
            speeds = NORMALS @ v
            found.add(tuple(np.where(np.abs(speeds) < 1e-9, 0, np.sign(speeds)).astype(int)))
    assert found <= {tuple(s) for s in SIGNS}
    assert len(found) > 330
    numbers = jnp.arange(NUM_MODES, dtype=jnp.int32)
    signs = jax.vmap(mode_signs)(numbers)
    np.testing.assert_array_equal(signs, SIGNS)
    np.testing.assert_array_equal(jax.vmap(mode_number)(signs), numbers)
    assert int(mode_number(tuple(jnp.asarray(s) for s in (1.0, 0, 0, 0, 0, 0, 0, 0)))) == -1
    expected = 1 + (SIGNS[:, 6] != 0) + 2 * (SIGNS[:, 7] != 0)
    np.testing.assert_array_equal(MODE_DMN, expected)


def test_closure_and_projection():
    """What cannot slide while given contacts rest, by the rank of their normals; the nearest speeds."""
    p, voltage = cx.scenario(1)
    (group,) = cx.CoreXY(p, voltage).structure.groups
    mass = Line(*map(float, line_masses(p)))
    weight = np.sqrt(np.array(mass))
    cases = []
    for rest in itertools.product((False, True), repeat=8):
        held = np.array(rest)
        closed = (group.tables.closure[held @ 2 ** np.arange(8)] >> np.arange(8)) % 2 == 1
        rank = np.linalg.matrix_rank(NORMALS[held]) if held.any() else 0
        spanned = [
            np.linalg.matrix_rank(np.vstack([NORMALS[held], NORMALS[c : c + 1]])) == rank
            for c in range(8)
        ]
        np.testing.assert_array_equal(closed, spanned)
        v = np.random.default_rng(1).normal(size=4)
        _, size, basis = np.linalg.svd(np.vstack([NORMALS[held] / weight, np.zeros((1, 4))]))
        null = basis[np.sum(size > 1e-9) :]
        nearest = null.T @ (null @ (weight * v)) / weight
        cases.append((closed, nearest, v))
    closed, nearest, v = (jnp.asarray(np.array(column)) for column in zip(*cases, strict=True))

    @jax.jit
    @jax.vmap
    def projected(q, held):
        momenta = tuple(m * x for m, x in zip(mass, q, strict=True))
        return jnp.stack(contact_motion(mass, momenta, tuple(held))[0])

    np.testing.assert_allclose(projected(v, closed), nearest, atol=1e-14)
    speeds = np.array(projected(v, closed)) @ NORMALS.T
    assert np.all(speeds[np.asarray(closed)] == 0)


def test_lines_on_which_the_machine_gives_way():
    """Exactly the one-dimensional intersections of the eight planes."""
    found = set()
    for held in itertools.combinations(range(8), 3):
        _, size, basis = np.linalg.svd(NORMALS[list(held)])
        if np.sum(size > 1e-9) == 3:
            line = basis[3] / np.max(np.abs(basis[3]))
            line = line * np.sign(line[np.argmax(np.abs(line) > 1e-9)])
            found.add(tuple(np.round(line, 9) + 0.0))
    given = set()
    for line in cx.CoreXY(*cx.scenario(1)).structure.groups[0].tables.lines:
        line = line / np.max(np.abs(line))
        line = line * np.sign(line[np.argmax(np.abs(line) > 1e-9)])
        given.add(tuple(np.round(line, 9) + 0.0))
    assert given == found
    assert len(CONTACT_NAMES) == 8


def test_needed_friction_and_next_model():
    p, f = machine(2), frictions(2)
    alphas, torques = (3.0, -40.0), (1.5, 0.7)
    ground = (f.tau_1_0, f.tau_2_0)
    J, r = float(p.J), float(p.r)
    printed = cx.needed_friction(p, alphas, torques, ground)
    right = cx.needed_friction(p, alphas, torques, ground, cx.Errata.corrected())
    for i, (P, mu_printed, mu, f_s) in enumerate(
        ((p.P1, printed.mu_1s, right.mu_1s, right.f_1s), (p.P2, printed.mu_2s, right.mu_2s, right.f_2s))
    ):
        load = (float(ground[i]) + torques[i]) / r
        # With alpha = (ax +- ay)/r, (81) reads J/(2P) |alpha/r - load|.
        expected = J / (2 * P) * abs(alphas[i] / r - load)
        np.testing.assert_allclose(mu_printed, expected, rtol=1e-12)
        np.testing.assert_allclose(f_s, J * alphas[i] / r - load, rtol=1e-12)
        np.testing.assert_allclose(mu, abs(J * alphas[i] / r - load) / (2 * P), rtol=1e-12)
        np.testing.assert_allclose(J * alphas[i], float(ground[i]) + torques[i] + f_s * r, rtol=1e-12)
    low, high = (jnp.asarray(0.1), jnp.asarray(0.9))
    for number, first, second in itertools.product((1, 2, 3, 4), (False, True), (False, True)):
        needed = cx.RollingRequirement(low, low, high if first else low, high if second else low)
        after = int(cx.next_dmn(number, needed, (jnp.asarray(0.5), jnp.asarray(0.5))))
        slips_1, slips_2 = number in (2, 4) or first, number in (3, 4) or second
        assert after == 1 + slips_1 + 2 * slips_2
    equal = cx.RollingRequirement(low, low, jnp.asarray(0.5), jnp.asarray(0.5))
    assert int(cx.next_dmn(1, equal, (jnp.asarray(0.5), jnp.asarray(0.5)))) == 1


def test_available_coefficients():
    p, _ = cx.scenario(2)
    assert [float(a) for a in cx.available_coefficients(p, cx.Errata())] == [0.001, 0.001]
    assert [float(a) for a in cx.available_coefficients(p)] == [0.2, 0.2]
    assert float(static_limits(p)[6]) == 0.2 * 60.0
