"""Lyapunov exponents that cannot be told are not numbers, and a word says why."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip import AbstractHybridSystem
from stickslip.analysis import (
    Segments,
    _growth,
    lyapunov_diagram,
    lyapunov_spectrum,
    lyapunov_spectrum_of_map,
    two_trajectory_exponent,
)
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.sweep import Compute
from stickslip.systems import BouncingBall, CoulombOscillator, Motion

from ._chaos import Flow, Point, lorenz

SMOOTH = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=10_000_000)
BLOCK = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
ZERO = jnp.asarray(0.0)


@pytest.mark.parametrize("start", [0.3, 2.0])
def test_an_orbit_that_leaves_the_finite_numbers(start):
    """Logistic map at 5: almost every orbit runs off to minus infinity. It came out as stable."""
    found = lyapunov_spectrum_of_map(lambda x: 5 * x * (1 - x), start, Segments(1, 200))
    assert np.isnan(found.exponents).all()
    assert np.isnan(found.error).all()
    assert found.words.tolist() == ["failed"]
    assert np.isnan(found.kaplan_yorke_dimension)


def test_words_of_what_is_told(monkeypatch):
    """The identity is neutral; a constant map forgets all."""
    assert lyapunov_spectrum_of_map(lambda x: x, 0.3, Segments(1, 40)).words.tolist() == ["ok"]
    forgets = lyapunov_spectrum_of_map(lambda x: 0 * x + 0.5, 0.3, Segments(1, 40))
    assert forgets.words.tolist() == ["lost"]
    assert np.isneginf(forgets.exponents).all()


@pytest.mark.more
def test_a_block_at_rest_and_one_that_stops_early():
    """On a belt that stands still it sticks: nothing moves, no deviation either."""
    speeds = np.array([0.0, 0.2])
    options = {"record": Segments(2.0, 20), "compute": Compute("portable")}
    spectrum = {"integrator": SMOOTH}
    start = lambda system: Motion(0.0, system.belt_speed)  # noqa: E731
    found = lyapunov_diagram(BLOCK, {"belt_speed": speeds}, start, spectrum=spectrum, **options)
    words = np.array(found.exponent_status.attrs["flag_meanings"].split())[found.exponent_status.values]
    assert words.tolist() == [["at_rest", "at_rest"], ["ok", "lost"]]
    assert np.isnan(found.exponents[0]).all()
    assert np.isfinite(found.exponents[1, 0])
    # A rest whose linear field decides is told: the eigenvalues.
    rest = lyapunov_spectrum(lorenz(0.5), Point(0.0, 0.0, 0.0), Segments(0.5, 40, warm_up=40))
    assert rest.words.tolist() == ["ok"] * 3
    np.testing.assert_allclose(rest.exponents[1], -8 / 3, rtol=1e-3)

    # Carried by the belt for ever, it moves: the stick holds its speed, and no event says so.
    carried = eqx.tree_at(lambda block: block.stiffness, BLOCK, 1e-9)
    found = lyapunov_spectrum(carried, Motion(0.0, 0.2), Segments(2.0, 20), integrator=SMOOTH)
    assert found.words.tolist() == ["ok", "lost"]
    np.testing.assert_allclose(found.exponents, [0.0, -np.inf], atol=1e-12)

    few = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=5)
    lost = lyapunov_spectrum(BLOCK, Motion(0.0, 0.2), Segments(2.0, 20), integrator=few)
    assert lost.words.tolist() == ["failed", "failed"]
    assert np.isnan(lost.exponents).all()
    assert np.isnan(lost.kaplan_yorke_dimension)


class Carried(AbstractMechanism):
    """Five blocks on a belt: weak springs for ever hold none back, the last one hardly touches it."""

    apart: bool = eqx.field(static=True)  # coordinates: distances to the block before, not places

    coordinates: ClassVar = dict.fromkeys("abcde", "m")

    @property
    def rows(self):
        return np.tril(np.ones((5, 5))) if self.apart else np.eye(5)

    @property
    def contact_directions(self):
        return {f"block {name}": tuple(row) for name, row in zip("abcde", self.rows, strict=True)}

    def mass_matrix(self, q):
        return tuple(map(tuple, self.rows.T @ self.rows)) if self.apart else (1.0,) * 5

    def forces(self, t, q, v, args):
        places, speeds = (self.rows @ jnp.stack(list(z)) for z in (q, v))
        last = jnp.array([0.0, 0.0, 0.0, 0.0, 1.0])
        return tuple(self.rows.T @ (-(last + 1e-9) * places - 0.4 * last * speeds))

    def contacts(self, t, q, v, args):
        loads = (1.0, 1.0, 1.0, 1.0, 1e-9)
        return [Contact(Coulomb(1.0), load, surface_speed=0.2) for load in loads]


@pytest.mark.slow
@pytest.mark.parametrize("apart", [False, True])
def test_sticks_that_last_in_a_machine_of_a_thousand_modes(apart):
    """Four blocks are carried, one swings out at -0.2 1/s, with speeds in the belt's frame."""
    machine = Carried(apart)
    speeds = np.linalg.solve(machine.rows, [0.2, 0.2, 0.2, 0.2, 0.1])
    start = machine.state(**dict(zip(machine.names.velocities, speeds, strict=True)))
    # 13 periods of the damped oscillation, so that nothing of it is left in the mean.
    period = 2.0 * np.pi / np.sqrt(1.0 - 0.04)
    options = {"record": Segments(period / 4.0, 52, warm_up=20), "integrator": SMOOTH}
    found = lyapunov_spectrum(machine, start, **options)
    assert machine.mode_names[int(found.mode1)] == " / ".join([*["stick"] * 4, "slip backward"])
    assert found.words.tolist() == ["ok"] * 6 + ["lost"] * 4
    np.testing.assert_allclose(found.exponents[:4], 0.0, atol=2e-3)
    np.testing.assert_allclose(found.exponents[4:6], -0.2, atol=2e-3)


