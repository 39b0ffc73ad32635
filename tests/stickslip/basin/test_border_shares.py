"""Shares by borders: stable manifolds backwards in time by SciPy, orbits, sets at rest, refusals."""

from typing import Any, ClassVar, NamedTuple
from unittest.mock import create_autospec

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.basin import Settle, _border, basins, border_shares
from stickslip.basin._border_shares import _Plane
from stickslip.basin._codes import NOT_SETTLED
from stickslip.basin._lanes import Lanes
from stickslip.mechanism import AbstractMechanism

from ._systems import Hill, OnBelt, TwoWells, Wells, saddle_border, share_at_the_right

BOX = {"x": (-2.0, 2.0), "v_x": (-2.0, 2.0)}
TILT = 0.1


class Driven(AbstractMechanism):
    """A pendulum that a torque keeps turning, or that hangs."""

    coordinates: ClassVar = {"x": "rad"}
    periods: ClassVar = {"x": 2.0 * np.pi}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 0.5 - jnp.sin(q.x) - 0.2 * v.x}


class Point(NamedTuple):
    x: Any
    y: Any


class Turning(ss.AbstractSmoothSystem):
    r"""$\dot r = \sigma r (r^2 - 1)$, $\dot\varphi = 1$: the unit circle is hardly unstable."""

    growth: Any = 0.05

    def vector_field(self, t, y, mode, args):
        growth = self.growth * (y.x**2 + y.y**2 - 1.0)
        return Point(growth * y.x - y.y, growth * y.y + y.x)


def test_a_border_that_is_hardly_unstable_is_enclosed_by_longer_motions(monkeypatch):
    """Beside it, at 0.3, motions come to their attractor the later the nearer they begin to it."""
    asked = []

    def codes_from(lanes, settle, attractors, rows):
        asked.append(settle.duration)
        away = rows[:, 0] - 0.3
        settled = np.abs(away) > np.exp(-settle.duration / 10.0)
        return np.where(settled, np.where(away < 0.0, 0, 1), NOT_SETTLED)

    monkeypatch.setattr(_border, "codes_from", codes_from)
    lanes = create_autospec(Lanes, instance=True)
    lanes.few.block = 128
    ends = np.zeros(1), np.ones(1)
    low, high, after = _border.border_between(lanes, Settle(70.0), [], ends, 0, lambda code: code == 1)
    assert after == 1
    assert low < 0.3 < high < low + 1e-11
    assert max(asked) > 250.0


@pytest.mark.more
def test_motions_that_stay_beside_a_border_for_long_are_followed_for_longer():
    """Off by a thousandth where the border is taken in the middle of what is not settled."""
    box, far = {"x": (-2.0, 2.0), "y": (0.0, 2.0)}, (-20.0, 20.0)
    settle = Settle(70.0, limits={"x": far, "y": far})
    found = basins(Turning(), Point(0.0, 0.0), box, settle, points=(16, 8))
    shares = border_shares(Turning(), found, settle)
    assert shares["fixed point 1"] == pytest.approx(np.pi / 16.0, abs=1e-9)
    assert shares["left the limits"] == pytest.approx(1.0 - np.pi / 16.0, abs=1e-9)


