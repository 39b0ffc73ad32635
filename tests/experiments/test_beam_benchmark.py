"""The beam's benchmark: its numba does the same job as the engine, and may be absent."""

import numpy as np
import pytest

from experiments.benchmarks import beam


def points(**changes):
    y = np.array([[1.0, 2.0, np.nan], [3.0, 4.0, 5.0]])
    return {"y": y, "sticks": np.array([1, 2]), **changes}


def test_errors_need_equal_numbers_of_points_and_sticks():
    assert beam.error(points(), points()) == 0.0
    assert beam.error(points(y=points()["y"] * 1.001), points()) == pytest.approx(1e-3)
    assert beam.error(points(sticks=np.array([1, 3])), points()) == np.inf
    assert beam.error(points(y=np.full((2, 3), np.nan)), points()) == np.inf
    one, other = ({"exponents": np.array([[0.1, a]])} for a in (-np.inf, -3.0))
    assert beam.error(one, other) == np.inf
    assert beam.error(other, {"exponents": np.array([[0.1, -3.5]])}) == 0.5


def test_without_numba_it_says_so(monkeypatch):
    monkeypatch.setattr(beam, "absent", lambda name: True)
    text = beam.comparison("title", beam.Job(2), lambda job, kind: lambda v: points(), None, 8, 1)
    assert "engine, fused" in text
    assert "numba: absent, not measured" in text


@pytest.mark.slow
def test_numba_finds_the_same_points():
    """Written apart, its own event search: also a check of the engine over 40 units of time."""
    pytest.importorskip("numba")
    job = beam.Job(8, transient=20.0, duration=21.62)
    found = beam.engine_diagram(job, "portable")(job.sample)
    truth = beam.numba_diagram(job.finer(8))(job.sample)
    assert (truth["sticks"] == 40).all()
    assert beam.error(found, truth) < 1e-11
    for name in "xw":
        np.testing.assert_allclose(found[name], truth[name], rtol=1e-7)


@pytest.mark.slow
def test_numba_finds_the_same_exponents():
    """With the saltation of stick and slip by hand: an independent value for a dry-friction system."""
    pytest.importorskip("numba")
    job = beam.Job(8, modes=4, transient=10.0, segments=40)
    found = beam.engine_exponents(job, "portable")(job.sample)
    truth = beam.numba_exponents(job)(job.sample)
    assert np.isneginf(truth["exponents"][:, -1]).all()
    assert (truth["exponents"][:, -2] < -0.3).all()
    assert beam.error(found, truth) < 1e-8
