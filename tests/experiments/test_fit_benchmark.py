"""The fit against SciPy's: the same optimum from fewer runs and in less time, compiling apart."""

import pytest

from experiments.benchmarks import fit


@pytest.mark.slow
def test_fewer_runs_and_less_time_than_finite_differences():
    told = fit.compare(10.0)
    best = told["best"]
    assert told["successful"]
    assert told["count"] >= 6
    assert best is not None
    assert best["runs"] >= 5 * told["steps"]
    assert best["seconds"] > told["seconds"]
    assert told["first"] > told["seconds"]
