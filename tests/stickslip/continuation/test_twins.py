"""Machines that are alike: eigenvalues that pass the border of stability at once, or nearly."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import (
    Follow,
    OrbitGuess,
    continue_equilibrium,
    continue_orbit,
    periodic_orbit,
)
from stickslip.continuation._crossings import LEFT, PAIR, RIGHT, partners, passing

from .test_flutter import Linear
from .test_flutter import followed as followed_over_load


class Two(NamedTuple):
    """Displacements and velocities of two columns."""

    q: Any
    v: Any


class Columns(ss.AbstractSmoothSystem):
    r"""$\ddot q_i + c\dot q_i + (1 + d_i - p) q_i + q_i^3 = 0$: each buckles at $p = 1 + d_i$."""

    p: Any
    c: Any
    d: Any
    units: ClassVar = {"q": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return Two(y.v, -self.c * y.v - (1.0 + self.d - self.p) * y.q - y.q**3)


def buckled(c, d):
    d = jnp.asarray(d)
    still = Two(jnp.zeros(d.size), jnp.zeros(d.size))
    return continue_equilibrium(Columns(0.3, c, d), still, "p", (0.3, 2.0))


@pytest.mark.parametrize("c", [0.0, pytest.param(0.1, marks=pytest.mark.more), 3.0])
def test_columns_that_are_nearly_alike_buckle_one_after_the_other(c):
    branch = buckled(c, [0.0, 1e-3])
    assert [p.value for p in branch["BP"]] == pytest.approx([1.0, 1.001], abs=1e-9)
    assert [p.label for p in branch.specials] == ["EP", "BP", "BP", "EP"]
    assert (np.asarray(branch.orbits.stable) == ((branch.values < 1.0) & (c > 0.0))).all()


@pytest.mark.parametrize("c", [0.0, pytest.param(0.1, marks=pytest.mark.more), 3.0])
@pytest.mark.parametrize(
    "d", [[0.0, 0.0], pytest.param([0.0, 1e-9], marks=pytest.mark.more), [0.0] * 3]
)
def test_columns_that_are_alike_buckle_at_once(c, d):
    """No Hopf point, whose sign of a product they change; without damping no flutter."""
    branch = buckled(c, d)
    (point,) = branch["BP"]
    assert point.value == pytest.approx(1.0, abs=3e-9)
    assert [p.label for p in branch.specials] == ["EP", "BP", "EP"]
    # Of three the product changes its sign, as of one.
    assert ("several eigenvalues at once" in repr(point)) == (len(d) == 2)


@pytest.mark.parametrize("c", [0.0, pytest.param(0.3, marks=pytest.mark.more), 3.0])
@pytest.mark.parametrize("off", [1e-3, pytest.param(0.02, marks=pytest.mark.more)])
def test_one_mode_grows_before_another_ceases_to(c, off):
    """Within one step: their number at its ends is the same, and the sign of every product."""
    stiffness, load = np.diag([1.0, -1.0 - off]), np.diag([1.0, -1.0])
    system = Linear(0.5, c * np.eye(2), stiffness, more_stiffness=load)
    branch = followed_over_load(system, (0.5, 1.6))
    assert [p.value for p in branch["BP"]] == pytest.approx([1.0, 1.0 + off], abs=1e-9)
    assert len(branch.specials) == 4


def test_one_that_grows_where_another_ceases_to_is_no_silent_step():
    stiffness = load = np.diag([1.0, -1.0])
    system = Linear(0.5, 0.3 * np.eye(2), stiffness, more_stiffness=load)
    (point,) = followed_over_load(system, (0.5, 1.6))["BP?"]
    assert point.value == pytest.approx(1.0, abs=1e-4)
    assert "one eigenvalue passes to each side" in point.words


class Forced(NamedTuple):
    """Displacements and velocities of two machines, and of a third one that is driven."""

    q: Any
    v: Any
    z: Any
    w: Any


class Pumped(ss.AbstractSmoothSystem):
    r"""$\ddot q_i + c\dot q_i + (1 + d_i + p\cos\Omega t)q_i + q_i^3 = 0$ beside a driven machine."""

    p: Any
    c: Any
    d: Any
    rate: Any
    units: ClassVar = {"q": "m", "v": "m/s", "z": "m", "w": "m/s"}

    def vector_field(self, t, y, mode, args):
        k = 1.0 + self.d + self.p * jnp.cos(self.rate * t)
        return Forced(
            y.v, -self.c * y.v - k * y.q - y.q**3, y.w, -y.w - 3.0 * y.z + jnp.cos(self.rate * t)
        )


class Fed(ss.AbstractSmoothSystem):
    r"""$\ddot q_i - (p - d_i)\dot q_i + 2.1q_i + \dot q_i^3 = 0$ beside it: pairs leave at $d_i$."""

    p: Any
    d: Any
    units: ClassVar = {"q": "m", "v": "m/s", "z": "m", "w": "m/s"}

    def vector_field(self, t, y, mode, args):
        a = (self.p - self.d) * y.v - 2.1 * y.q - y.v**3
        return Forced(y.v, a, y.w, -y.w - 3.0 * y.z + jnp.cos(t))


def followed(system, bounds, period):
    still = Forced(jnp.zeros(2), jnp.zeros(2), jnp.zeros(()), jnp.zeros(()))
    orbit = periodic_orbit(system, OrbitGuess(still, period), forced=True)
    return continue_orbit(
        system, orbit, "p", bounds, forcing_period=lambda s: period, follow=Follow(step=0.02)
    )


def edge(rate, c, d, side, bounds):
    """Where a multiplier of one machine is `side`, by SciPy."""

    def multipliers(p):
        def slope(t, y):
            k = 1.0 + d + p * np.cos(rate * t)
            return (np.array([[0.0, 1.0], [-k, -c]]) @ y.reshape(2, 2)).ravel()

        span = 0.0, 2.0 * np.pi / rate
        run = scipy.integrate.solve_ivp(
            slope, span, np.eye(2).ravel(), method="DOP853", rtol=1e-12, atol=1e-14
        )
        return np.linalg.eigvals(run.y[:, -1].reshape(2, 2))

    return brentq(lambda p: np.max(side * multipliers(p).real) - 1.0, *bounds, xtol=1e-13)


@pytest.mark.more
@pytest.mark.parametrize("d", [0.0, 1e-7, 1e-3])
@pytest.mark.parametrize(
    ("rate", "side", "label", "bounds"),
    [(2.0, -1.0, "PD", (0.02, 0.6)), (1.0, 1.0, "BP", (0.3, 1.5))],
)
def test_orbits_of_machines_that_are_nearly_alike_lose_stability_one_after_the_other(
    rate, side, label, bounds, d
):
    """And of such that are alike, or nearly to what is told apart, at once."""
    expected = sorted(edge(rate, 0.1, own, side, bounds) for own in (0.0, d))
    system = Pumped(bounds[0], 0.1, jnp.array([0.0, d]), rate)
    branch = followed(system, bounds, 2.0 * np.pi / rate)
    found = [point.value for point in branch[label]]
    assert [p.label for p in branch.specials] == ["EP", *[label] * len(found), "EP"]
    if len(found) == 1:
        assert d < 1e-6
        assert "several eigenvalues at once" in repr(branch[label][0])
        expected = expected[:1]
    np.testing.assert_allclose(found, expected, atol=2e-8)
    assert (np.asarray(branch.orbits.stable) == (branch.values < expected[0])).all()


@pytest.mark.more
@pytest.mark.parametrize("d", [0.0, 1e-3, 0.02])
def test_pairs_of_multipliers_leave_one_after_the_other(d):
    """With 0.02 one pair grows as fast as the other decays at a point in the middle."""
    branch = followed(Fed(-0.2, jnp.array([0.0, d])), (-0.2, 0.3), 2.0 * np.pi)
    expected = [0.0, d] if d else [0.0]
    np.testing.assert_allclose([p.value for p in branch["NS"]], expected, atol=1e-9)
    assert len(branch.specials) == 2 + len(expected)


def test_partners_are_conjugates_or_both_real():
    found = np.array([0.9j, -0.9j, 1.0 / 0.9j, -1.0 / 0.9j, 2.0, -3.0])
    assert partners(found) == [(1, 0), (3, 2), (5, 4)]


def test_kinds_that_pass_are_those_that_one_point_has_more():
    few, many = np.array([3.0]), np.array([3.1, -1.2, -1.1, 1.05 + 0.1j, 1.05 - 0.1j])
    assert passing(few, many) == passing(many, few) == {RIGHT: 0, LEFT: 2, PAIR: 1}
    assert max(passing(many, many).values()) == 0


@pytest.mark.parametrize("seed", [39, *(pytest.param(s, marks=pytest.mark.more) for s in (5, 9, 2, 6))])
def test_random_structures_buckle_where_scipy_says(seed):
    """Alone (39: loads in two steps that follow), beside one that is nearly alike, beside a twin."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    a = rng.normal(size=(n, n))
    stiffness = a @ a.T + 0.5 * np.eye(n)
    b = rng.normal(size=(n, n))
    load = b @ b.T + 0.1 * np.eye(n)
    if seed != 39:
        off = 10.0 ** -rng.uniform(2, 10) if seed % 4 == 1 else 0.0
        stiffness = scipy.linalg.block_diag(stiffness, stiffness + off * np.eye(n))
        load = scipy.linalg.block_diag(load, load)
    expected = scipy.linalg.eigh(stiffness, load, eigvals_only=True)
    top = min(expected[0] * rng.uniform(3, 30), expected[-1] * 1.2)
    expected = expected[expected < top]
    damping = [0.0, 0.05, 2.0][seed % 3] * np.eye(len(stiffness))
    branch = followed_over_load(Linear(0.0, damping, stiffness, more_stiffness=load), (0.0, top))
    found = np.array([point.value for point in branch["BP"]])
    assert len(branch.specials) == 2 + len(found)
    # Each of the loads is one of those that are found, and the other way round.
    apart = np.abs(found[:, None] - expected[None, :])
    assert np.max(np.min(apart, axis=0)) < 1e-5 * top
    assert np.max(np.min(apart, axis=1)) < 1e-7 * top
    below = branch.values < expected[0]
    assert (np.asarray(branch.orbits.stable) == (below & (seed % 3 > 0))).all()
