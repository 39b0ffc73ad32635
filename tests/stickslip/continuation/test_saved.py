"""Branches in files: nothing is lost, and they go on where they ended."""

import json
from typing import Any

import jax
import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, load_branch, save_branch
from stickslip.systems import Motion as OtherState
from tests.stickslip.continuation._systems import Cycle, Motion, Radial, WeakeningBlock

pytestmark = pytest.mark.slow  # three programs are compiled

OPTIONS = {"follow": Follow(step=0.05, max_points=6)}
SYSTEM = Radial(0.5)


@pytest.fixture(scope="module")
def branch():
    guess = OrbitGuess(Cycle(1.5**0.5, 0.0), 2 * np.pi)
    return continue_orbit(SYSTEM, guess, "a", (0.1, 3.0), **OPTIONS)


@pytest.fixture(scope="module")
def path(branch, tmp_path_factory):
    return save_branch(branch, tmp_path_factory.mktemp("branch") / "branch.nc")


def same(one, other):
    """To the last bit, types too."""
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)


def test_a_branch_comes_back_as_it_was(branch, path):
    again = load_branch(path, SYSTEM, Cycle(0.0, 0.0))
    assert repr(again) == repr(branch)
    assert again.sequences == branch.sequences
    np.testing.assert_array_equal(again.values, branch.values)
    same(again.orbits.multipliers, branch.orbits.multipliers)
    same(again.orbits.y0, branch.orbits.y0)
    same(again.orbits.result, branch.orbits.result)
    for one, other in zip(again.specials, branch.specials, strict=True):
        assert one.index == other.index
        np.testing.assert_array_equal(one.slope, other.slope)
        same(one.orbit.monodromy, other.orbit.monodromy)


def test_the_slope_is_that_of_the_branch(branch):
    """Radius sqrt(1 + a), period 2 pi: rates by the parameter."""
    for end in branch["EP"]:
        x, y, period, a = end.slope
        radius = np.hypot(float(end.orbit.y0.x), float(end.orbit.y0.y))
        along = (x * float(end.orbit.y0.x) + y * float(end.orbit.y0.y)) / radius
        assert along / a == pytest.approx(0.5 / radius, rel=1e-6)
        assert period / a == pytest.approx(0.0, abs=1e-8)


def test_it_goes_on_beyond_its_end(branch, path):
    again = load_branch(path, SYSTEM, Cycle(0.0, 0.0))
    low, high = sorted(again["EP"], key=lambda end: end.value)
    assert (low.words, high.words) == ("bounds", "max_points")
    more = continue_orbit(SYSTEM, high, "a", (0.1, 3.0), **OPTIONS)
    assert more.values[0] == pytest.approx(high.value, abs=1e-12)
    assert (np.diff(more.values) > 0).all()
    radius = np.asarray(more.orbits.highest.x)
    np.testing.assert_allclose(radius, np.sqrt(1.0 + more.values), rtol=1e-6)
    assert np.asarray(more.orbits.multipliers)[:, 0] == pytest.approx(
        np.exp(-4.0 * np.pi * (1.0 + more.values)), abs=1e-9
    )


def test_the_file_is_a_dataset_by_itself(path):
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert json.loads(data.attrs["parameters"]) == ["a"]
        amplitude = data["amplitude_x"] / np.sqrt(1.0 + data["a"])
        np.testing.assert_allclose(amplitude, 1.0, rtol=1e-6)
        assert set(data["mode_sequence"].values) == {"motion"}


def test_other_files_and_states_are_refused(branch, path, tmp_path):
    with pytest.raises(ValueError, match=r"path = .*, no file: it must be a file of save_branch"):
        load_branch(tmp_path / "none.nc", SYSTEM, Cycle(0.0, 0.0))
    half = tmp_path / "half.nc"
    half.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ValueError, match=r"path = .*: it must be a file of save_branch"):
        load_branch(half, SYSTEM, Cycle(0.0, 0.0))
    other = tmp_path / "other.nc"
    xr.Dataset({"x": ("point", [1.0])}).to_netcdf(other, engine="h5netcdf")
    with pytest.raises(ValueError, match=r"path = .*: it must be a file of save_branch"):
        load_branch(other, SYSTEM, Cycle(0.0, 0.0))
    for state in (Motion(0.0, 0.0), OtherState(0.0, 0.0), Cycle(np.zeros(2), 0.0)):
        with pytest.raises(ValueError, match=r"y0 = .*: it must be a state with the components"):
            load_branch(path, SYSTEM, state)
    with pytest.raises(ValueError, match=r"system = 'a': it must be"):
        load_branch(path, WeakeningBlock(0.5, 0.5), Cycle(0.0, 0.0))
    with pytest.raises(TypeError, match="path = 1: it must be the path of a file"):
        save_branch(branch, 1)
    assert not list(tmp_path.glob("*.part"))


def test_an_interrupted_write_leaves_the_old_file(branch, path, monkeypatch):
    before = path.read_bytes()

    def broken(self, target, **options):
        target.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(xr.Dataset, "to_netcdf", broken)
    with pytest.raises(KeyboardInterrupt):
        save_branch(branch, path)
    assert path.read_bytes() == before
    assert [p.name for p in path.parent.iterdir()] == [path.name]


class Named(ss.AbstractSmoothSystem):
    r"""The cycle of `Radial`, whose size is a parameter with the name of a column."""

    period: Any
    label: Any = 0.0

    def vector_field(self, t, y, mode, args):
        return Radial(self.period + self.label).vector_field(t, y, mode, args)


@pytest.mark.parametrize("name", ["period", "label"])
def test_a_parameter_may_have_the_name_of_a_column(name, tmp_path):
    guess = OrbitGuess(Cycle(1.5**0.5, 0.0), 2 * np.pi)
    branch = continue_orbit(Named(0.5), guess, name, (-0.2, 0.6), follow=Follow(step=0.2, max_points=2))
    data = branch.to_dataset()
    np.testing.assert_array_equal(data[f"parameter_{name}"], branch.values)
    np.testing.assert_allclose(data["period"], 2 * np.pi, rtol=1e-9)
    again = load_branch(save_branch(branch, tmp_path / "named.nc"), Named(0.5), Cycle(0.0, 0.0))
    assert repr(again) == repr(branch)
    np.testing.assert_array_equal(again.values, branch.values)
