"""Motion of the block on a belt of constant speed against SciPy, and its derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import SmoothHyperbolicWeakening
from stickslip.systems import (
    BlockOnBelt,
    BlockOnBeltSetValued,
    BlockState,
)

from ._block_reference import Reference, poincare, set_valued

REST = BlockState(x=0.0, vx=0.0, y=0.0, vy=0.0)
K3 = np.array([75.0, 85.0])
T_END = 5.0


def run(model, k3, t_end=T_END, y0=REST, **options):
    system = model.constructed(k3=k3)
    return ss.simulate(
        system,
        0.0,
        t_end,
        y0,
        saveat=ss.SaveAt(sections=system.zero_acceleration_section(), max_crossings=64),
        **options,
    )


@pytest.fixture(scope="module")
def smooth_runs():
    # At 1e-10 a step across the dip of the friction law errs by 2e-7 s now and then.
    tight = ss.Integrator(step=ss.AdaptiveStep(1e-11, 1e-11))
    return jax.vmap(lambda k3: run(BlockOnBelt, k3, integrator=tight))(jnp.asarray(K3))


@pytest.fixture(scope="module")
def dry_runs():
    return jax.vmap(lambda k3: run(BlockOnBeltSetValued, k3))(jnp.asarray(K3))


def lane(tree, i):
    return np.array([leaf[i] for leaf in jax.tree.leaves(tree)])


@pytest.mark.more
def test_smooth_motion_and_poincare_points_are_scipys(smooth_runs):
    (crossings,) = smooth_runs.crossings
    for i, k3 in enumerate(K3):
        model = Reference(float(k3))
        times, states, end = poincare(model, model.simplified, np.zeros(4), T_END)
        count = int(crossings.count[i])
        assert count == len(times)
        np.testing.assert_allclose(crossings.t[i, :count], times, rtol=0, atol=1e-8)
        np.testing.assert_allclose(crossings.y.x[i, :count], states[:, 0], rtol=0, atol=1e-8)
        np.testing.assert_allclose(lane(smooth_runs.y1, i), end, rtol=0, atol=1e-8)


@pytest.mark.more
def test_set_valued_motion_and_poincare_points_are_scipys(dry_runs):
    (crossings,) = dry_runs.crossings
    for i, k3 in enumerate(K3):
        times, points, end = set_valued(Reference(float(k3)), np.zeros(4), T_END)
        count, events = int(crossings.count[i]), int(dry_runs.events.count[i])
        assert count == len(points)
        assert events == len(times)
        np.testing.assert_allclose(dry_runs.events.t[i, :events], times, rtol=0, atol=1e-8)
        np.testing.assert_allclose(crossings.t[i, :count], [t for t, _ in points], rtol=0, atol=1e-8)
        np.testing.assert_allclose(crossings.y.x[i, :count], [x for _, x in points], rtol=0, atol=1e-8)
        np.testing.assert_allclose(lane(dry_runs.y1, i), end, rtol=0, atol=1e-8)


@pytest.mark.more
def test_sticking_block_has_the_belts_speed_to_the_last_bit(dry_runs):
    events = dry_runs.events
    begins = np.asarray(events.mode_after) == 1
    assert begins.sum() > 5
    assert np.all(np.asarray(events.y_after.vx)[begins] == 0.12)
    leaves = np.asarray(events.mode_before) == 1
    assert np.all(np.asarray(events.y_before.vx)[leaves] == 0.12)


@pytest.mark.slow
def test_steeper_laws_tend_to_the_set_valued_one():
    """First order in 1/alpha: the creep of a sticking block is a relative velocity of that order."""
    t_end = 2.0
    dry = ss.simulate(BlockOnBeltSetValued.constructed(k3=85.0), 0.0, t_end, REST).y1

    @jax.vmap
    def end(alpha):
        law = SmoothHyperbolicWeakening(0.26, alpha, 0.9, 1.75)
        system = BlockOnBelt.constructed(k3=85.0, law=law)
        return ss.simulate(system, 0.0, t_end, REST, saveat=ss.SaveAt(max_events=None)).y1.x

    distance = np.abs(end(jnp.array([1e3, 4e3, 16e3])) - dry.x)
    assert distance[0] > 3 * distance[1] > 9 * distance[2]
    assert distance[2] < 1e-4


@pytest.mark.more
def test_energy_is_accounted_for():
    system = BlockOnBeltSetValued.constructed(k3=85.0)
    powers = {"belt": "J", "friction": "J", "dampers": "J"}
    ledger = WithIntegrals(system, BlockOnBeltSetValued.powers, units=powers)
    end = ss.simulate(ledger, 0.0, 10.0, ledger.start(REST)).y1
    work = {name: float(value) for name, value in end.integrals.items()}
    assert work["belt"] > 0 > max(work["friction"], work["dampers"])
    gain = float(system.energy(end.y) - system.energy(BlockState(*map(jnp.asarray, REST))))
    assert abs(sum(work.values()) - gain) < 1e-9 * work["belt"]


@pytest.mark.slow
@pytest.mark.parametrize("model", [BlockOnBelt, BlockOnBeltSetValued])
def test_derivatives_forward_reverse_and_by_differences(model):
    """End state and a Poincare point after stick and slip, by stiffness, belt speed and friction."""
    # A crossing is differentiated as that of the exact motion, which the steps must resolve.
    resolved = ss.Integrator(method="tsit5", step=ss.FixedStep(2.5e-4))

    def result(p):
        k3, V_b, mu_0 = p
        law = SmoothHyperbolicWeakening(mu_0, 190.0, 0.9, 1.75)
        law = law.set_valued_limit() if model.set_valued else law
        system = model.constructed(k3=k3, V_b=V_b, law=law)
        solution = ss.simulate(
            system, 0.0, 1.2, REST,
            saveat=ss.SaveAt(
                sections=system.zero_acceleration_section(), max_events=8, max_crossings=4,
            ),
            integrator=resolved,
        )  # fmt: skip
        return solution.y1.x + solution.crossings[0].y.x[1]

    p = jnp.array([85.0, 0.12, 0.26])
    forward = jax.jit(jax.jacfwd(result))(p)
    np.testing.assert_allclose(forward, jax.jit(jax.grad(result))(p), rtol=1e-8)
    value = jax.jit(result)
    for i, step in enumerate(1e-5 * p):
        move = jnp.zeros(3).at[i].set(step)
        difference = (value(p + move) - value(p - move)) / (2 * step)
        np.testing.assert_allclose(forward[i], difference, rtol=1e-5)


@pytest.mark.slow
def test_poincare_points_of_periodic_lanes_are_scipys():
    """After the transients: periods one, two and three, points to 1e-8 m over several periods."""
    k3 = jnp.array([75.0, 82.0, 89.5])
    # Transients fall by 8 % a period only; they need not be exact.
    steps = ss.Integrator(method="tsit5", step=ss.FixedStep(1e-3), max_steps=10**6)

    def settle(k):
        return ss.simulate(
            BlockOnBelt.constructed(k3=k),
            0.0,
            300.0,
            REST,
            integrator=steps,
            saveat=ss.SaveAt(max_events=None),
        ).y1

    settled = jax.vmap(settle)(k3)
    # Where the acceleration passes zero slowly, 1e-10 in the state is 2e-8 m in the point.
    precise = ss.Integrator(step=ss.AdaptiveStep(1e-12, 1e-12))
    runs = jax.vmap(lambda k, y0: run(BlockOnBelt, k, 8.0, y0, integrator=precise))(k3, settled)
    (crossings,) = runs.crossings
    for i, (k, period) in enumerate(zip(k3, (1, 2, 3), strict=True)):
        model, count = Reference(float(k)), int(crossings.count[i])
        times, states, _ = poincare(model, model.simplified, lane(settled, i), 8.0)
        points = np.asarray(crossings.y.x[i, :count])
        assert count == len(times)
        np.testing.assert_allclose(points, states[:, 0], rtol=0, atol=1e-8)
        np.testing.assert_allclose(crossings.t[i, :count], times, rtol=0, atol=1e-7)
        assert np.abs(points[period:] - points[:-period]).max() < 1e-5