class ByHand(AbstractHybridSystem):
    """A block that its belt carries for ever, in a system of 700 modes that says nothing but them."""

    mode_names: ClassVar = ("stick", "slip", *(f"never {i}" for i in range(698)))
    guard_names: ClassVar = ("gives way", "stops")
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, jnp.where(mode == 0, 0.0, 0.5 - y.x))

    def guards(self, t, y, mode, args):
        stick = mode == 0
        return jnp.where(stick, 1.0 - 1e-9 * y.x, 1.0), jnp.where(stick, 1.0, 0.2 - y.v)

    def transition(self, t, y, mode, guard, args):
        return Motion(y.x, 0.2), jnp.where(mode < 2, 1 - mode, mode)

    def initial_mode(self, t, y, args):
        return jnp.where(y.v == 0.2, 0, 1)


@pytest.mark.slow
def test_a_stick_that_lasts_in_a_system_written_by_hand():
    found = lyapunov_spectrum(ByHand(), Motion(0.0, 0.2), Segments(2.0, 20), integrator=SMOOTH)
    assert found.words.tolist() == ["ok", "lost"]
    np.testing.assert_allclose(found.exponents, [0.0, -np.inf], atol=1e-12)


def two(system, start, **options):
    options = {"record": Segments(1.0, 20), "integrator": SMOOTH, **options}
    return jax.jit(lambda: two_trajectory_exponent(system, start, **options))()


@pytest.mark.more
def test_two_motions_that_merge_saturate_or_fail():
    decay = Flow(jnp.diag(jnp.array([-4.0, -4.0, -4.0])), ZERO, ZERO)
    offset, unwarmed = Point(1.0, 1.0, 1.0), Segments(1.0, 20, warm_up=0)
    assert two(decay, offset, distance=1e-3, record=unwarmed).words == "ok"
    # Two balls come to rest on one floor: the distance is zero from then on, not ever smaller.
    ball = two(BouncingBall(0.5, 9.81, 0.7, 0.02), Motion(1.0, 0.0), distance=1e-6, record=unwarmed)
    assert ball.words == "merged"
    assert np.isnan(ball.exponent)
    assert np.isnan(ball.error)
    # Lorenz: e^(0.9 t) from 1e-8 is the size of the attractor after 23; as printed, 0.9 is not seen.
    printed = two(lorenz(), Point(1.0, 1.0, 20.0), record=Segments(2.0, 20), renormalise=False)
    assert printed.words == "saturated"
    assert np.isnan(printed.exponent)
    assert 0.0 < float(printed.running[-1]) < 0.7
    assert float(printed.distance[-1]) > 1.0
    few = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=5)
    assert two(lorenz(), Point(1.0, 1.0, 20.0), integrator=few).words == "failed"


@pytest.mark.more
def test_rounding_is_no_distance():
    """A rotation about a place 1e6 away: a distance of 1e-9 is what rounding makes of it."""
    turning = Flow(jnp.array([[0.0, -1.0, 1e6], [1.0, 0.0, -1e6], [0.0, 0.0, 0.0]]), ZERO, ZERO)
    found = two(turning, Point(1e6, 1e6 + 1.0, 1.0), components="x", distance=1e-9)
    assert found.words == "merged"
    assert np.isnan(found.exponent)


def test_a_growth_that_is_not_finite_is_not_lost():
    for bad in (np.nan, np.inf):
        images = jnp.array([[1.0, 0.0], [0.0, bad]])
        assert np.isnan(_growth.orthonormal_columns(images)[1]).all()
