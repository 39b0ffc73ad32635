"""Random automata with guards of all directions against matrix exponentials: none wrong in silence."""

from collections import Counter

import jax
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
