"""Homotopy along a driven block that sticks and slips: the same optimum, from starts where the exact
friction alone stands still."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import Homotopy, LevenbergMarquardt, Observed, Problem, Record
from stickslip.mechanism import AbstractMechanism, Contact

TRUTH = {"excess": 0.5, "kinetic": 0.8, "stiffness": 2.0}
SIGMA = 0.005
INTEGRATOR = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-8), max_steps=20_000)
FORCE = 2.0


class Block(AbstractMechanism):
    """1 kg on a spring, driven by a force, on a dry floor."""

    stiffness: Any
    law: Any

    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"floor": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": FORCE * jnp.sin(t) - self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        return {"floor": Contact(self.law, 1.0)}

    def time_scale(self, args):
        return 1.0


def block(p, inputs):
    return Block(p["stiffness"], Coulomb(p["kinetic"] * (1.0 + p["excess"]), p["kinetic"]))


def at_rest(p, inputs):
    return block(TRUTH, {}).state()


def problem(end=20.0):
    times = np.arange(0.2, end, 0.2)
    run = ss.simulate(block(TRUTH, {}), 0.0, end, at_rest({}, {}), saveat=ss.SaveAt(ts=times))
    assert int(run.num_events) >= 3
    noise = SIGMA * np.random.default_rng(0).normal(size=times.size)
    record = Record(times, {"x": np.asarray(run.outputs.y.x) + noise}, begin=0.0)
    observed = {"x": Observed(lambda t, y, system: y.x, SIGMA, "m")}
    return Problem(block, at_rest, TRUTH, observed, record, integrator=INTEGRATOR)


def arrived(fits, reference):
    off = [np.abs(np.asarray(fits.values[n]) / float(reference.values[n]) - 1.0) for n in TRUTH]
    return np.max(off, axis=0) < 1e-5


@pytest.mark.slow
def test_from_a_start_at_which_the_block_never_moves():
    found = problem(8.0)
    stuck = {"excess": 1.0, "kinetic": 2.5, "stiffness": 4.0}
    alone = found.fit(start=stuck)
    np.testing.assert_allclose([float(alone.values[n]) for n in TRUTH], list(stuck.values()))
    near = found.fit(method=Homotopy((0.3, 0.05)), start=stuck)
    reference = found.fit(method=LevenbergMarquardt(tolerance=1e-12))
    assert bool(near.successful)
    assert arrived(near, reference).all()
    # The fit is of the exact law, not of a rounded one.
    np.testing.assert_allclose(near.residual, found.residual(near.values), atol=1e-9)
    assert int(near.steps) > 5


@pytest.mark.slow
def test_more_starts_converge_than_with_exact_friction_alone():
    found = problem()
    reference = found.fit(method=LevenbergMarquardt(tolerance=1e-12))
    rng = np.random.default_rng(1)
    rows = {name: TRUTH[name] * 4.0 ** rng.uniform(-1.0, 1.0, 64) for name in TRUTH}
    alone = arrived(found.fits(rows, chunk_size=8), reference).sum()
    near = arrived(found.fits(rows, method=Homotopy((0.3, 0.1, 0.03)), chunk_size=8), reference).sum()
    assert alone < 32
    assert near >= 62


def test_what_is_no_homotopy_is_refused():
    with pytest.raises(ValueError, match=r"widths = \(0.1, 0.1\): it must be falling"):
        Homotopy((0.1, 0.1))
    with pytest.raises(ValueError, match=r"widths\[1\] = 0.0: it must be"):
        Homotopy((0.1, 0.0))
