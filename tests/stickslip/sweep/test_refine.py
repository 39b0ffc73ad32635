"""Sweeps refined where neighbours differ: in memory, and in a store."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.__main__ import main
from stickslip.sweep import (
    SweepMismatchError,
    open_dataset,
    refine_sweep,
    run_sweep,
    sweep_status,
    verify_store,
)
from stickslip.sweep.evaluate import Evaluate
from stickslip.systems import CoulombOscillator, Motion
from tests.stickslip.sweep import _sweeps
from tests.stickslip.sweep._options import contents, options

PLAIN = options()


def sweep_of(path):
    """What the numbers of a store are: its data and records, without diaries and locks."""
    return {name: data for name, data in contents(path).items() if "manifest" not in name}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The store of one call that is left alone."""
    path = tmp_path_factory.mktemp("refined") / "store"
    _sweeps.refined(path)
    return path


@pytest.fixture
def never(monkeypatch):
    """No lane may be computed."""

    def refuse(self, block, read):
        raise AssertionError("a block was computed")

    return lambda: monkeypatch.setattr(Evaluate, "__call__", refuse)


@pytest.mark.more
def test_a_jump_of_one_parameter_is_enclosed():
    found = refine_sweep(
        lambda a: {"side": (a > jnp.pi).astype(int), "twice": 2.0 * a},
        {"a": np.linspace(10.0, 0.0, 6)}, {"side": 0}, levels=3, **PLAIN,
    )  # fmt: skip
    assert found.sizes == {"a": 9}
    assert found.indexes["a"].is_monotonic_increasing
    before = int(found.side.sum("a"))
    low, high = found.a.values[found.side == 0][-1], found.a.values[found.side == 1][0]
    assert low < np.pi < high
    assert high - low == 2.0 / 2**3
    assert before == int((found.a > np.pi).sum())
    np.testing.assert_array_equal(found.twice, 2.0 * found.a)
    assert found.level.values.max() == 3
    assert found.attrs["sweep_state"] == "finished"


def test_a_store_holds_what_memory_does(whole):
    alone, stored = _sweeps.refined(), open_dataset(whole)
    assert stored.drop_attrs().equals(alone.drop_attrs())
    assert stored.a.attrs == {"units": "m"}
    assert stored.height.dims == ("lane", "axis")
    inside = stored.a**2 + stored.b**2 < 0.64
    np.testing.assert_array_equal(stored.inside, inside)
    np.testing.assert_array_equal(np.isnan(stored.height).any("axis"), ~inside)
    assert np.bincount(stored.level)[0] == 20
    assert stored.attrs["sweep_state"] == "finished"
    assert stored.attrs["sweep_verified"] == "yes"
    # The steps are sweeps like any other, and the first is that of the grid.
    step = open_dataset(whole / "refined" / "0001")
    np.testing.assert_array_equal(step.a, stored.a[stored.level == 1])


def test_what_is_finished_costs_nothing_again_and_more_levels_go_on(whole, tmp_path, never):
    path = tmp_path / "store"
    few = _sweeps.refined(path, levels=1)
    more = _sweeps.refined(path, levels=2)
    assert few.drop_attrs().equals(more.isel(lane=more.level <= 1).drop_attrs())
    assert sweep_of(path) == sweep_of(whole)
    never()
    again = _sweeps.refined(path, levels=2)
    assert again.drop_attrs().equals(more.drop_attrs())
    assert _sweeps.refined(path, levels=1).drop_attrs().equals(few.drop_attrs())


def test_a_sweep_that_run_sweep_made_is_refined(tmp_path, monkeypatch):
    def lane(a):
        return {"x": a**2}

    path, grid, counted = tmp_path / "store", {"a": np.linspace(0.0, 1.0, 5)}, []
    first = run_sweep(lane, grid, **options(path)).load()
    evaluate = Evaluate.__call__

    def count(self, block, read):
        counted.append(block.lanes)
        return evaluate(self, block, read)

    monkeypatch.setattr(Evaluate, "__call__", count)
    found = refine_sweep(lane, grid, {"x": 0.2}, levels=1, **options(path))
    assert counted == [2]  # from 0.5 on x differs by more than 0.2 between neighbours
    np.testing.assert_array_equal(found.x, found.a**2)
    assert run_sweep(lane, grid, **options(path)).load().drop_attrs().equals(first.drop_attrs())
    assert counted == [2]
    with pytest.raises(SweepMismatchError, match=r"grid.a.size is 5 in the store, 4 now"):
        refine_sweep(lane, {"a": np.linspace(0.0, 1.0, 4)}, {"x": 0.2}, **options(path))


