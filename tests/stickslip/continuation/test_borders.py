"""What a border between mode sequences is called, and when a branch has come round; by hand."""

import dataclasses
from types import SimpleNamespace
from unittest.mock import create_autospec

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.continuation import Follow, _family
from stickslip.continuation._along import Anchor, Problem
from stickslip.continuation._closing import Closure
from stickslip.continuation._corner import led_back
from stickslip.continuation._kinds import kind_of
from stickslip.continuation._orbit import PeriodicOrbit
from stickslip.continuation._point import Point
from stickslip.continuation._walk import _Watch, has_come_round
from stickslip.systems import JointedBeam

BEAM = JointedBeam.constructed(1e-3)  # slip backward, stick, slip forward, no contact


def point(modes, parameter=0.0, way=1.0, times=None):
    """An orbit of which only the modes, the parameter and its rate along the branch are known."""
    times = np.linspace(0.0, 0.9, len(modes)) if times is None else np.array(times)
    states = np.zeros((len(modes), 1))
    log = {"count": len(modes), "mode_after": np.array(modes), "guard": np.zeros(len(modes), int)}
    log["t"] = times
    events = SimpleNamespace(**log, y_before=states, y_after=states)
    orbit = object.__new__(PeriodicOrbit)
    object.__setattr__(orbit, "events", events)
    object.__setattr__(orbit, "period", jnp.ones(()))
    extent = np.ones(1)
    anchor = Anchor(None, 0.0, 1.0, None, extent, extent, extent, None, None)
    u, tangent = np.array([0.0, parameter]), np.array([1.0, way])
    closing = Closure(*[None] * 8)
    return Point(u, None, anchor, tangent, np.zeros((1, 2)), closing, 1, np.array([parameter]), orbit)


@pytest.mark.parametrize("turn", range(4))
def test_a_stick_in_a_slip_is_named_wherever_the_period_begins(turn):
    """Of slip, stick, slip, open the slip and its stick may be cut out, or the stick and its slip."""
    modes = [0, 1, 0, 3]
    many = point(modes[turn:] + modes[:turn])
    for few in ([0, 3], [3, 0]):
        assert kind_of(BEAM, many, point(few)) == "grazing-sliding"


def test_a_slip_in_a_stick_is_no_stick_in_a_slip():
    assert kind_of(BEAM, point([1, 0, 1, 3]), point([1, 3])) == "adding-sliding"


def test_of_a_stick_and_a_slip_the_shorter_one_is_new():
    few = point([1, 0])
    for turn in (0, 1):
        modes = [1, 0, 1, 0][turn:] + [1, 0, 1, 0][:turn]
        starts = {"stick": [0.1, 0.3, 0.6, 0.601], "slip": [0.1, 0.3, 0.301, 0.6]}
        for kind, times in starts.items():
            moved = times[turn:] + [1.0 + t for t in times[:turn]]
            name = {"stick": "grazing-sliding", "slip": "adding-sliding"}[kind]
            assert kind_of(BEAM, few, point(modes, times=moved)) == name


def points(ways):
    """Orbits near one parameter with these rates of it along the branch."""
    return [point([0, 3], 0.5 + 1e-3 * i, way) for i, way in enumerate(ways)]


def test_a_branch_that_has_not_turned_back_has_not_come_round():
    assert not has_come_round(points([0.01] * 12), 0.1)
    assert has_come_round(points([0.01] * 5 + [-0.01] * 5 + [0.01] * 2), 0.1)


def test_a_branch_does_not_lead_back_along_itself():
    """Another sequence, by an event of rounding, with the same orbits: no way on."""
    last = point([0, 1], way=0.0)
    behind, beyond = (
        dataclasses.replace(point([0, 1, 0, 1], way=0.0), u=np.array([x, 0.0])) for x in (-1e-6, 1e-6)
    )
    problem = object.__new__(Problem)  # nothing is asked of it
    assert led_back(problem, last, behind) is None
    assert led_back(problem, last, beyond)[0].tangent.tolist() == [1.0, 0.0]


def test_a_piece_without_length_has_no_special_point():
    """The sign that is remembered is that from before a border."""
    family = create_autospec(_family.AbstractFamily, instance=True)
    family.names, family.length.return_value = ("p",), 0.0
    family.tests.side_effect = lambda point: [_family.Test("BP", lambda point: float(point.values[0]))]
    family.others.side_effect = lambda leg, found: found
    family.zero.side_effect = lambda before, after, *_: after
    family.slope.side_effect = lambda point: np.ones(1)
    watch = _Watch(family, ((-2.0, 2.0),), Follow())
    low, high = (SimpleNamespace(values=np.array([x])) for x in (-1.0, 1.0))
    assert watch.on_leg(_family.Leg(low, low, 0.1)) == []
    assert watch.on_leg(_family.Leg(high, high, 0.0)) == []
    assert [event.label for event in watch.on_leg(_family.Leg(high, low, 0.1))] == ["BP"]


def test_a_value_beside_a_turn_that_is_not_found_is_named():
    """The parameter turns, nobody knows where: it may have passed the value there and back."""
    family = create_autospec(_family.AbstractFamily, instance=True)
    family.names, family.length.return_value = ("p",), 1.0
    family.tests.return_value = []
    family.others.side_effect = lambda leg, found: found
    family.slope.side_effect = lambda point: np.array([point.rate])
    family.onward.return_value = _family.Failure("not_converged")
    before, after = (SimpleNamespace(values=np.array([1.0]), rate=r) for r in (1.0, -1.0))
    watch = _Watch(family, ((-2.0, 2.0),), Follow(values=(1.1,)))
    (event,) = watch.on_leg(_family.Leg(before, after, 0.2))
    assert event.label == "UZ?"
    assert "it may turn between here and 1, not_converged" in event.words
    # Farther away than the parameter comes within the step there is nothing to say.
    watch = _Watch(family, ((-2.0, 2.0),), Follow(values=(1.9,)))
    assert watch.on_leg(_family.Leg(before, after, 0.2)) == []
