"""The event-driven motion against time stepping, energy, the printed models and itself."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
from corexy_jax._contact_motion import contact_motion
from corexy_jax._contacts import CONTACT_NAMES, NORMALS, kinetic_limits, line_masses
from corexy_jax._modes import SIGNS
from tests.corexy_jax._moreau import SCENARIOS, Reference
from tests.corexy_jax._random import machine
from tests.corexy_jax._runs import columns, run, shared, solution

ROW = 0.01  # distance of the output times [s]


def reference(number, h):
    return Reference(SCENARIOS[number], h).run(6.0, round(ROW / h))


def wrong_senses(number, h, t, sense):
    """Rows whose contacts differ though no event is near."""
    found = solution(number)
    log = found.events
    assert log is not None
    events = np.asarray(log.t)[: int(log.count)]
    near = np.min(np.abs(t[:, None] - events[None]), axis=1) <= 20 * h
    # At t = 0 the reference has not asked its law yet.
    return np.sum((np.any(sense != np.asarray(found.senses), axis=1) & ~near)[1:])


@pytest.mark.more
@pytest.mark.parametrize("number", [1, 2, 3])
def test_time_stepping_agrees_within_its_own_error(number):
    """Positions to the reference's error, which is what a halved step changes in it, and the modes."""
    exact, _ = columns(solution(number))
    (t, coarse, _, senses), (_, fine, _, finer) = (reference(number, h) for h in (1e-3, 5e-4))
    np.testing.assert_allclose(t, solution(number).t, atol=1e-9)
    own = 2 * np.max(np.abs(coarse - fine), axis=0)
    error = [np.max(np.abs(p - exact), axis=0) for p in (coarse, fine)]
    assert np.all(error[0] <= 1.5 * own + 1e-12)
    assert np.all(error[1] <= 0.7 * error[0] + 1e-12)
    wrong = [wrong_senses(number, h, t, s) for h, s in ((1e-3, senses), (5e-4, finer))]
    assert wrong[0] <= 30
    assert wrong[1] <= 0.7 * wrong[0]
    if number == 2:
        assert np.max(np.abs(coarse[:, :2])) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 3])
def test_time_stepping_converges_at_first_order(number):
    exact, _ = columns(solution(number))
    sizes = (1e-3, 2.5e-4, 6.25e-5)
    runs = [reference(number, h) for h in sizes]
    errors = np.array([np.max(np.abs(p - exact), axis=0) for _, p, _, _ in runs])
    moving = errors[0] > 1e-9
    order = np.log(errors[0] / errors[2])[moving] / np.log(sizes[0] / sizes[2])
    assert np.all(order > 0.85)
    t, *_, senses = runs[2]
    assert wrong_senses(number, sizes[2], t, senses) <= 1


@pytest.mark.more
def test_orientation_numbers():
    one, two, three = (columns(solution(n))[0] for n in (1, 2, 3))
    assert one[:, 0].max() == pytest.approx(4.947, abs=1e-3)
    assert np.all(two[:, :2] == 0)
    assert np.abs(three[:, 0]).max() == pytest.approx(28.9, abs=0.05)
    assert np.abs(three[:, 1]).max() == pytest.approx(29.0, abs=0.05)


@pytest.mark.more
@pytest.mark.parametrize("number", [1, 2, 3])
def test_energy_is_accounted_for(number):
    found = solution(number)
    turned_over = float(found.ledger.motor_1[-1] + found.ledger.motor_2[-1])
    assert turned_over > 100
    assert float(jnp.max(jnp.abs(found.energy_error()))) < 1e-8 * turned_over
    steps = jnp.diff(found.ledger.friction, axis=0)
    assert float(jnp.max(steps)) < 1e-12
    assert float(jnp.min(jnp.diff(found.ledger.slip, axis=0))) > -1e-12
    assert int(found.flags) == 0


@pytest.mark.more
def test_converges_with_the_tolerance():
    ends = [columns(solution(1, tolerance))[0] for tolerance in (1e-12, 1e-6, 1e-8, 1e-10)]
    scale = np.max(np.abs(ends[0]), axis=0)
    error = [np.max(np.abs(e - ends[0]) / scale) for e in ends[1:]]
    assert error[2] < 1e-9
    assert error[1] < 1e-7
    assert error[0] < 1e-5


@pytest.mark.more
@pytest.mark.parametrize("number", [1, 2, 3])
def test_no_contact_moves_against_its_sense(number):
    found = solution(number)
    r = float(found.parameters.r)
    _, velocity = columns(found)
    speeds = (velocity * np.array([1.0, 1.0, r, r])) @ NORMALS.T
    senses = np.asarray(found.senses)
    scale = np.max(np.abs(speeds))
    for c, name in enumerate(CONTACT_NAMES):
        against = senses[:, c] * speeds[:, c] < -1e-13 * scale
        assert not np.any(against), name
        assert np.all(np.abs(speeds[senses[:, c] == 0, c]) < 1e-12 * scale), name


