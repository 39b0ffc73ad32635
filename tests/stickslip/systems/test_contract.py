"""What holds for every reference system: the contract of a system, and its energy account."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.derived import WithIntegrals
from tests.stickslip.systems._systems import CASES

every_case = pytest.mark.parametrize("name", CASES)
PRECISE = ss.Integrator(step=ss.AdaptiveStep(1e-12, 1e-12))


def powers(system, t, y, mode, args):
    return system.powers(t, y, mode, args)


def ledger(system):
    return WithIntegrals(system, powers)


@functools.cache
def history(name):
    """The run of a case with all powers integrated, every step kept."""
    case = CASES[name]
    system = ledger(case.system)
    saveat = ss.SaveAt(steps=True, max_rows=512, max_events=64)
    y0 = system.start(case.start)
    return ss.simulate(system, 0.0, case.t1, y0, integrator=PRECISE, saveat=saveat)


def rows(count, tree):
    return jax.tree.map(lambda a: np.asarray(a)[: int(count)], tree)


@functools.cache
def seen(name):
    """Guards and powers at all steps of the run, and energies beside its events: one program a case."""
    system, solution = CASES[name].system, history(name)

    @jax.jit
    def ask(steps, events, y1):
        inside = (steps.t, steps.y.y, steps.mode)
        return (
            jax.vmap(lambda t, y, mode: (system.guards(t, y, mode, None),
                                         system.powers(t, y, mode, None)))(*inside),
            (system.energy(events.y_before.y), system.energy(events.y_after.y)),
            system.energy(y1.y),
        )  # fmt: skip

    assert int(solution.steps.count) < 512
    inside, beside, end = ask(solution.steps, solution.events, solution.y1)
    guards, powers = rows(solution.steps.count, inside)
    return guards, powers, rows(solution.num_events, beside), float(end)


@every_case
def test_names_and_units(name):
    case = CASES[name]
    for system, components in ((case.system, case.start._fields), (ledger(case.system), None)):
        assert len(set(system.mode_names)) == len(system.mode_names)
        assert len(set(system.guard_names)) == len(system.guard_names)
        assert set(components or system.units) == set(system.units)
        assert all(system.units.values())


@every_case
def test_initial_mode_is_admissible(name):
    case = CASES[name]
    y0 = jax.tree.map(jnp.asarray, case.start)
    mode = int(case.system.initial_mode(0.0, y0, None))
    assert 0 <= mode < len(case.system.mode_names)
    guards = case.system.guards(0.0, y0, mode, None)
    assert len(guards) == len(case.system.guard_names)
    assert all(np.shape(g) == () and g >= 0 for g in guards)


@pytest.mark.more
@every_case
def test_transitions_keep_the_structure_and_lead_to_modes(name):
    case = CASES[name]
    y0 = jax.tree.map(jnp.asarray, case.start)
    shapes = jax.tree.map(lambda a: (a.shape, a.dtype), y0)
    count = len(case.system.mode_names)

    def ask(mode, guard):
        y, after = case.system.transition(jnp.asarray(0.0), y0, mode, guard, None)
        slope = case.system.vector_field(jnp.asarray(0.0), y0, mode, None)
        for tree in (y, slope):
            assert jax.tree.map(lambda a: (jnp.shape(a), a.dtype), tree) == shapes
        return after

    pairs = np.indices((count, len(case.system.guard_names)), np.int32).reshape(2, -1)
    after = np.asarray(jax.jit(jax.vmap(ask))(*pairs))
    assert np.all((after >= 0) & (after < count))


@pytest.mark.more
@every_case
def test_run_is_a_success_with_events(name):
    solution = history(name)
    assert bool(solution.successful)
    assert int(solution.num_events) >= 1
    assert bool(solution.differentiable)


@pytest.mark.more
@every_case
def test_guards_hold_inside_their_modes(name):
    guards, *_ = seen(name)
    assert min(v.min() for v in guards) >= -1e-11


@pytest.mark.more
@every_case
def test_no_contact_moves_against_its_friction(name):
    case, (_, values, *_) = CASES[name], seen(name)
    assert set(case.losses) <= set(values)
    for loss in case.losses:
        # In slip the speed at an event is zero to rounding, of either sign.
        assert values[loss].max() <= 1e-13


@pytest.mark.parametrize("name", [name for name in CASES if hasattr(CASES[name].system, "belt_speed")])
def test_stick_has_exactly_the_speed_of_the_belt(name):
    case = CASES[name]
    steps = history(name).steps
    y, mode = rows(steps.count, (steps.y.y, steps.mode))
    words = case.system.contact_states(mode).values()
    for v, word in zip((y.v_1, y.v_2) if "two" in name else (y.v,), words, strict=True):
        # The row of the event that ends a slip still has the mode of the slip.
        assert np.any(word == "stick")
        assert np.all(np.asarray(v)[word == "stick"] == float(case.system.belt_speed))


@every_case
def test_energy_is_accounted_for(name):
    """Work in = change of mechanical energy + loss by friction + loss at impacts, to 1e-9."""
    case, solution = CASES[name], history(name)
    start = float(case.system.energy(jax.tree.map(jnp.asarray, case.start)))
    *_, (before, after), end = seen(name)
    impacts = after - before
    assert impacts.max() <= 1e-12
    works = {k: float(w) for k, w in solution.y1.integrals.items()}
    change = end - start
    turnover = max([abs(change), start, *map(abs, works.values())])
    assert abs(sum(works.values()) + impacts.sum() - change) <= 1e-9 * turnover
    assert all(works[loss] <= 0.0 for loss in case.losses)


@pytest.mark.more
@pytest.mark.parametrize("name", list(CASES)[::2])
def test_batched_equals_a_loop_and_slopes_are_finite(name):
    case = CASES[name]
    # A method of few stages: what is compared is the system, twice.
    integrator = ss.Integrator("rk4", ss.FixedStep(0.05))

    def end(factor):
        # The first parameter is a mass in all of them, the second a force, stiffness or gravity.
        system = eqx.tree_at(
            lambda s: jax.tree.leaves(s)[:2],
            case.system,
            [leaf * factor for leaf in jax.tree.leaves(case.system)[:2]],
        )
        solution = ss.simulate(
            system,
            0.0,
            case.t1,
            case.start,
            integrator=integrator,
            saveat=ss.SaveAt(max_events=None),
            throw=False,
        )
        return jnp.stack(jax.tree.leaves(solution.y1)), (solution.mode1, solution.num_events)

    factors = jnp.array([0.98, 1.0, 1.03])
    one = jnp.ones_like(factors)
    batch = jax.jit(lambda f: jax.jvp(jax.vmap(end), (f,), (one,), has_aux=True))
    batched, slopes, counts = batch(factors)
    assert np.all(np.isfinite(slopes))
    single = jax.jit(end)
    for i, factor in enumerate(factors):
        y, count = single(factor)
        np.testing.assert_allclose(batched[i], y, rtol=1e-12, atol=1e-12)
        assert [int(c[i]) for c in counts] == [int(c) for c in count]


@pytest.mark.more
@every_case
def test_a_run_that_goes_on_without_its_mode_finds_it(name):
    """At every step but those at events, where a contact is on the border of two modes."""
    system, found = ledger(CASES[name].system), history(name)
    t, y, mode = rows(found.steps.count, (found.steps.t, found.steps.y, found.steps.mode))
    events = rows(found.num_events, found.events.t)
    apart = np.min(np.abs(t[:, None] - events[None]), axis=1) > 1e-9 * t[-1]
    again = jax.jit(jax.vmap(lambda t, y: system.initial_mode(t, y, None)))(t, y)
    assert np.sum(apart) > 5
    np.testing.assert_array_equal(np.asarray(again)[apart], mode[apart])
