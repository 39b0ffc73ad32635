"""Random automata with guards of all directions against matrix exponentials: none wrong in silence."""

import dataclasses
from collections import Counter

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss

from ._automata import State, by_exponentials, drawn

T1 = 6.0


@jax.jit
def run(machine, y0):
    return ss.simulate(
        machine, 0.0, T1, y0, integrator=ss.Integrator(step=ss.AdaptiveStep(1e-10)), throw=False,
        saveat=ss.SaveAt(events=True, max_events=64),
    )  # fmt: skip


@jax.jit
def slopes(machine, y0, by_machine, by_start, weights):
    """Along a direction forward, and the same in reverse."""
    kept, fixed = eqx.partition(machine, eqx.is_inexact_array)

    def end(kept, y0):
        found = ss.simulate(
            eqx.combine(kept, fixed), 0.0, T1, y0, throw=False, saveat=ss.SaveAt(max_events=None),
            integrator=ss.Integrator(step=ss.AdaptiveStep(1e-10)),
        )  # fmt: skip
        return weights @ jnp.stack(jax.tree.leaves(found.y1)), found

    _, forward, found = jax.jvp(end, (kept, y0), (by_machine, by_start), has_aux=True)
    rates = jax.grad(end, argnums=(0, 1), has_aux=True)(kept, y0)[0]
    along = zip(jax.tree.leaves(rates), jax.tree.leaves((by_machine, by_start)), strict=True)
    return forward, sum(jnp.sum(a * b) for a, b in along), found


@pytest.mark.slow
def test_derivatives_through_guards_of_all_directions():
    """By coefficients of field and guards, and by the start, beside differences of the exponentials."""
    right, h = 0, 1e-5
    for seed in range(120):
        machine, start = drawn(np.random.default_rng(seed))
        machine, rng = jax.tree.map(np.asarray, machine), np.random.default_rng([seed, 7])
        rates, levels = (rng.normal(size=a.shape) * (a != 0.0) for a in (machine.rates, machine.levels))
        rates[:, [0, 3, 4]] = 0.0  # what is place, speed and load stays so
        by_start, weights = rng.normal(size=3), rng.normal(size=3)
        machines = [
            dataclasses.replace(
                machine, rates=machine.rates + x * rates, levels=machine.levels + x * levels
            )
            for x in (0.0, h, -h)
        ]
        truths = [
            by_exponentials(m, start + x * by_start, T1)
            for m, x in zip(machines, (0.0, h, -h), strict=True)
        ]
        sequences = {tuple(int(i) for _, i in truth.events) for truth in truths}
        if len(sequences) > 1 or any(truth.end is None or truth.doubt for truth in truths):
            continue
        still = jax.tree.map(np.zeros_like, eqx.filter(machine, eqx.is_inexact_array))
        by_machine = dataclasses.replace(still, rates=rates, levels=levels)
        forward, back, found = slopes(
            machine, State(*map(np.float64, start)), by_machine, State(*by_start), weights
        )
        if int(found.flags):
            continue
        by_differences = weights @ (truths[1].end - truths[2].end) / (2.0 * h)
        assert float(forward) == pytest.approx(by_differences, rel=1e-4, abs=1e-4), seed
        assert float(back) == pytest.approx(float(forward), rel=1e-7, abs=1e-7), seed
        right += 1
    assert right > 40


def verdict(seed: int) -> str:
    machine, start = drawn(np.random.default_rng(seed))
    truth = by_exponentials(machine, start, T1)
    if truth.end is None:
        return "many events"
    machine = jax.tree.map(np.asarray, machine)
    found = run(machine, State(*map(np.float64, start)))
    if found.result != ss.RESULTS.successful:
        return "undecided" if truth.doubt else f"failed: {found.result}"
    n = int(found.num_events)
    same = n == len(truth.events) and int(found.mode1) == truth.mode
    if same:
        times = np.asarray(found.events.t)[:n]
        same = list(np.asarray(found.events.guard)[:n]) == [i for _, i in truth.events]
        same &= np.allclose(times, [t for t, _ in truth.events], rtol=0.0, atol=1e-7)
        same &= np.allclose(jax.tree.leaves(found.y1), truth.end, rtol=0.0, atol=1e-6)
    if same:
        return "right"
    return "flagged" if int(found.flags) else f"wrong: seed {seed}"


@pytest.mark.parametrize(
    ("first", "count"),
    [
        pytest.param(0, 60, marks=pytest.mark.more),
        pytest.param(1000, 600, marks=pytest.mark.slow),
    ],
)
def test_random_automata_are_right_or_flagged(first, count):
    verdicts = Counter(map(verdict, range(first, first + count)))
    assert set(verdicts) <= {"right", "flagged", "undecided", "many events"}, verdicts
    assert verdicts["right"] > 0.5 * count
    assert verdicts["flagged"] + verdicts["undecided"] < 0.1 * count