def test_within_a_mode_the_printed_models_hold():
    """Eq. (35) with errata A1, A2 corrected, in every mode in which no part of the carriage rests."""
    p = machine(5)
    torques = (jnp.asarray(1.1), jnp.asarray(-0.4))

    @jax.jit
    def both(sense):
        rolls = sense[6:] == 0
        own = jnp.where(rolls, sense[2:4], sense[4:6])
        ground = cx.ground_friction(p, p.mu_k, cx.SlipDirections(*sense[:4], *own))
        belts = cx.belt_friction(p, sense[6], sense[7])
        f = ground._replace(f_1_b=belts[0], f_2_b=belts[1])
        number = 1 + (~rolls[0]).astype(int) + 2 * (~rolls[1]).astype(int)
        model = cx.dynamic_model(number, p, f, torques, cx.Errata.corrected())
        a = jnp.linalg.solve(model.M, model.b + model.tau)
        free = [
            cx.slipping_motor(p, torques[0], f.tau_1_0, belts[0]),
            cx.slipping_motor(p, torques[1], f.tau_2_0, belts[1]),
        ]
        alphas = jnp.where(rolls, jnp.stack(cx.rolling_motors(*a, p.r)), jnp.stack(free))
        alphas = jnp.where((sense[4:6] == 0) & ~rolls, 0.0, alphas)
        drive = jnp.concatenate([jnp.zeros(2), jnp.stack(torques) / p.r])
        force = drive - (sense * jnp.stack(kinetic_limits(p))) @ jnp.asarray(NORMALS)
        motion, _ = contact_motion(line_masses(p), tuple(force), tuple(sense == 0))
        return jnp.concatenate([a, alphas * p.r]), jnp.stack(motion), number

    sliding = SIGNS[np.all(SIGNS[:, :4] != 0, axis=1)].astype(float)
    printed, ours, number = jax.vmap(both)(jnp.asarray(sliding))
    np.testing.assert_allclose(ours, printed, rtol=1e-11, atol=1e-11)
    assert set(np.asarray(number)) == {1, 2, 3, 4}
    assert len(sliding) == 200


@pytest.mark.more
def test_permuting_the_motors_mirrors_y():
    swapped = cx.CoreXYParameters(P1=30.0, P2=20.0, mu_1s_b=10.0, mu_2s_b=10.0)
    other = run(swapped, shared(3, swap=1.0)[1], jnp.asarray(6.0), jnp.asarray(1e-10))
    position, velocity = columns(solution(3))
    mirrored = np.array([1.0, -1.0, 1.0, 1.0])
    for here, there in zip((position, velocity), columns(other), strict=True):
        there = there[:, [0, 1, 3, 2]] * mirrored
        np.testing.assert_allclose(there, here, rtol=0, atol=1e-8 * np.max(np.abs(here)))
    expected = np.array([1, 3, 2, 4])[np.asarray(solution(3).dmn) - 1]
    np.testing.assert_array_equal(np.asarray(other.dmn), expected)


@pytest.mark.more
def test_scaling_all_forces_and_masses_changes_nothing():
    v = shared(1)[1]
    doubled = cx.CoreXYParameters(
        m=1.0, M=2.0, J=2e-3, J_passive=1e-3, K_t=4.0, P1=40.0, P2=40.0, mu_1s_b=10.0, mu_2s_b=0.1
    )
    other = run(doubled, v, jnp.asarray(6.0), jnp.asarray(1e-10))
    for a, b in zip(columns(other), columns(solution(1)), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-8 * np.max(np.abs(b)))
    np.testing.assert_allclose(other.ledger.friction, 2 * solution(1).ledger.friction, atol=1e-6)


@pytest.mark.more
@pytest.mark.parametrize("seed", range(6))
def test_invariants_of_any_machine(seed):
    """Machines and inputs at random: energy, no contact against its friction, a belt only loses."""
    rng = np.random.default_rng(seed)
    wave = shared(1 if seed % 2 else 3)[1]
    amplitudes = [jnp.asarray(a) for a in rng.uniform(3.0, 25.0, 2)]
    frequency = jnp.asarray(rng.uniform(0.2, 1.5))
    v = eqx.tree_at(
        lambda v: (v.harmonic, v.square),
        wave,
        (cx.Harmonic(*amplitudes, frequency), cx.SquareWave(*amplitudes, frequency)),
    )
    p = machine(seed)
    friction = [jnp.asarray(a) for a in 10 ** rng.uniform(-1.0, 1.0, 2)]
    p = eqx.tree_at(lambda p: (p.mu_1s_b, p.mu_2s_b), p, friction)
    found = run(p, v, jnp.asarray(6.0), jnp.asarray(1e-10))
    assert bool(found.successful)
    work = found.ledger.friction
    turned_over = float(jnp.max(jnp.abs(work[-1]))) + float(jnp.abs(found.ledger.motor_1[-1]))
    assert float(jnp.max(jnp.abs(found.energy_error()))) < 1e-8 * turned_over
    assert float(jnp.max(jnp.diff(work, axis=0))) < 1e-12 * turned_over
    _, velocity = columns(found)
    r = float(p.r)
    speeds = (velocity * np.array([1.0, 1.0, r, r])) @ NORMALS.T
    senses = np.asarray(found.senses)
    scale = np.max(np.abs(speeds)) + 1e-300
    assert np.all(senses * speeds >= -1e-12 * scale)
    assert np.all(np.abs(speeds[senses == 0]) < 1e-11 * scale)