def test_another_refinement_of_the_store_is_refused_by_name(whole, tmp_path):
    path = tmp_path / "store"
    _sweeps.refined(path, levels=1)
    before = contents(path)
    with pytest.raises(SweepMismatchError, match=r"refined by something else: by.inside is 0.0 .* 0.5"):
        _sweeps.refined(path, tolerance=0.5)
    with pytest.raises(SweepMismatchError, match=r"settings.radius is 0.8 in the store, 0.7 now"):
        _sweeps.refined(path, radius=0.7)
    assert contents(path) == before
    changed = _sweeps.refined(path, radius=0.7, levels=1, resume=False)
    np.testing.assert_array_equal(changed.inside, changed.a**2 + changed.b**2 < 0.49)
    assert set(p.name for p in (path / "refined").iterdir()) == {"0001"}


def test_failures_are_refined_too():
    """The border of where a lane fails, with NaN in place of its number."""
    found = refine_sweep(
        lambda a: {"root": jnp.sqrt(a)}, {"a": np.array([-1.0, 1.0, 2.0])}, {"root": 10.0},
        levels=5, **PLAIN,
    )  # fmt: skip
    assert found.sizes == {"a": 8}
    failed = np.isnan(found.root.values)
    np.testing.assert_array_equal(failed, found.a < 0)
    assert found.a.values[failed].max() == -2.0 / 2**5


def test_more_points_than_are_allowed_end_it_with_a_word(tmp_path):
    def lane(a, b):
        return {"x": jnp.sin(1e6 * a + 7e5 * b)}

    grid = {"a": np.arange(3.0), "b": np.arange(4.0)}
    path = tmp_path / "store"
    words = r"level 2 wants 117 points, max_points = 100"
    with pytest.warns(RuntimeWarning, match=words):
        found = refine_sweep(lane, grid, {"x": 0.0}, max_points=100, **options(path))
    assert found.sizes == {"lane": 35}
    assert found.attrs["sweep_state"] == f"unfinished: {words}"
    assert open_dataset(path).attrs["sweep_state"] == f"unfinished: {words}"
    more = refine_sweep(lane, grid, {"x": 0.0}, levels=2, max_points=117, **options(path))
    assert more.sizes == {"lane": 117}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"grid": {"a": [0.0, 1.0], "b": [0.0, 1.0], "c": [0.0, 1.0]}}, "of one or two parameters"),
        ({"grid": {"a": [0.0]}}, "two or more numbers that increase"),
        ({"grid": {"a": [0.0, 1.0, 1.0]}}, "two or more numbers that increase"),
        ({"grid": {"a": [0.0, 2.0, 1.0]}}, "two or more numbers that increase"),
        ({"grid": {"lane": [0.0, 1.0]}}, "not called lane or level"),
        ({"by": {"y": 0}}, "of results of the function, which are 'on', 'x', 'z'"),
        ({"by": {"z": 0}}, "of a real result"),
        ({"by": {"on": 1}}, "below 1 for a result that is True or False"),
        ({"by": {"x": -1.0}}, r"by\['x'\] = -1.0"),
        ({"by": {"x": np.inf}}, r"by\['x'\] = inf"),
        ({"levels": -1}, "levels = -1"),
        ({"levels": 60}, "at most 52"),
        ({"max_points": 1}, "max_points = 1: it must be an integer of at least 2"),
    ],
)
def test_wrong_arguments_are_refused(change, words):
    def lane(a=0.0, **_):
        return {"x": a, "on": a > 0, "z": jax.lax.complex(a, a)}

    arguments = {"grid": {"a": [0.0, 1.0]}, "by": {"x": 0.0}, **change}
    with pytest.raises(ValueError, match=words):
        refine_sweep(lane, **arguments, **PLAIN)


def test_results_that_would_hide_ours_are_refused():
    with pytest.raises(ValueError, match="without results or axes called lane or level"):
        refine_sweep(lambda a: {"level": a}, {"a": [0.0, 1.0]}, {"level": 0.0}, **PLAIN)


