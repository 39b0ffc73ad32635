"""Stable manifolds under a force: in closed form with a corner, and backwards in time by SciPy."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import root

import stickslip as ss
from stickslip.basin import Settle, basins, border_shares
from stickslip.basin._judged import codes_from
from stickslip.basin._lanes import Lanes
from stickslip.basin._manifold import Manifold, _goes_on, saddle_of
from stickslip.friction import Coulomb
from stickslip.mechanism import Contact

from ._systems import Duffing, Hill, share_at_the_right

TURN = 2.0 * np.pi
BOX = {"x": (-2.0, 2.0), "v_x": (-2.0, 2.0)}


class Point(NamedTuple):
    a: Any
    b: Any


class Sheared(ss.AbstractSmoothSystem):
    """x' = x / 2 + cos t and b' = -b / 3, by a = x + s(b): the manifold is a = s(b) - 0.4 at t = 0.

    It may have a corner at b = 0.4.
    """

    corner: float = 0.0
    units: ClassVar = {"a": "m", "b": "m"}

    def shear(self, b):
        return 0.3 * b + b**2 + self.corner * (abs(b - 0.4) - 0.4)

    def vector_field(self, t, y, mode, args):
        slope = 0.3 + 2.0 * y.b + self.corner * jnp.sign(y.b - 0.4)
        return Point(0.5 * (y.a - self.shear(y.b)) + jnp.cos(t) - slope * y.b / 3.0, -y.b / 3.0)

    def beside(self, place):
        return place[0] - self.shear(place[1]) + 0.4


def manifold_of(system):
    """Its manifold, with the box that `follow` ends at."""
    start = np.array([-0.4, 0.0])
    integrator = ss.Integrator(step=ss.AdaptiveStep(1e-10, 1e-10))
    lanes = Lanes(system, None, integrator, Point(*start))
    saddle = saddle_of(lanes, TURN, 0.0, TURN, start, 0, np.full(2, np.inf))
    slope = 0.3 - system.corner  # of the shear at the saddle
    np.testing.assert_allclose(saddle.across / saddle.across[0, 0], [[1.0, -slope]], atol=1e-8)

    def between(one, other):
        ends = system.beside(one), system.beside(other)
        return one + ends[0] / (ends[0] - ends[1]) * (other - one)

    limits = np.array([[-2.0, 2.0], [-1.0, 1.0]])
    return Manifold(lanes, Settle(4.0 * TURN, TURN), saddle, np.asarray, between, limits)


def test_places_beside_the_manifold_come_to_it():
    system = Sheared()
    manifold = manifold_of(system)
    for b in (-0.8, 0.0, 0.5):
        place, tangent = manifold.nearest_place(np.array([system.shear(b) - 0.4 + 0.02, b]))
        assert system.beside(place) == pytest.approx(0.0, abs=1e-8)
        # In parts of the box, which is twice as wide as it is high.
        slope = 0.5 * (0.3 + 2.0 * place[1])
        assert tangent[0] == pytest.approx(slope * tangent[1], abs=1e-6)
        # A border beside it is another one.
        assert manifold.tangent_at(place) is not None
        assert manifold.tangent_at(place + np.array([1e-4, 0.0])) is None


def test_a_way_across_to_another_fold_is_told_from_a_corner():
    along, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    assert not _goes_on(0.01 * up, along, along)
    assert not _goes_on(-along, along, along)
    assert _goes_on(along, along, along)
    assert _goes_on(along + up, along, up)


@pytest.mark.more
@pytest.mark.parametrize("corner", [0.0, 0.5])
def test_the_manifold_is_that_of_the_closed_form(corner):
    system = Sheared(corner)
    first, manifold = np.array([system.shear(1.0) - 0.4, 1.0]), manifold_of(system)
    tangent = manifold.tangent_at(first)
    places = manifold.follow(first, -tangent * np.sign(tangent[1]))
    assert places[-1, 1] < -1.0
    inside = places[np.abs(places[:, 1]) <= 1.0]
    np.testing.assert_allclose([system.beside(place) for place in inside], 0.0, atol=4e-7)


def duffing(t, y, damping=0.3, force=0.1):
    x, v = y.reshape(2, -1)
    return np.concatenate([v, x - x**3 - damping * v + force * np.cos(t)])


def right_share():
    """Rows of the box are cut by the manifold, from beside the saddle backwards period by period."""
    given = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}

    def returned(y):
        return solve_ivp(duffing, (0.0, TURN), y, **given).y[:, -1]

    saddle = root(lambda y: returned(y) - y, [-0.05, 0.0], tol=1e-13).x
    slopes = np.array(
        [(returned(saddle + h) - returned(saddle - h)) / 2e-6 for h in 1e-6 * np.eye(2)]
    ).T
    values, ways = np.linalg.eig(slopes)
    at = np.argmin(np.abs(values))
    size = 1e-5 * np.exp(np.linspace(0.0, -np.log(values[at]), 8000, endpoint=False))
    halves = []
    for side in (1.0, -1.0):
        y, rows = saddle[:, None] + side * size * ways[:, at, None], []
        for _ in range(3):
            rows.append(y)
            y = solve_ivp(duffing, (TURN, 0.0), y.ravel(), **given).y[:, -1].reshape(2, -1)
        half = np.concatenate(rows, axis=1)
        halves.append(half[:, : np.argmax(np.max(np.abs(half), axis=0) > 3.0)])
    curve = np.concatenate([halves[0][:, ::-1], halves[1]], axis=1)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve), axis=0))])
    x, v = CubicSpline(way, curve.T)(np.linspace(0.0, way[-1], 2_000_001)).T
    return share_at_the_right(x, v, BOX)


@pytest.mark.slow
def test_shares_under_a_force_are_those_of_the_saddles_manifold():
    system, settle = Duffing(0.3, 0.1), Settle(40.0 * TURN, TURN)
    found = basins(system, system.state(), BOX, settle, points=(16, 16))
    shares = border_shares(system, found, settle)
    right = next(a.name for a in found.attractors if a.motion.y0.x > 0.0)
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-12)
    assert shares[right] == pytest.approx(right_share(), abs=1e-7)


class Shaken(Hill):
    """The mass in a well that is shaken, until it leaves over the hill."""

    def forces(self, t, q, v, args):
        return {"x": super().forces(t, q, v, args)["x"] + 0.03 * jnp.sin(0.6 * t)}


@pytest.mark.slow
def test_the_safe_part_of_a_shaken_well_is_that_of_a_fine_map():
    """Deviations from its saddle grow to twenty thousand times as much in each period."""
    period, box = TURN / 0.6, {"x": (-1.2, 1.5), "v_x": (-1.0, 1.0)}
    system, settle = Shaken(), Settle(30.0 * period, period, {"x": (-5.0, 5.0)})
    found = basins(system, system.state(), box, settle, points=(64, 64))
    shares = border_shares(system, found, settle)
    assert set(shares) == {"orbit 1", "left the limits"}
    assert shares["orbit 1"] == pytest.approx(found.shares["orbit 1"], abs=4e-3)


class Rough(Duffing):
    """The same with friction on the ground."""

    contact_directions: ClassVar = {"ground": {"x": 1}}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(0.02, 0.02), 1.0)}


@pytest.mark.slow
def test_the_border_has_another_attractor_on_either_side(monkeypatch):
    """Along all of it, with friction: nothing is the inverse of that motion."""
    curves = []
    follow = Manifold.follow

    def kept(self, *given):
        curves.append(follow(self, *given))
        return curves[-1]

    monkeypatch.setattr(Manifold, "follow", kept)
    system, settle = Rough(0.3, 0.1), Settle(40.0 * TURN, TURN)
    found = basins(system, system.state(), BOX, settle, points=(16, 16))
    shares = border_shares(system, found, settle)
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-12)
    lanes = Lanes(system, None, None, system.state())
    for curve in curves:
        at = np.linspace(1, len(curve) - 2, 100).astype(int)
        along = curve[at + 1] - curve[at - 1]
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        across *= 2e-6 / np.linalg.norm(across, axis=1, keepdims=True)
        sides = []
        for side in (-1.0, 1.0):
            sides.append(codes_from(lanes, settle, list(found.attractors), curve[at] + side * across))
        assert np.all(sides[0] != sides[1])
