"""Three contacts of two coordinates whose friction weakens: they stop and give way together."""

from dataclasses import replace
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Stribeck
from stickslip.mechanism import Contact, _search
from tests.stickslip.mechanism._pair import AbstractPair, random_pairs

END = 15.0


class Three(AbstractPair):
    """Two blocks on one belt that rub on each other, coupled and driven."""

    contact_directions: ClassVar = {
        "one": {"x": 1.0},
        "two": {"y": 1.0},
        "between": {"x": -1.0, "y": 1.0},
    }

    def contacts(self, t, q, v, args):
        *_, one, part, speed, two, belt, swing, rate = self.p
        load = 1.0 + swing * jnp.sin(rate * t)
        return {
            "one": Contact(Stribeck(one, part * one, speed), load, belt),
            "two": Contact(Stribeck(two, part * two, speed), 1.0, belt),
            "between": Contact(Stribeck(0.4 * one, part * 0.4 * one, speed), 1.0, 0.0),
        }


def lane(p, rtol=1e-10, longest=END / 100):
    three, step = Three(p), ss.AdaptiveStep(rtol, dtmax=longest)
    found = ss.simulate(
        three, 0.0, END, three.state(x=0.3, y=-0.2), throw=False, saveat=ss.SaveAt(max_events=600),
        integrator=ss.Integrator(step=step),
    )  # fmt: skip
    return jnp.stack([found.y1.x, found.y1.y]), found.num_events, found.flags, found.successful


@pytest.mark.more
def test_the_limit_of_a_law_is_known_to_rounding():
    """`mu_k + (mu_s - mu_k)` is not `mu_s`: what gave way was at rest again, and gave way again."""
    p = random_pairs(158)[57]
    assert p[5] * 0.4 != p[6] * p[5] * 0.4 + (p[5] * 0.4 - p[6] * p[5] * 0.4)
    run = jax.jit(lane)
    assert bool(run(p)[3])
    assert bool(run(random_pairs(159)[158])[3])


@pytest.mark.slow
def test_taken_exactly_some_chatter(monkeypatch):
    """The fault, planted."""
    monkeypatch.setattr(_search, "ENGINE", replace(_search.ENGINE, slack=0.0))
    every = ss.map_lanes(lambda p: lane(p, longest=END / 99))(random_pairs(240)[20:])
    assert np.sum(~np.asarray(every[3])) > 5


@pytest.mark.slow
def test_random_systems_are_those_of_fine_steps_or_flagged():
    number = 1500
    lanes, p = ss.map_lanes(lane), random_pairs(number)
    plain = lanes(p, np.full(number, 1e-10), np.full(number, END / 100))
    fine = lanes(p, np.full(number, 1e-12), np.full(number, END / 1000))
    off = np.max(np.abs(plain[0] - fine[0]), axis=1) > 1e-6
    off |= np.asarray(plain[1] != fine[1])
    told = (np.asarray(plain[2]) != 0) | (np.asarray(fine[2]) != 0)
    assert np.all(plain[3])
    assert not np.any(off & ~told)
    assert np.mean(told) < 0.01