def test_a_damaged_step_is_found_and_computed_again(whole, tmp_path):
    path = tmp_path / "store"
    assert _sweeps.refined(path, part=(0, 3)).attrs["sweep_state"] == "unfinished: 1 of 3 blocks"
    assert sweep_status(path)["refined"]["state"] == "unfinished: 1 of 3 blocks"
    _sweeps.refined(path)
    file = path / "refined" / "0002" / "data.zarr" / "height" / "c" / "1" / "0"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    name = "refined/0002/data.zarr/height/c/1/0"
    assert verify_store(path, repair=True) == [name]
    assert open_dataset(path).attrs["sweep_state"].startswith("unfinished: level 2, ")
    _sweeps.refined(path)
    assert verify_store(path) == []
    assert sweep_of(path) == sweep_of(whole)
    file.write_bytes(data)
    with pytest.raises(ValueError, match=r"0002' is damaged, data.zarr/height/c/1/0 is not as"):
        open_dataset(path)


def test_points_that_do_not_follow_from_the_results_are_not_shown(whole, tmp_path):
    path, other = tmp_path / "store", tmp_path / "other"
    _sweeps.refined(path, levels=1)
    _sweeps.refined(other, levels=1, radius=0.6)
    (path / "refined").rename(tmp_path / "aside")
    (other / "refined").rename(path / "refined")
    with pytest.raises(ValueError, match="do not follow from its results"):
        open_dataset(path)
    with pytest.raises(SweepMismatchError, match="holds another sweep: "):
        _sweeps.refined(path, levels=1)


def test_status_counts_all_levels(whole, capsys):
    status, found = sweep_status(whole), open_dataset(whole)
    assert status["lanes"] == status["lanes_finished"] == found.sizes["lane"]
    assert status["codes"]["inside"] == {
        "True": int(found.inside.sum()), "False": int((~found.inside).sum())
    }  # fmt: skip
    counts = np.bincount(found.level)
    assert status["refined"] == {
        "state": "finished",
        "levels_wanted": 2,
        "levels": [
            {"level": level, "lanes": counts[level], "lanes_finished": counts[level]}
            for level in (1, 2)
        ],
    }
    assert main(["status", str(whole)]) == 0
    assert f"level 2 of 2: {counts[2]} of {counts[2]} lanes\nrefinement fini" in capsys.readouterr().out


@pytest.mark.slow
def test_where_a_block_on_a_belt_begins_to_stick():
    """It swings around the slipping equilibrium F_k/k, and sticks from omega (x0 - F_k/k) = v_b on."""
    levels, shape = 4, (7, 6)
    grid = {"x0": np.linspace(0.45, 2.0, shape[0]), "belt_speed": np.linspace(0.1, 1.2, shape[1])}

    def lane(x0, belt_speed):
        block = CoulombOscillator(1.0, 4.0, 3.0, 2.0, belt_speed)
        start = Motion(x=x0, v=jnp.zeros(()))
        run = ss.simulate(block, 0.0, jnp.pi, start, saveat=ss.SaveAt(max_events=None), throw=False)
        return {"sticks": run.num_events > 0, "ok": run.successful}

    found = refine_sweep(lane, grid, {"sticks": 0, "ok": 0}, levels=levels, **PLAIN)
    assert found.ok.all()
    excess = 2.0 * (found.x0.values - 0.5) - found.belt_speed.values
    np.testing.assert_array_equal(found.sticks, excess > 0.0)
    places = [
        np.rint((found[name].values - axis[0]) / (axis[1] - axis[0]) * 2**levels).astype(int)
        for name, axis in grid.items()
    ]
    fine = [np.linspace(axis[0], axis[-1], (n - 1) * 2**levels + 1)
            for axis, n in zip(grid.values(), shape, strict=True)]  # fmt: skip
    there = np.zeros([axis.size for axis in fine], bool)
    there[tuple(places)] = True
    side = 2.0 * (fine[0][:, None] - 0.5) > fine[1]
    crossed = np.zeros(np.subtract(side.shape, 1), bool)
    for i, j in ((0, 1), (1, 0), (1, 1)):
        crossed |= side[:-1, :-1] != side[i : side.shape[0] - 1 + i, j : side.shape[1] - 1 + j]
    # Each of the finest cells that the line crosses has all its corners, and few others are there.
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        assert there[i : there.shape[0] - 1 + i, j : there.shape[1] - 1 + j][crossed].all()
    assert there.sum() < 6 * crossed.sum()