def share_of_the_right_well(damping):
    """Rows of the box are cut by the stable manifold of the saddle, where the well changes."""
    one, other = saddle_border(damping, TILT, 6.6 / damping)
    t = np.linspace(0.0, 6.6 / damping, 800_001)
    x, v = np.concatenate([other(t[::-1]), one(t)], axis=1)
    rows = np.linspace(-2.0, 2.0, 8001)
    cuts = [[] for _ in rows]
    number = (v + 2.0) / (rows[1] - rows[0])
    first = np.floor(number).astype(int)
    for i in np.flatnonzero(first[1:] != first[:-1]):
        for row in range(min(first[i], first[i + 1]) + 1, max(first[i], first[i + 1]) + 1):
            if 0 <= row < len(rows):
                part = (row - number[i]) / (number[i + 1] - number[i])
                cuts[row].append(x[i] + part * (x[i + 1] - x[i]))
    # The right end of the row at rest is the right well's or not, by how often the way there is cut;
    # that of another row by how often the edge between them is.
    middle, well = np.array(cuts[len(rows) // 2]), max(np.roots([-1.0, 0.0, 1.0, TILT]).real)
    at_right = np.sum((middle > well) & (middle < 2.0)) % 2 == 0
    at = np.flatnonzero((x[1:] > 2.0) != (x[:-1] > 2.0))
    edge = v[at] + (2.0 - x[at]) / (x[at + 1] - x[at]) * (v[at + 1] - v[at])
    widths = []
    for v, row in zip(rows, cuts, strict=True):
        between = np.sum((edge > min(v, 0.0)) & (edge < max(v, 0.0)))
        right = at_right == (between % 2 == 0)
        inside = np.sort([x for x in row if -2.0 < x < 2.0])[::-1]
        ends = np.concatenate([[2.0], inside, [-2.0]])
        widths.append(np.sum((ends[:-1] - ends[1:])[0 if right else 1 :: 2]))
    return np.trapezoid(widths, rows) / 16.0


@pytest.mark.more
@pytest.mark.parametrize("damping", [0.3, pytest.param(0.1, marks=pytest.mark.slow)])
def test_shares_of_two_wells_are_those_of_the_saddles_manifold(damping, compiled):
    system, settle = Wells(damping, TILT), Settle(40.0 / damping)
    found = basins(system, system.state(), BOX, settle, points=(16, 16))
    shares = border_shares(system, found, settle)
    right = next(a.name for a in found.attractors if a.motion.y.x > 0.0)
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-12)
    assert shares[right] == pytest.approx(share_of_the_right_well(damping), abs=1e-6)
    compiled.clear()
    assert border_shares(system, found, settle) == shares
    assert compiled == []
    # What leaves, by the map, must do so from the edge, too.
    code = found.code.copy()
    code[8, 8] = -2
    with pytest.raises(ValueError, match="left the limits"):
        border_shares(system, found._replace(code=code), settle)


@pytest.mark.more
@pytest.mark.parametrize(
    ("system", "box", "duration"),
    [
        pytest.param(TwoWells(0.3, TILT, friction=0.1), BOX, 100.0, marks=pytest.mark.slow),
        (Driven(), {"x": (-np.pi, np.pi), "v_x": (-3.0, 4.0)}, 200.0),
    ],
)
def test_shares_are_those_of_a_fine_map(system, box, duration):
    """With three sets of states at rest, two in wells and one on the hill, and on a cylinder."""
    settle = Settle(duration)
    found = basins(system, system.state(), box, settle, points=(64, 64))
    shares = border_shares(system, found, settle)
    for name, share in shares.items():
        assert share == pytest.approx(found.shares[name], abs=4e-3)


@pytest.mark.more
def test_what_escapes_over_a_hill_is_what_its_saddle_says():
    """Motions that go to infinity have left; the border by SciPy, backwards from the top."""
    box = {"x": (-1.2, 1.5), "v_x": (-1.0, 1.0)}
    system, settle = Hill(), Settle(300.0, limits={"x": (-5.0, 5.0)})
    found = basins(system, system.state(), box, settle, points=(16, 16))
    shares = border_shares(system, found, settle)

    def back(t, y):
        return [-y[1], y[0] - y[0] ** 2 + 0.1 * y[1]]

    def far(t, y):
        return 3.0 - np.max(np.abs(y))

    far.terminal = True
    rate, halves = np.min(np.roots([1.0, 0.1, -1.0])), []
    for side in (1e-8, -1e-8):
        end = solve_ivp(
            back, (0.0, 60.0), [1.0 + side, side * rate], method="DOP853", events=far,
            rtol=1e-12, atol=1e-13, dense_output=True,
        )  # fmt: skip
        halves.append(end.sol(np.linspace(0.0, end.t[-1], 200_001)))
    x, v = np.concatenate([halves[0][:, ::-1], halves[1]], axis=1)
    assert set(shares) == {"fixed point 1", "left the limits"}
    assert shares["left the limits"] == pytest.approx(share_at_the_right(x, v, box), abs=5e-7)


@pytest.mark.slow
def test_a_basin_inside_of_the_box_is_that_inside_of_the_orbit():
    """The whole of it: in a box twice as high its share is half as large."""
    system, settle = OnBelt(), Settle(300.0)
    wide, wider = ({"x": (-3.0, 3.0), "v_x": (-h, h)} for h in (3.0, 6.0))
    found = [
        border_shares(system, basins(system, system.state(), box, settle, points=(16, 16)), settle)
        for box in (wide, wider)
    ]
    assert found[0]["fixed point 1"] == pytest.approx(2.0 * found[1]["fixed point 1"], rel=1e-9)


class Saddle(_Plane):
    """A box about the saddle of x' = x, v' = -v, whose motions are closed forms."""

    def __init__(self):
        self.settle, self.limits = Settle(30.0), np.array([[-1.0, 1.0], [-1.0, 1.0]])

    def motion(self, place, t1):
        t = np.linspace(0.0, t1, 4001)
        return place * np.exp(np.outer(t, [1.0, -1.0]))


def test_a_border_goes_from_the_edge_to_its_saddle():
    arc = Saddle().border(np.array([0.0, 1.0]), np.array([1.0, 0.0]), left=0, right=1)
    np.testing.assert_allclose(arc.places[0], [0.0, 1.0], rtol=0)
    np.testing.assert_allclose(arc.places[-1], [0.0, 0.0], atol=1e-5)
    assert (arc.left, arc.right, arc.through) == (0, 1, False)


@pytest.mark.more
def test_what_is_no_plane_is_named():
    system, settle = Wells(), Settle(100.0)
    line = basins(system, system.state(v_x=0.0), {"x": (-2.0, 2.0)}, settle, points=8)
    with pytest.raises(ValueError, match=r"found = .* box of both numbers"):
        border_shares(system, line, settle)
