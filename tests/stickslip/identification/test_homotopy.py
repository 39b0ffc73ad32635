"""Homotopy along a driven block that sticks and slips: the same optimum, from starts where the exact
friction alone stands still."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import (
    Homotopy,
    LevenbergMarquardt,
    Observed,
    Problem,
    Record,
    Unknown,
)
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
    with pytest.warns(UserWarning, match="reduced chi squared"):
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


class Still(NamedTuple):
    """A state that stays."""

    x: Any


class Rung(ss.AbstractSmoothSystem):
    """Nothing moves; what it shows tells `p` within 1.2 `reach` of the place of its optimum, and leads
    away from it outside."""

    p: Any
    place: Any
    reach: Any
    units: ClassVar = {"x": "1"}

    def vector_field(self, t, y, mode, args):
        return Still(0.0 * y.x)


def shown(t, y, system):
    far = (system.p - system.place) / system.reach
    return system.reach * far / (1.0 + (far / 1.6) ** 4) + y.x


def higher(system, width):
    """The wider, the higher the optimum and the farther it is seen."""
    return Rung(system.p, 1.0 + width, width)


def ladder(start=6.0):
    return Problem(
        lambda p, inputs: Rung(p["p"], 1.0, 1.0), lambda p, inputs: Still(0.0),
        {"p": Unknown(start, scale=1.0)}, {"s": Observed(shown, 1e-3, "1")},
        Record(np.array([0.0, 0.1]), {"s": np.zeros(2)}),
        integrator=ss.Integrator("rk4", ss.FixedStep(0.1), max_steps=4),
    )  # fmt: skip


@pytest.mark.slow
def test_every_rung_of_the_ladder_is_climbed_and_the_last_step_is_to_the_exact_law():
    """Places are 5, 3, 2 and at last 1, each seen from the one before alone."""
    problem = ladder()
    whole = problem.fit(method=Homotopy((4.0, 2.0, 1.0), higher))
    assert float(whole.values["p"]) == pytest.approx(1.0, abs=1e-7)
    assert bool(whole.successful)
    # The residual is that of the exact law: at the place of the last rung it is not zero.
    np.testing.assert_allclose(whole.residual, problem.residual(whole.values), atol=1e-9)
    # Where the last fit may not move, it tells where the ladder ended.
    held = LevenbergMarquardt(max_steps=1)
    for widths, end in (((4.0, 2.0, 1.0), 2.0), ((4.0, 2.0), 3.0), ((4.0,), 5.0)):
        found = problem.fit(method=Homotopy(widths, higher, polish=held))
        assert float(found.values["p"]) == pytest.approx(end, abs=0.02), widths
        exact = shown(0.0, Still(0.0), Rung(found.values["p"], 1.0, 1.0)) / 1e-3
        np.testing.assert_allclose(found.residual, exact, rtol=1e-9)
    # Without the rungs between, or without any, nothing is found.
    for lost in ((4.0, 1.0), (2.0, 1.0)):
        gone = problem.fit(method=Homotopy(lost, higher))
        assert abs(float(gone.values["p"]) - 1.0) > 1.0, lost
    many = problem.fits({"p": np.array([6.0, 1.5])}, method=Homotopy((4.0, 2.0, 1.0), higher))
    np.testing.assert_allclose(many.values["p"], 1.0, atol=1e-7)
