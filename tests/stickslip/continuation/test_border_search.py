"""The last orbit before a border is found from ever nearer, on a branch made by hand."""

from typing import Any

import numpy as np
import pytest

from stickslip.continuation import PeriodicOrbit, _points
from stickslip.continuation._along import Anchor, Problem
from stickslip.continuation._closing import Closure
from stickslip.continuation._family import Failure
from stickslip.continuation._point import Candidate, Point
from stickslip.continuation._points import border


class Line:
    """Orbits on the parabola `y = bend x^2`; those beyond `edge` are of another kind or are not there.

    Newton's method begins on the tangent, and where that is beyond the edge, whose line is parallel to
    the second axis but for its `lean`, the motion has other events. From `passes` on an event has gone
    past the instant at which the period begins: the orbits are alike nevertheless. From `unseen` on an
    orbit is not reproduced.
    """

    def __init__(self, edge, bend=1.0, lean=0.3, other=True, passes=np.inf, unseen=np.inf):
        self.edge, self.bend, self.lean, self.other = edge, bend, lean, other
        self.passes, self.unseen, self.solved = passes, unseen, 0
        self.anchor = Anchor(*[None] * 9)

    def beyond(self, x, y):
        return x + self.lean * (y - self.bend * x * x) > self.edge

    def at(self, x) -> Candidate:
        kind = 2 if self.beyond(x, self.bend * x * x) else 1 if x > self.passes else 0
        told: Any = [None] * 6
        closing = Closure(*told, sequence=np.array([kind]), num_events=np.array([kind // 2]))
        tangent = np.array([1.0, 2.0 * self.bend * x])
        tangent = tangent / np.linalg.norm(tangent)
        u = np.array([x, self.bend * x * x])
        return Candidate(u, None, self.anchor, tangent, np.zeros((1, 2)), closing, 1, u[:1])

    def solve_ahead(self, problem, point, distance, way=None, like=None):
        self.solved += 1
        x, y = point.u + distance * (point.tangent if way is None else way)
        kinds = self.beyond(x, y) != self.beyond(x, self.bend * x * x)
        if kinds and like is None:
            return Failure("not_converged")
        found = self.at(x)
        if like is not None and (kinds or not found.begins_like(like)):
            return Failure("mode_differs")
        return found if self.other or found.closing.num_events == 0 else Failure("not_converged")

    def describe(self, problem, found):
        if found.u[0] > self.unseen:
            return Failure("not_reproduced")
        return Point(**vars(found), orbit=object.__new__(PeriodicOrbit))

    def alike(self, point):
        assert isinstance(point, Point)
        return int(point.closing.num_events[0]) == 0


@pytest.mark.parametrize("bend", [0.0, 1.0, -3.0])
@pytest.mark.parametrize("other", [True, False])
@pytest.mark.parametrize("edge", [0.0301, 1e-3, 0.0777, 3e-9])
def test_the_last_orbit_is_found_to_rounding_in_few_steps(monkeypatch, edge, other, bend):
    line = Line(edge, bend, other=other)
    last, at, solved = last_on(monkeypatch, line)
    assert edge - 3e-12 <= last.u[0] <= edge
    assert at == pytest.approx(edge, rel=0.02)
    assert solved <= 45


def test_an_event_that_passes_the_start_of_the_period_is_no_border(monkeypatch):
    last, _, solved = last_on(monkeypatch, Line(0.03, passes=0.01))
    assert 0.03 - 1e-10 <= last.u[0] <= 0.03
    assert solved <= 110


def test_the_last_orbit_is_one_that_is_reproduced(monkeypatch):
    last, _, _ = last_on(monkeypatch, Line(0.03, unseen=0.02))
    assert 0.02 - 3e-12 <= last.u[0] <= 0.02


def test_without_a_border_the_whole_way_is_gone(monkeypatch):
    last, at, _ = last_on(monkeypatch, Line(1.0))
    assert at == pytest.approx(0.1, rel=1e-9)
    assert isinstance(last, Point)


def last_on(monkeypatch, line):
    monkeypatch.setattr(_points, "solve_ahead", line.solve_ahead)
    monkeypatch.setattr(_points, "describe", line.describe)
    problem = object.__new__(Problem)  # nothing is asked of it
    last, at = border(problem, line.describe(problem, line.at(0.0)), 0.1, line.alike)
    return last, at, line.solved
