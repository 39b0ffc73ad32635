"""The smallest kick that changes a motion, beside borders that SciPy follows backwards in time."""

import numpy as np
import pytest

from stickslip.basin import Settle, basins, smallest_kick
from tests.stickslip.basin._systems import (
    BOX,
    OnBelt,
    TwoWells,
    Wells,
    nearest,
    rest_after,
    saddle_border,
    sliding_border,
)

SQUARE = {"x": (-2.0, 2.0), "v_x": (-2.0, 2.0)}


@pytest.fixture(scope="module")
def wells():
    return basins(Wells(), Wells().state(), SQUARE, Settle(100.0), points=(8, 8))


@pytest.mark.more
def test_a_kick_measured_in_equal_sizes(wells):
    by = {"x": 1.0, "v_x": 1.0}
    found = smallest_kick(Wells(), wells, Wells().state(x=1.0), by, Settle(100.0))
    expected = nearest(saddle_border(), np.array([1.0, 0.0]), np.ones(2))
    assert abs(found.size / expected - 1.0) < 1e-8


@pytest.mark.more
def test_a_kick_of_the_speed_alone(wells):
    found = smallest_kick(Wells(), wells, Wells().state(x=1.0), {"v_x": 1.0}, Settle(100.0))
    curves = saddle_border()
    speeds = []
    for curve in curves:
        t = np.linspace(0.0, 22.0, 200_001)
        x, v = curve(t)
        across = np.flatnonzero((x[1:] - 1.0) * (x[:-1] - 1.0) < 0.0)
        part = (1.0 - x[across]) / (x[across + 1] - x[across])
        speeds.extend(v[across] + part * (v[across + 1] - v[across]))
    assert abs(found.size / np.min(np.abs(speeds)) - 1.0) < 1e-7
    assert list(found.change) == ["v_x"]


@pytest.mark.more
def test_a_further_kick_compiles_nothing(wells, compiled):
    by = {"x": 1.0, "v_x": 1.0}
    first = smallest_kick(Wells(), wells, Wells().state(x=1.0), by, Settle(100.0))
    compiled.clear()
    again = smallest_kick(Wells(), wells, Wells().state(x=-1.0), by, Settle(100.0))
    assert compiled == []
    assert abs(again.size / first.size - 1.0) < 1e-9  # the mirror image


@pytest.mark.more
def test_friction_is_kicked_over_its_unstable_cycle():
    system = OnBelt()
    found = basins(system, system.state(), BOX, Settle(300.0), points=(8, 8))
    place = next(a.motion.y for a in found.attractors if a.kind == "fixed point")
    kick = smallest_kick(system, found, place, {"x": 1.0, "v_x": 1.0}, Settle(300.0))
    border = np.asarray(sliding_border(1.5).vertices)
    away = np.linalg.norm(border - np.array([place.x, place.v_x], float), axis=1)
    assert abs(kick.size / np.min(away) - 1.0) < 1e-6
    assert kick.to == "orbit 1"
    # A motion beside the cycle leaves it by a factor of 1.49 in 6.3 s: 1.8e8 in 300 s.
    assert 1e-9 < kick.error < 1e-6


@pytest.mark.more
def test_a_kick_that_ends_in_a_rest_that_the_map_has_not_found():
    """Friction holds on top of the hill too, in a strip that no start of a coarse map comes to."""
    system = TwoWells(0.1, friction=0.05)
    found = basins(system, system.state(), SQUARE, Settle(200.0), points=(8, 8))
    assert [a.name for a in found.attractors] == ["rest 1", "rest 2"]
    rest = found.attractors[0].motion
    kick = smallest_kick(system, found, rest, {"v_x": 1.0}, Settle(200.0))
    assert kick.to == "rest 3"
    x, way = float(rest.x), np.sign(kick.change["v_x"])
    for size, stays in ((1.0 - 1e-10, True), (1.0 + 1e-10, False)):
        end = rest_after(x, way * size * kick.size, 0.1, 0.05)
        assert (abs(end - x) < 0.5) == stays
        assert stays or abs(end) < 0.1
    for size in np.linspace(0.05, 0.99, 20):  # nor by any less, either way
        ends = [rest_after(x, sign * size * kick.size, 0.1, 0.05) for sign in (1.0, -1.0)]
        assert all(abs(end - x) < 0.5 for end in ends)


@pytest.mark.more
def test_kicks_that_change_nothing_and_wrong_arguments(wells):
    small = wells._replace(box={"x": (0.9, 1.1), "v_x": (-0.1, 0.1)})
    with pytest.raises(ValueError, match="none was found"):
        smallest_kick(Wells(), small, Wells().state(x=1.0), {"v_x": 1.0}, Settle(100.0))
    with pytest.raises(ValueError, match=r"by.*components of the box: x, v_x"):
        smallest_kick(Wells(), wells, Wells().state(x=1.0), {"y": 1.0}, Settle(100.0))
    with pytest.raises(ValueError, match=r"y0.*comes to an attractor"):
        smallest_kick(Wells(), wells, Wells().state(), {"v_x": 1.0}, Settle(100.0))
