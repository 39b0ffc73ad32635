"""Wrong arguments of loops, by name, before anything is compiled."""

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.control import PID, WithController, hunting_map
from tests.stickslip.control._axis import Axis, begin, under_pid

PID_100 = PID(50.0, 50.0, 10.0, period=0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"period": 0.0}, ["period = 0.0", "positive"]),
        ({"period": 0.02}, ["period = 0.02", "that of `update`, 0.01 s"]),
        ({"latency": 0.01}, ["latency = 0.01", "less than the period, 0.01 s"]),
        ({"latency": -1e-3}, ["latency = -0.001", "not negative"]),
        ({"delay": -1}, ["delay = -1"]),
        ({"delay": 0.5}, ["delay = 0.5"]),
        ({"offset": np.inf}, ["offset = inf"]),
        ({"system": 3}, ["system = 3", "AbstractHybridSystem"]),
        ({"update": 3}, ["update = 3", "update(k, t, measured, state, args)"]),
        ({"measure": lambda y: y}, ["measure = ", "measure(t, y, args)"]),
        ({"state": "a"}, ["state = 'a'"]),
    ],
)
def test_loops(arguments, words):
    right = {"system": Axis(), "update": PID_100, "period": 0.01, "state": PID_100.state()}
    with pytest.raises((TypeError, ValueError)) as found:
        WithController(**{**right, **arguments})
    assert all(word in str(found.value) for word in words), found.value


@pytest.mark.parametrize(
    ("update", "words"),
    [
        (lambda k, t, m, s, a: 0.0, ["update(...) = 0.0", "a pair, (output, state)"]),
        (lambda k, t, m, s, a: (0.0, (s, s)), ["update(...)[1] = "]),
        (lambda k, t, m, s, a: (0.0, jnp.zeros(2)), ["update(...)[1] = "]),
    ],
)
def test_updates_that_return_something_else(update, words):
    loop = WithController(Axis(), update, 0.01, 0.0)
    with pytest.raises((TypeError, ValueError)) as found:
        begin(loop)
    assert all(word in str(found.value) for word in words), found.value


def test_a_reading_that_is_no_pair_of_place_and_speed():
    loop = WithController(Axis(), PID_100, 0.01, PID_100.state(), measure=lambda t, y, args: y.x)
    with pytest.raises(TypeError, match=r"measured = .*a pair, \(x, v\): give `measure`"):
        begin(loop)


def test_states_that_are_none_of_the_loop():
    loop = under_pid()
    with pytest.raises(TypeError, match=r"y0 = .* a Controlled, as `start` makes it"):
        ss.simulate(loop, 0.0, 1.0, Axis().state(x=0.1))
    with pytest.raises(ValueError, match=r"y0.clock = 0.0: it must be that of a sample at 0.5037 s or"):
        ss.simulate(loop, 0.5037, 1.0, begin(loop))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"values": {}}, ["values = ", "arrays of one shape"]),
        ({"values": {"ki": [1.0], "kp": [1.0, 2.0]}}, ["values = ", "arrays of one shape"]),
        ({"component": "w"}, ["component = 'w'", "x"]),
        ({"duration": -1.0}, ["duration = -1.0", "positive"]),
        ({"resolution": 0.0}, ["resolution = 0.0", "positive"]),
        ({"loop": lambda ki: 3}, ["loop(...) = 3"]),
        ({"start": lambda system: 3}, ["start(...) = 3"]),
        ({"integrator": 3}, ["integrator = 3"]),
    ],
)
def test_maps(arguments, words):
    right = {
        "loop": lambda ki: under_pid(ki=ki), "values": {"ki": [1.0, 2.0]}, "start": begin,
        "duration": 1.0, "component": "x", "resolution": 1e-6,
    }  # fmt: skip
    with pytest.raises((TypeError, ValueError)) as found:
        hunting_map(**{**right, **arguments})
    assert all(word in str(found.value) for word in words), found.value
