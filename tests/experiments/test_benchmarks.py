"""What the headline benchmark compares does the same job: C and plain C against SciPy."""

import dataclasses
import math

import numpy as np
import pytest

from experiments.benchmarks import latency, stick_slip
from experiments.benchmarks._c import CompilerAbsentError
from experiments.benchmarks._diagram_c import Build, runner
from experiments.benchmarks._diagram_job import Job, Points, errors, mild, set_a
from experiments.benchmarks._diagram_peers import scipy_dop853
from experiments.benchmarks._harness import Candidate, interleave, table


def by_c(build, job, k3):
    try:
        return runner(build, job, 2)(k3)
    except CompilerAbsentError as problem:
        pytest.skip(str(problem))


@pytest.mark.more
@pytest.mark.parametrize("case", [set_a(), mild()], ids=lambda case: case.name)
def test_c_takes_the_points_that_scipy_finds(case):
    # A quarter of the step: in set A the crossing lies where the block comes to stick, within 1 ms.
    job = Job(dataclasses.replace(case, h=case.h / 4), lanes=2, transient=1.0, duration=1.5)
    k3 = np.linspace(72.0, 97.0, 11)
    plain = by_c(Build(1, 1), job, k3)
    vector = by_c(Build(4, 2), job, k3)
    assert plain.count.min() >= 1
    assert max(errors(vector, plain)) < 1e-12
    some = slice(0, 11, 5)
    found = Points(*(a[some] for a in vector))
    exact = scipy_dop853(job, 1e-11)(k3[some])
    x, t = errors(found, exact)
    assert x < 1e-9
    assert t < 1e-8


def test_errors_need_equal_numbers_of_points():
    job = Job(mild(), lanes=3, room=2)
    one, other = job.empty(3), job.empty(3)
    one.x[:, 0] = one.t[:, 0] = 1.0
    other.x[:, 0], other.t[:, 0] = 1.0 + 1e-3, 1.0 - 2e-3
    one.count[:] = other.count[:] = 1
    assert errors(one, other) == pytest.approx((1e-3, 2e-3))
    other.count[1] = 0
    assert errors(one, other) == (math.inf, math.inf)


def test_ratios_are_to_the_first_and_scaled_by_the_share():
    calls = []
    candidates = [
        Candidate("first", lambda: calls.append(1)),
        Candidate("part", lambda: calls.append(2), 1e-9, share=0.5, rounds=1, error_t=1e-8),
    ]
    rows = interleave(candidates, 3)
    assert calls == [1, 2, 1, 2, 1, 1]
    assert rows[0]["ratio"] == 1.0
    text = table("title", rows, ["peer"])
    assert "1.0e-09   1.0e-08" in text
    assert "peer: absent, not measured" in text


@pytest.mark.slow
def test_latency_measures_every_part():
    lines = latency.main("quick").splitlines()
    sizes = {line[2:52].strip(): line.split()[-1] for line in lines if line.split()[-1].isdigit()}
    assert 1_000 < int(sizes["block on belt"]) < 5_400
    assert sum("import" in line for line in lines) == 4
    assert any("another process" in line for line in lines)


def test_c_written_for_stick_slip_keeps_all_events():
    speeds = np.linspace(0.2, 0.4, 64)
    try:
        found = stick_slip.by_c(speeds, 0.35, 1)()
    except CompilerAbsentError as problem:
        pytest.skip(str(problem))
    truth = [stick_slip.closed_form(v) for v in speeds]
    np.testing.assert_allclose(found, truth, rtol=0.0, atol=1e-9)
