"""Several masses and Jenkins elements against pieces in closed form, and against themselves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.structure import HarmonicForce, Jenkins, LinearStructure, WithSliders
from tests.stickslip.structure._reference import Reference

STRICT = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12))
NO_LOG = ss.SaveAt(max_events=None)


def numbers(n, seed):
    """Random masses in a row, springs and an element between neighbours, all pushed."""
    rng = np.random.default_rng(seed)
    M, steps = np.diag(rng.uniform(0.5, 2.0, n)), np.eye(n) - np.eye(n, k=-1)
    K = steps.T @ np.diag(rng.uniform(0.5, 2.0, n)) @ steps
    force, w = rng.uniform(-1.0, 1.0, n), rng.uniform(0.4, 1.6)
    return M, 0.05 * K, K, force, w, steps, rng.uniform(0.3, 2.0, n), rng.uniform(0.02, 0.5, n)


def chain(M, C, K, force, w, rows, k_t, f_s):
    elements = {f"joint {j}": Jenkins(rows[j], k_t[j], f_s[j]) for j in range(len(rows))}
    return WithSliders(LinearStructure(M, C, K, HarmonicForce(force, w)), elements)


def end(until, *given):
    system = chain(*given)
    begin = system.start(system.system.state())
    run = ss.simulate(system, 0.0, until, begin, integrator=STRICT, saveat=NO_LOG, throw=False)
    return run.y1.y.q, run.y1.y.v, run.y1.z, run.num_events, run.flags, run.successful


@pytest.mark.more
@pytest.mark.parametrize(("n", "until", "seeds"), [(3, 40.0, range(6)), (10, 40.0, (0,))])
def test_chains_are_their_pieces_in_closed_form(n, until, seeds):
    run, events = jax.jit(lambda *given: end(until, *given)), 0
    for seed in seeds:
        given = numbers(n, seed)
        reference = Reference(*given)
        q, v, z = reference.run(*np.zeros((3, n)), until, 0.02)
        *found, number, flags, successful = run(*given)
        assert bool(successful)
        assert int(flags) == 0
        assert int(number) == len(reference.events)
        events += int(number)
        for one, right in zip(found, (q, v, z), strict=True):
            np.testing.assert_allclose(one, right, atol=2e-10, err_msg=str(seed))
    assert events > 40


@pytest.mark.more
def test_elements_that_turn_together_are_one_element_of_their_sum():
    force = HarmonicForce([0.3], 1.2)
    structure = LinearStructure([[1.0]], [[0.04]], [[1.0]], force)
    begin = structure.state([0.3])
    apart = WithSliders(structure, {f"d{i}": Jenkins([1.0], 0.05, 0.01) for i in range(4)})
    row = WithSliders(structure, {"d": Jenkins([1.0], 0.05 * np.ones(4), 0.01 * np.ones(4))})
    whole = WithSliders(structure, {"d": Jenkins([1.0], 0.2, 0.04)})
    ends = [ss.simulate(s, 0.0, 20.0, s.start(begin), integrator=STRICT) for s in (apart, row, whole)]
    for one in ends[:2]:
        np.testing.assert_allclose(one.y1.y.q, ends[2].y1.y.q, atol=1e-11)
        np.testing.assert_allclose(one.y1.z, np.full(4, ends[2].y1.z[0]), atol=1e-11)
    assert int(ends[0].num_events) == 4 * int(ends[2].num_events)
    assert int(ends[0].flags) != 0  # they could part
    # In a row they slip one after the other where their limits differ, else all at once.
    assert int(ends[1].num_events) == int(ends[2].num_events)
    assert int(ends[1].flags) == 0


@pytest.mark.more
def test_a_load_and_a_bound_that_jump_are_followed_at_once():
    def load(t, q, v, args):
        return jnp.where(t >= 3.0, 1.0, 0.2) * jnp.ones(1)

    def bound(t, q, args):
        return jnp.where(t >= 5.0, 0.1, 0.5)

    structure = LinearStructure([[1.0]], [[0.04]], [[1.0]], load)
    system = WithSliders(structure, {"damper": Jenkins([1.0], 0.5, bound)})
    whole = ss.WithBreaks(system, [3.0, 5.0])
    # Until 3 s it sticks, then slips: by constants, from one to the next.
    run = ss.simulate(
        whole, 0.0, 8.0, whole.start(system.start(structure.state())), integrator=STRICT,
        saveat=ss.SaveAt(ts=[3.0, 5.0]),
    )  # fmt: skip

    def linear(q, v, stiffness, push, time):
        w = np.sqrt(stiffness - 0.02**2)
        x = q - push / stiffness
        a, b = x, (v + 0.02 * x) / w
        c, s, e = np.cos(w * time), np.sin(w * time), np.exp(-0.02 * time)
        return (
            push / stiffness + e * (a * c + b * s),
            e * ((b * w - 0.02 * a) * c - (a * w + 0.02 * b) * s),
        )

    q, v = linear(0.0, 0.0, 1.5, 0.2, 3.0)
    np.testing.assert_allclose(run.outputs.y.y.y.q[0], q, atol=1e-11)
    q, v = linear(q, v, 1.5, 1.0, 2.0)  # sticks on: its spring holds 0.5 N
    np.testing.assert_allclose(run.events.y_before.y.y.q[1], q, atol=1e-10)
    before, after = run.events.y_before.y, run.events.y_after.y
    assert float(before.z[1, 0]) == 0.0
    assert float(after.z[1, 0]) == pytest.approx(q - 0.2, abs=1e-10)
    names = [whole.mode_names[int(m)] for m in run.events.mode_after[:2]]
    assert names == ["stick", "slip forward"]
    first = float(run.events.t[2])
    q, v = linear(q, v, 1.0, 0.9, first - 5.0)
    assert v == pytest.approx(0.0, abs=1e-9)  # it turns
    assert float(run.events.y_before.y.y.q[2, 0]) == pytest.approx(q, abs=1e-10)
