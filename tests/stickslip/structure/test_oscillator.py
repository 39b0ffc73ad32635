"""One mass with a Jenkins element, against closed forms between events (numbers of another program)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.continuation import OrbitGuess, periodic_orbit
from stickslip.derived import WithIntegrals
from stickslip.structure import HarmonicForce, Jenkins, LinearStructure, StructureState, WithSliders
from tests.stickslip.structure._reference import Reference

STRICT = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12))
# m 1, c 0.04, k 1, k_t 0.5, F 0.1, f_s 0.1: half of the way between the turns
AMPLITUDES = {
    0.8: 0.116198657201,
    1.0: 0.199363055707,
    1.05: 0.399871551729,
    1.08530718: 0.512307322015,
    1.1: 0.504814269795,
    1.25: 0.322681175343,
}


def oscillator(w, f_s=0.1, k_t=0.5, k=1.0, force=0.1):
    force = HarmonicForce(force * jnp.ones(1), w)
    structure = LinearStructure([[1.0]], [[0.04]], k * jnp.ones((1, 1)), force)
    return WithSliders(structure, {"damper": Jenkins([1.0], k_t, f_s)})


def orbit_of(system, w, start=0.0):
    period = 2 * np.pi / w
    begin = system.start(system.system.state([start]))
    run = ss.simulate(system, 0.0, 20 * period, begin, saveat=ss.SaveAt(max_events=None))
    return periodic_orbit(system, OrbitGuess(run.y1, period, t0=0.0), forced=True)


@pytest.mark.more
@pytest.mark.parametrize("w", AMPLITUDES)
def test_the_steady_amplitude_is_that_of_the_closed_form(w):
    orbit = orbit_of(oscillator(w), w)
    assert bool(orbit.successful), str(orbit)
    amplitude = 0.5 * float(orbit.highest.y.q[0] - orbit.lowest.y.q[0])
    assert amplitude == pytest.approx(AMPLITUDES[w], abs=2e-12 if w > 1.0 else 1e-11)
    assert int(orbit.flags) == 0
    assert int(orbit.events.count) == (4 if w > 1.0 else 0)


@pytest.mark.parametrize("f_s", [0.05, pytest.param(0.3, marks=pytest.mark.more)])
def test_other_bounds_agree_with_the_matrix_exponential(f_s):
    w = 1.15
    reference = Reference(np.eye(1), [[0.04]], np.eye(1), [0.1], w, [[1.0]], [0.5], [f_s])
    q, v, z = reference.run([0.7], [0.0], [0.6], 40.0, 0.02)
    system = oscillator(w, f_s)
    run = ss.simulate(
        system, 0.0, 40.0, system.start(system.system.state([0.7]), [0.6]), integrator=STRICT
    )
    assert int(run.num_events) == len(reference.events) > 3
    np.testing.assert_allclose(run.events.t[: len(reference.events)], [e[0] for e in reference.events],
                               atol=1e-10)  # fmt: skip
    for found, right in ((run.y1.y.q, q), (run.y1.y.v, v), (run.y1.z, z)):
        np.testing.assert_allclose(found, right, atol=1e-11)


def test_a_turn_loses_what_the_loop_encloses_and_the_account_closes():
    w, f_s, k_t = 1.1, 0.1, 0.5
    system = oscillator(w, f_s, k_t)
    ledger = WithIntegrals(system, WithSliders.powers)
    turn, start = 2.0 * np.pi / w, system.start(system.system.state())

    # One program for all runs, which begin at a multiple of the turn.
    @jax.jit
    def until(span, start):
        return ss.simulate(
            ledger, 0.0, span, ledger.start(start), integrator=STRICT, saveat=ss.SaveAt(max_events=None)
        )

    steady = until(250 * turn, start).y1.y
    run = until(turn, steady)
    work = run.y1.integrals
    amplitude = AMPLITUDES[w]
    assert float(work["friction of damper"]) == pytest.approx(
        -4 * f_s * (amplitude - f_s / k_t), abs=1e-11
    )
    assert abs(float(sum(work.values()))) < 1e-10  # the state returns, and so does the energy
    moved = system.start(system.system.state([0.5]))
    away = until(7.3, moved)
    gain = system.energy(away.y1.y) - system.energy(moved)
    assert float(sum(away.y1.integrals.values())) == pytest.approx(float(gain), abs=1e-10)


def test_a_turn_is_the_beginning_of_a_stick_and_nothing_else():
    """Rounding leaves a speed there, as if it had not ended: 1,817 attempts, or two events more."""

    @jax.jit
    @jax.vmap
    def run(w):
        system = oscillator(w, 0.03)
        return ss.simulate(
            system, 0.0, 60.0, system.start(system.system.state()), integrator=STRICT, throw=False,
            saveat=ss.SaveAt(max_events=80),
        )  # fmt: skip

    found = run(np.linspace(0.6, 1.6, 64))
    assert np.all(found.num_events >= 24)
    assert np.nanmin(np.diff(np.asarray(found.events.t), axis=1)) > 1e-2
    assert not np.any(found.flags)
    assert np.max(found.stats.num_attempts) < 900


@pytest.mark.parametrize(("f_s", "stiffness"), [(0.0, 1.0), (1e-13, 1.0), (1e3, 1.5)])
def test_without_bound_and_with_a_large_one_it_is_linear(f_s, stiffness):
    def slope(t, y):
        return [y[1], 0.1 * np.cos(1.2 * t) - y[0] - 0.04 * y[1] - (stiffness - 1.0) * y[0]]

    right = solve_ivp(slope, (0, 20), [0.3, 0.0], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    system = oscillator(1.2, f_s)
    begin = system.start(system.system.state([0.3]), [0.0 if f_s > 1 else 0.3])
    run = ss.simulate(system, 0.0, 20.0, begin, integrator=STRICT)
    np.testing.assert_allclose([run.y1.y.q[0], run.y1.y.v[0]], right, atol=3e-11)


def end(p):
    """After 20 s, of bound, spring, stiffness, force and place at the start."""
    system = oscillator(1.2, p[0], p[1], p[2], p[3])
    begin = system.start(StructureState(p[4:], jnp.zeros(1)))
    run = ss.simulate(system, 0.0, 20.0, begin, integrator=STRICT)
    return jnp.concatenate([run.y1.y.q, run.y1.y.v, run.y1.z]), (run.flags, run.num_events)


AT = jnp.array([0.1, 0.5, 1.0, 0.1, 0.3])


@pytest.mark.more
def test_derivatives_through_stick_and_slip_are_those_of_differences():
    step = 2e-5

    def differences(shift):
        shifts = shift * jnp.concatenate([jnp.eye(5), -jnp.eye(5)])
        ends = jax.vmap(lambda s: end(AT + s)[0])(shifts)
        return np.asarray((ends[:5] - ends[5:]) / (2 * shift)).T

    slope, (flags, events) = jax.jacfwd(end, has_aux=True)(AT)
    right = (4 * differences(step) - differences(2 * step)) / 3  # of fourth order
    assert int(flags) == 0
    assert int(events) == 13
    np.testing.assert_allclose(slope, right, atol=3e-7)
    back = jax.grad(lambda p: end(p)[0] @ jnp.array([1.0, -0.5, 2.0]))(AT)
    np.testing.assert_allclose(back, jnp.array([1.0, -0.5, 2.0]) @ slope, rtol=1e-9, atol=1e-11)


@pytest.mark.more
def test_lanes_are_what_each_is_alone():
    bounds = jnp.array([0.0, 0.03, 0.1, 0.4, 9.0])
    rows = jax.vmap(lambda f: AT.at[0].set(f))(bounds)
    together, (_, events) = jax.vmap(end)(rows)
    assert len(set(np.asarray(events).tolist())) > 2
    mapped = ss.map_lanes(end)(rows)
    alone = jnp.stack([end(row)[0] for row in rows])
    np.testing.assert_allclose(together, alone, atol=1e-12)
    np.testing.assert_allclose(mapped[0], alone, atol=1e-12)


@pytest.mark.more
def test_no_turn_is_lost_in_its_rounding():
    def run(f_s):
        system = oscillator(1.2, f_s)
        begin = system.start(StructureState(jnp.array([0.3]), jnp.zeros(1)))
        found = ss.simulate(system, 0.0, 20.0, begin, integrator=STRICT, throw=False)
        return found.successful, found.flags, found.num_events

    bounds = jnp.geomspace(1e-7, 0.1, 60)
    successful, flags, events = jax.vmap(run)(bounds)
    assert bool(jnp.all(successful))
    # One is doubted for nothing: the steps that leave a zero without a slope may become very short.
    assert int(jnp.sum(flags != 0)) <= 1
    assert set(np.asarray(events).tolist()) == {13}


@pytest.mark.more
def test_a_body_that_rests_stays_where_its_springs_hold_it():
    structure = LinearStructure([[1.0]], [[0.5]], [[1.0]])
    system = WithSliders(structure, {"damper": Jenkins([1.0], 0.5, 0.1)})
    # The spring of the slider is at its limit, the other one holds against it.
    begin = system.start(structure.state([0.1]), [0.3])
    run = ss.simulate(system, 0.0, 10.0, begin)
    assert float(run.y1.y.q[0]) == pytest.approx(0.1, abs=1e-12)
    assert float(run.y1.z[0]) == 0.3
    assert int(run.flags) != 0  # derivatives differ on both sides of the limit


@pytest.mark.more
def test_in_free_decay_it_comes_to_rest_within_the_dead_zone():
    system = oscillator(1.0, force=0.0)
    run = ss.simulate(system, 0.0, 400.0, system.start(system.system.state([1.0])))
    x, z = float(run.y1.y.q[0]), float(run.y1.z[0])
    assert abs(x + 0.5 * (x - z)) < 1e-3
    assert abs(0.5 * (x - z)) <= 0.1
    # Each half turn loses 2 f_s times what the slider goes.
    stick = np.array([system.mode_names[int(m)] == "stick" for m in run.events.mode_after])
    turns = np.asarray(run.events.y_after.y.q[:, 0])[stick & (np.asarray(run.events.t) < 1e30)]
    assert np.all(np.abs(np.diff(turns[:4])) < 2.0)
    assert np.all(np.diff(np.abs(turns[np.isfinite(turns)])) < 0.0)
