"""Attractors and their basins, beside SciPy and closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip import plot
from stickslip.basin import (
    Judge,
    Settle,
    basins,
    basins_over,
    border_motion,
    border_shares,
    smallest_kick,
)
from stickslip.basin._attractor import Search, fixed_point_at
from stickslip.basin._border import _stays
from stickslip.basin._lanes import Lanes
from stickslip.basin._rests import still_between
from tests.stickslip.basin._systems import (
    BOX,
    MAGNETS,
    SHARES,
    Critical,
    Hill,
    MagneticPendulum,
    OnBelt,
    TwoWells,
    Wells,
    magnet,
    nearest,
    saddle_border,
    sliding_border,
    well,
)

SQUARE = {"x": (-2.0, 2.0), "v_x": (-2.0, 2.0)}


@pytest.fixture(scope="module")
def wells():
    return basins(Wells(), Wells().state(), SQUARE, Settle(100.0), points=(12, 12))


@pytest.mark.more
def test_each_start_comes_to_its_well(wells):
    x, v = np.asarray(wells.starts.x), np.asarray(wells.starts.v_x)
    place = [np.sign(float(a.motion.y.x)) for a in wells.attractors]
    assert sorted(place) == [-1, 1]
    assert np.all(wells.code >= 0)
    found = np.array(place)[wells.code]
    rng = np.random.default_rng(0)
    for i, j in rng.integers(0, 12, (40, 2)):
        assert found[i, j] == well(x[i, j], v[i, j]), (x[i, j], v[i, j])


def test_what_is_symmetric_has_symmetric_basins(wells):
    assert np.all(wells.code + wells.code[::-1, ::-1] == 1)
    assert wells.shares == {"fixed point 1": 0.5, "fixed point 2": 0.5}


def test_fixed_points_are_where_the_force_is_zero(wells):
    for attractor in wells.attractors:
        assert abs(abs(float(attractor.motion.y.x)) - 1.0) < 1e-12
        expected = -0.15 + 1j * np.sqrt(2.0 - 0.15**2)
        assert np.allclose(attractor.motion.eigenvalues, [expected, np.conj(expected)], rtol=1e-12)


def test_motions_enter_as_fast_as_they_decay(wells):
    """From the entry on, the linear motion is nearer than the radius: never before."""
    assert np.all((wells.entry > 0.0) & (wells.entry <= 100.0))
    radius = min(a.radius for a in wells.attractors)
    # The slowest decays with 0.15/s from a distance of about the size.
    assert np.max(wells.entry) < 3.0 * np.log(1.0 / radius) / 0.15


def test_between_two_wells_is_the_saddle(wells):
    saddle = border_motion(Wells(), wells, ("fixed point 1", "fixed point 2"), Settle(100.0))
    assert abs(float(saddle.y.x)) < 1e-12
    rates = -0.15 + np.array([1.0, -1.0]) * np.sqrt(0.15**2 + 1.0)
    assert np.allclose(saddle.eigenvalues, rates, rtol=1e-12)


def test_a_further_map_compiles_nothing(wells, compiled):
    compiled.clear()
    basins(Wells(0.4), Wells().state(), SQUARE, Settle(90.0), points=(12, 12))
    assert compiled == []


def test_points_of_sobol_and_grids_agree(wells):
    found = basins(Wells(), Wells().state(), SQUARE, Settle(100.0), points=256, known=wells.attractors)
    assert list(found.shares) == list(wells.shares)
    ends = zip(found.attractors, wells.attractors, strict=True)
    assert all(float(a.motion.y.x) == float(b.motion.y.x) for a, b in ends)
    assert abs(found.shares["fixed point 1"] - 0.5) < 3.0 * found.errors["fixed point 1"]


def test_a_point_whose_two_directions_of_decay_are_one():
    """At critical damping distances grow at first, and are halved twice later than the rate says."""
    found = basins(Critical(), Critical().state(), SQUARE, Settle(100.0), points=(8, 8))
    assert found.shares == {"fixed point 1": 1.0}
    (point,) = found.attractors
    assert np.allclose(point.motion.eigenvalues, -1.0, atol=1e-7)
    # The linear motion is x = (x0 + (v0 + x0) t) e^-t: far away until then.
    x, v, t = np.asarray(found.starts.x), np.asarray(found.starts.v_x), found.entry
    left = np.abs(np.array([x + (v + x) * t, v - (v + x) * t])) * np.exp(-t)
    assert np.all(np.max(left, axis=0) < 4.0 * point.radius)


def test_the_smallest_kick_leads_to_the_nearest_place_of_the_border(wells):
    by = {"x": 0.2, "v_x": 1.0}
    found = smallest_kick(Wells(), wells, Wells().state(x=1.0), by, Settle(100.0))
    expected = nearest(saddle_border(), np.array([1.0, 0.0]), np.array(list(by.values())))
    assert abs(found.size / expected - 1.0) < 1e-8
    assert found.error < 1e-14
    assert found.to == next(a.name for a in wells.attractors if float(a.motion.y.x) < 0.0)
    length = np.sqrt(sum((found.change[name] / size) ** 2 for name, size in by.items()))
    assert abs(length / found.size - 1.0) < 1e-12
    assert abs(float(found.y.x) - 1.0 - found.change["x"]) < 1e-15


@pytest.mark.more
def test_too_short_a_time_settles_nothing_and_says_so(wells):
    found = basins(Wells(0.01), Wells().state(), SQUARE, Settle(5.0), points=(4, 4))
    assert found.shares["not settled"] == 1.0
    assert np.all(np.isnan(found.entry))


def test_motions_that_leave_and_runs_that_fail():
    limits = Settle(20.0, limits={"x": (-1.5, 1.5)})
    found = basins(Wells(-0.1), Wells().state(), SQUARE, limits, points=(4, 4))
    assert set(found.shares) == {"left the limits"}
    # Beyond a hill the motion goes to infinity within the first of the times.
    found = basins(Hill(), Hill().state(), SQUARE, Settle(400.0, limits=limits.limits), points=(2, 2))
    assert found.code[1].tolist() == [-2, -2]
    assert set(found.failure.ravel()) == {""}
    few = ss.Integrator(max_steps=3)
    found = basins(Wells(), Wells().state(), SQUARE, Settle(20.0), points=(4, 4), integrator=few)
    assert set(found.shares) == {"failed"}
    assert set(found.failure.ravel()) == {"max_steps_reached"}


@pytest.mark.more
def test_a_start_on_top_of_the_hill_is_not_settled(wells):
    """Nothing moves there, and no motion comes to it."""
    found = basins(
        Wells(), Wells().state(), SQUARE, Settle(100.0), points=(3, 3), known=wells.attractors
    )
    assert found.code[1, 1] == -1
    assert list(found.shares) == ["fixed point 1", "fixed point 2", "not settled"]
    judge = Judge(Wells(), wells, Settle(100.0))
    assert int(judge(x=0.0, v_x=0.0)["code"]) == -1


def test_rest_in_either_well_is_one_set_if_friction_holds_between_them():
    at_rest = jax.jit(
        lambda friction, one: still_between(
            TwoWells(0.1, friction=friction), None, lambda row: TwoWells().state()._replace(x=row[0]),
            0.0, jnp.asarray(1, jnp.int32), jnp.array([one, 0.0]), jnp.array([1.0, 0.0]),
        )
    )  # fmt: skip
    assert TwoWells().mode_names[1] == "stick"
    assert [bool(at_rest(*given)) for given in ((0.05, -1.0), (0.05, 0.99), (0.39, -1.0))] == [
        False, True, True,
    ]  # fmt: skip


@pytest.mark.more
@pytest.mark.parametrize(
    ("friction", "count"),
    # Friction holds where the force of the wells is less: in one interval if it holds everywhere
    # between them, where the force has its maximum 2 / 27**0.5, otherwise in three.
    [(0.05, 3), (0.38, 3), (0.39, 1)],
)
def test_sets_of_rest_are_those_that_hang_together(friction, count):
    system = TwoWells(0.1, friction=friction)
    found = basins(system, system.state(), SQUARE, Settle(200.0), points=(16, 16))
    assert [a.kind for a in found.attractors] == ["rest"] * count
    ends = [float(a.motion.x) for a in found.attractors]
    assert all(abs(x - x**3) <= friction for x in ends)
    if count == 3:
        shares = {
            np.sign(round(x)): found.shares[a.name] for x, a in zip(ends, found.attractors, strict=True)
        }
        assert shares[-1.0] == shares[1.0]


@pytest.mark.more
def test_a_fixed_point_of_a_slip_that_friction_holds_is_none():
    """On a border it would be taken for the saddle: the mass sticks there."""
    system = TwoWells(0.1, friction=0.2)
    lanes = Lanes(system, None, None, system.state())
    search = Search(lanes, np.ones(2), np.full(2, np.inf), 10.0, None)
    modes = range(len(system.mode_names))
    found = [fixed_point_at(search, 0.0, np.array([0.2, 0.0]), mode) for mode in modes]
    unstable = [one for one in found if one is not None and one.rate > 0.0]
    assert unstable
    assert not any(_stays(lanes, 0.0, one) for one in unstable)


def test_numbers_that_are_none_are_no_fixed_point():
    class Root(Wells):
        def forces(self, t, q, v, args):
            return {"x": -jnp.sqrt(q.x) - v.x}

    lanes = Lanes(Root(), None, None, Root().state())
    search = Search(lanes, np.ones(2), np.full(2, np.inf), 10.0, None)
    assert fixed_point_at(search, 0.0, np.array([-1.0, 0.0]), 0) is None


@pytest.fixture(scope="module")
def on_belt():
    return basins(OnBelt(), OnBelt().state(), BOX, Settle(300.0), points=(24, 24))


@pytest.mark.more
def test_no_start_is_called_wrongly(on_belt):
    kinds = {a.name: a.kind for a in on_belt.attractors}
    assert sorted(kinds.values()) == ["fixed point", "orbit"]
    inside = sliding_border(1.5).contains_points(
        np.stack([np.ravel(on_belt.starts.x), np.ravel(on_belt.starts.v_x)], axis=1)
    )
    names = np.array([on_belt.names[code] for code in on_belt.code.ravel()])
    expected = np.where(inside, "fixed point 1", "orbit 1")
    assert np.all((names == expected) | (names == "not settled"))
    assert np.mean(names == "not settled") < 0.01


@pytest.mark.more
@pytest.mark.parametrize("belt", [pytest.param(1.25, marks=pytest.mark.slow), 1.5])
def test_the_border_is_the_unstable_orbit(belt, on_belt):
    """The shares of `spec/next.md` 3, of which eight digits are given."""
    system = OnBelt(belt)
    found = basins(system, system.state(), BOX, Settle(400.0), points=(8, 8))
    orbit = border_motion(system, found, ("fixed point 1", "orbit 1"), Settle(400.0))
    assert not bool(orbit.stable)
    shares = border_shares(system, found, Settle(400.0))
    assert abs(shares["fixed point 1"] - SHARES[belt]) < 3e-8


@pytest.mark.slow
def test_near_the_hopf_point_slow_motions_are_not_settled(on_belt):
    """At ln(10)/2 = 1.151 the fixed point loses its stability; it attracts with 9e-4/s here."""
    system = OnBelt(1.16)
    found = basins(system, system.state(), BOX, Settle(300.0), points=(24, 24))
    inside = sliding_border(1.16).contains_points(
        np.stack([np.ravel(found.starts.x), np.ravel(found.starts.v_x)], axis=1)
    )
    for code, within in zip(found.code.ravel(), inside, strict=True):
        kind = found.attractors[code].kind if code >= 0 else None
        assert kind in ((None, "fixed point") if within else (None, "orbit"))


@pytest.mark.more
def test_attractors_keep_their_names_over_a_parameter(on_belt):
    speeds = [1.5, 1.4, 1.3]
    found = basins_over(OnBelt(), "belt", speeds, OnBelt().state(), BOX, Settle(400.0), points=(16, 16))
    assert set(found.shares) <= {"fixed point 1", "orbit 1", "not settled"}
    sliding = found.shares["fixed point 1"]
    assert sliding[0] > sliding[1] > sliding[2]
    for speed, one in zip(speeds, found.maps, strict=True):
        place = next(a.motion.y.x for a in one.attractors if a.kind == "fixed point")
        assert abs(float(place) - 0.5 - 0.5 * np.exp(-2.0 * speed)) < 1e-12
    assert plot.shares(found).get_xlabel() == "belt"


def test_a_map_is_drawn_and_a_dataset(wells):
    axis = plot.basins(wells, Wells())
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("x [m]", "v_x [m/s]")
    data = wells.to_dataset(Wells())
    assert data.code.dims == ("x", "v_x")
    assert float(data.x[0]) == -2.0 + 2.0 / 12
    assert "fixed_point_1" in data.code.attrs["flag_meanings"].split()
    assert "fixed point 1: 0.5 +- 0.04" in str(wells)


@pytest.mark.more
def test_many_starts_in_a_store_are_judged_as_in_the_map(wells, tmp_path):
    """Two shares of the work, then the rest of it; the same as in one go, and as in the map."""
    judge = Judge(Wells(), wells, Settle(100.0))
    grid = judge.grid((12, 12))
    storage = ss.sweep.Storage(tmp_path / "a", chunk=36)
    half = ss.sweep.run_sweep(judge, grid, store=storage, labels=judge.labels, part=(0, 2))
    assert half.attrs["sweep_state"] != "finished"
    assert set(half.code.values.ravel()) == {-4, 0, 1}  # -1, "not settled", is for what was judged
    whole = ss.sweep.run_sweep(judge, grid, store=storage, labels=judge.labels)
    again = ss.sweep.run_sweep(judge, grid, labels=judge.labels)
    for name in ("code", "entry"):
        np.testing.assert_array_equal(whole[name], again[name])
    np.testing.assert_array_equal(whole.code, wells.code)
    np.testing.assert_array_equal(whole.entry, wells.entry)
    assert whole.code.dims == ("x", "v_x")
    np.testing.assert_allclose(whole.x, wells.starts.x[:, 0], rtol=0)
    np.testing.assert_allclose(whole.v_x, wells.starts.v_x[0], rtol=0)
    assert whole.code.attrs["flag_meanings"].startswith("fixed_point_1 fixed_point_2 not_settled ")
    told = ss.sweep.sweep_status(tmp_path / "a")["codes"]["code"]
    assert told == {f"fixed_point_{k + 1}": int(np.sum(wells.code == k)) for k in (0, 1)}
    judge = Judge(Wells(), wells, Settle(100.0, limits={"x": (-1.2, 1.2)}))
    left = ss.sweep.run_sweep(judge, {"start": np.arange(64)}, inputs=judge.spread(64))
    assert set(left.code.values) == {-2, 0, 1}


@pytest.mark.more
def test_a_border_is_refined_where_neighbours_differ(wells):
    judge = Judge(Wells(), wells, Settle(100.0))
    found = ss.sweep.refine_sweep(judge, judge.grid((12, 12)), {"code": 0}, levels=3)
    assert 144 < found.code.size < 0.5 * (11 * 2**3 + 1) ** 2
    place = [np.sign(float(a.motion.y.x)) for a in wells.attractors]
    fine = np.flatnonzero(found.level.values == 3)
    for lane in np.random.default_rng(0).choice(fine, 30, replace=False):
        x, v = float(found.x[lane]), float(found.v_x[lane])
        assert place[int(found.code[lane])] == well(x, v), (x, v)


@pytest.mark.more
def test_a_magnetic_pendulum_comes_to_rest_as_the_reference_does():
    """Fractal basins; the mirror image of a start comes to the mirror image of its magnet."""
    system, box = MagneticPendulum(), {"x": (-1.5, 1.5), "y": (-1.5, 1.5)}
    found = basins(system, system.state(), box, Settle(120.0), points=(24, 24))
    places = np.array([[float(a.motion.y.x), float(a.motion.y.y)] for a in found.attractors])
    assert len(places) == 3
    above = np.argmin(np.linalg.norm(places[:, None] - np.array(MAGNETS), axis=2), axis=1)
    code = above[found.code]
    assert np.all(found.code >= 0)
    assert np.array_equal(np.array([0, 2, 1])[code[:, ::-1]], code)
    for i, j in np.random.default_rng(0).integers(0, 24, (40, 2)):
        assert code[i, j] == magnet(found.starts.x[i, j], found.starts.y[i, j])


@pytest.mark.more
def test_many_starts_come_to_rests_and_fail():
    system = TwoWells(0.1, friction=0.38)
    found = basins(system, system.state(), SQUARE, Settle(200.0), points=(8, 8))
    judge = Judge(system, found, Settle(200.0))
    whole = ss.sweep.run_sweep(judge, judge.grid((8, 8)))
    np.testing.assert_array_equal(whole.code, found.code)
    judge = Judge(system, found, Settle(20.0), integrator=ss.Integrator(max_steps=3))
    few = ss.sweep.run_sweep(judge, {"start": np.arange(16)}, inputs=judge.spread(16))
    assert set(few.code.values) == {-3}
    assert np.all(np.isnan(few.entry))


@pytest.mark.more
def test_a_judge_names_what_it_does_not_know(wells):
    judge = Judge(Wells(), wells, Settle(100.0))
    with pytest.raises(ValueError, match=r"place.*all components of the box: x, v_x"):
        judge(x=1.0)
    with pytest.raises(ValueError, match=r"place.*'y'"):
        judge(x=1.0, v_x=0.0, y=2.0)
