"""Where equilibria lose their stability: many modes that are hardly damped, and none damped at all."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import Follow, continue_equilibrium
from stickslip.structure import StructureState


class Linear(ss.AbstractSmoothSystem):
    r"""$\ddot q + (D_0 - \mu D_1) \dot q + (K_0 - \mu K_1) q = 0$."""

    mu: Any
    damping: Any
    stiffness: Any
    more_damping: Any = 0.0
    more_stiffness: Any = 0.0
    units: ClassVar = {"q": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        d = self.damping - self.mu * self.more_damping
        k = self.stiffness - self.mu * self.more_stiffness
        return StructureState(y.v, -d @ y.v - k @ y.q)

    def matrix(self, mu):
        n = self.stiffness.shape[0]
        d, k = self.damping - mu * self.more_damping, self.stiffness - mu * self.more_stiffness
        return np.block([[np.zeros((n, n)), np.eye(n)], [-np.asarray(k), -np.asarray(d)]])


def followed(system, bounds, step=0.05):
    rest = jnp.zeros(system.stiffness.shape[0])
    return continue_equilibrium(
        system, StructureState(rest, rest), "mu", bounds, follow=Follow(step=step)
    )


def first(n):
    return np.diag(np.eye(n)[0])


@pytest.mark.parametrize("n", [pytest.param(1, marks=pytest.mark.more), 8])
def test_one_of_many_modes_with_little_damping(n):
    """The first mode is damped by a hundredth of its critical damping, less `mu`."""
    rates = np.arange(1.0, n + 1)
    system = Linear(0.0, np.diag(0.02 * rates), np.diag(rates**2), more_damping=first(n))
    branch = followed(system, (-0.1, 0.1))
    (hopf,) = branch["HB"]
    assert hopf.value == pytest.approx(0.02, abs=1e-12)
    assert float(hopf.orbit.period) == pytest.approx(2.0 * np.pi, rel=1e-9)
    assert (branch.orbits.stable == (branch.values < hopf.value)).all()
    assert not branch["FL"]


CROSS = np.array([[0.0, 1.0], [0.0, 0.0]])  # friction couples two modes, one way
MODES = np.array([[2.0, -0.5], [-0.5, 1.5]])


@pytest.mark.parametrize("start", [0.0, -0.9])
def test_two_modes_without_damping_flutter_where_their_frequencies_meet(start):
    r"""$(k_{11} - k_{22})^2 + 4(k_{12} - \mu)k_{21} = 0$: at -5/8; the limit of no damping at all."""
    branch = followed(Linear(start, np.zeros((2, 2)), MODES, more_stiffness=CROSS), (-1.0, 1.4))
    (flutter,) = branch["FL"]
    assert flutter.value == pytest.approx(-0.625, abs=1e-10)
    assert float(flutter.orbit.period) == pytest.approx(2.0 * np.pi / np.sqrt(1.75), rel=1e-7)
    assert "period 4.749" in repr(flutter)
    assert not branch["HB"]
    # What nothing damps is not stable, on either side.
    assert not branch.orbits.stable.any()


@pytest.mark.parametrize("damping", [1e-2, 1e-5])
def test_with_damping_it_is_a_hopf_point(damping):
    """By the growth that NumPy finds."""
    system = Linear(0.0, damping * np.eye(2), MODES, more_stiffness=CROSS)
    branch = followed(system, (-1.0, 1.4))
    (hopf,) = branch["HB"]

    def grows(mu):
        return np.max(np.linalg.eigvals(system.matrix(mu)).real)

    assert hopf.value == pytest.approx(brentq(grows, -0.7, -0.6249, xtol=1e-13), abs=1e-9)
    assert not branch["FL"]


def test_a_body_that_nothing_holds_does_not_hide_the_others():
    """Two eigenvalues are zero, and so is their sum, all along the branch."""
    damping, more = np.diag([0.0, 0.02, 0.1]), np.diag([0.0, 1.0, 0.0])
    system = Linear(0.0, damping, np.diag([0.0, 1.0, 4.0]), more_damping=more)
    (hopf,) = followed(system, (-0.1, 0.1))["HB"]
    assert hopf.value == pytest.approx(0.02, abs=1e-9)
    assert float(hopf.orbit.period) == pytest.approx(2.0 * np.pi, rel=1e-9)


def test_a_mode_that_nothing_damps_does_not_hide_another_one():
    damping, more = np.diag([0.0, 0.02]), np.diag([0.0, 1.0])
    branch = followed(Linear(0.0, damping, np.diag([9.0, 1.0]), more_damping=more), (-0.1, 0.103))
    (hopf,) = branch["HB"]
    assert hopf.value == pytest.approx(0.02, abs=1e-12)
    assert float(hopf.orbit.period) == pytest.approx(2.0 * np.pi, rel=1e-9)
    assert not branch["FL"]
    assert not branch.orbits.stable.any()


def test_two_modes_that_cross_at_once_are_no_secret():
    """The sign of the product of all sums is the same on both sides."""
    system = Linear(0.003, 0.02 * np.eye(2), np.eye(2), more_damping=np.eye(2))
    branch = followed(system, (-0.1, 0.1))
    (hopf,) = branch["HB"]
    assert hopf.value == pytest.approx(0.02, abs=1e-12)
    assert (branch.orbits.stable == (branch.values < hopf.value)).all()


def test_two_modes_that_cross_in_one_step_are_two_points():
    damping, more = np.diag([0.02, 0.024]), np.eye(2)
    branch = followed(Linear(0.0, damping, np.diag([1.0, 2.0]), more_damping=more), (-0.1, 0.1), 0.2)
    assert [p.value for p in branch["HB"]] == pytest.approx([0.02, 0.024], abs=1e-12)


@pytest.mark.more
@pytest.mark.parametrize("damped", [False, True])
def test_random_structures_against_their_eigenvalues(damped):
    """Wherever two more eigenvalues grow, or two fewer, on a fine grid there is a point."""
    crossings = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 7))
        rates = np.sort(rng.uniform(1.0, 5.0, n))
        damping = np.diag(rng.uniform(0.001, 0.02, n) * rates) * damped
        cross = 2.0 * rng.normal(size=(n, n))
        system = Linear(0.0, damping, np.diag(rates**2), more_stiffness=cross)
        branch = followed(system, (0.0, 1.0), step=0.02)
        grid = np.linspace(0.0, 1.0, 2001)
        grow = [np.sum(np.linalg.eigvals(system.matrix(mu)).real > 1e-6) for mu in grid]
        turns = grid[1:][np.abs(np.diff(grow)) == 2]
        points = [p.value for p in branch["HB" if damped else "FL"]]
        off = np.abs(np.subtract.outer(turns, [*points, np.inf]))
        assert np.all(np.min(off, axis=1) < 1e-3)
        assert not branch["FL" if damped else "HB"]
        crossings += turns.size
    assert crossings >= 2
