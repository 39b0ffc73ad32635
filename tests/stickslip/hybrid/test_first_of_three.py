"""A guard that goes through zero, back and through zero again in one step fires at the first of them.

A block at rest on a moving belt, held by a spring, bears a tone too: what it bears creeps to the
threshold and passes it three times, all within a step as long as the time scale of the tone allows.
"""

from typing import Any, ClassVar, NamedTuple

import jax
import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss

END = 40.0
# Speed of the belt, threshold, phase of the tone; found by random search, all fired at the last zero.
CHOSEN = [
    (0.966964, 3.994211, 5.294063),
    (0.969463, 3.965968, 5.335023),
    (0.960181, 3.521668, 5.759299),
    (0.957030, 3.737453, 5.526535),
]


class Carried(NamedTuple):
    x: Any


class Pulled(ss.AbstractHybridSystem):
    """1 N/m pulls at what a belt carries on, until friction does not hold it."""

    speed: Any
    threshold: Any
    phase: Any

    mode_names: ClassVar = ("held", "lost")
    guard_names: ClassVar = ("gives way",)
    units: ClassVar = {"x": "m"}

    def vector_field(self, t, y, mode, args):
        return Carried(jax.numpy.where(mode == 0, self.speed, 0.0))

    def guards(self, t, y, mode, args):
        left = self.threshold - y.x - jax.numpy.sin(t + self.phase)
        return (jax.numpy.where(mode == 0, left, 1.0),)

    def transition(self, t, y, mode, guard, args):
        return y, jax.numpy.ones_like(mode)

    def initial_mode(self, t, y, args):
        return jax.numpy.zeros((), int)

    def time_scale(self, args):
        return 1.0


def zeros_of(speed, threshold, phase):
    """Times at which the block bears as much as friction can, in closed form but for the root."""

    def left(t):
        return threshold - speed * t - np.sin(t + phase)

    grid = np.linspace(0.0, END, 8001)
    changes = np.flatnonzero(np.diff(np.sign(left(grid))))
    return [brentq(left, grid[i], grid[i + 1], xtol=1e-14) for i in changes]


@pytest.mark.parametrize("method", ["dop853", "tsit5"])
def test_first_of_three_zeros_fires(method):
    truth = [zeros_of(*case) for case in CHOSEN]
    assert all(len(zeros) == 3 for zeros in truth)

    def first(speed, threshold, phase):
        run = ss.simulate(
            Pulled(speed, threshold, phase), 0.0, END, Carried(0.0), saveat=ss.SaveAt(max_events=1),
            integrator=ss.Integrator(method, ss.AdaptiveStep(1e-8)),
        )  # fmt: skip
        return run.events.t[0], run.flags

    times, flags = jax.jit(jax.vmap(first))(*np.array(CHOSEN).T)
    np.testing.assert_allclose(times, [zeros[0] for zeros in truth], atol=1e-9)
    assert not flags.any()


class Carriage(ss.AbstractSmoothSystem):
    """What is carried at constant speed; its tone is known to the section alone."""

    speed: Any
    units: ClassVar = {"x": "m"}

    def vector_field(self, t, y, mode, args):
        return Carried(self.speed + 0.0 * y.x)

    def time_scale(self, args):
        return 1.0


# Of these random loads a section that believed in one crossing a step recorded the last of three.
RECORDED = [
    (0.981332, 5.338964, 3.986117),
    (0.946143, 4.555651, 4.615846),
    (0.913134, 1.059637, 2.007298),
    (0.856600, 1.959806, 0.806757),
]


@pytest.mark.more
@pytest.mark.parametrize("method", ["dop853", "tsit5"])
@pytest.mark.parametrize(("direction", "chosen"), [("both", slice(3)), ("falling", slice(0, 3, 2))])
def test_a_section_records_all_three(method, direction, chosen):
    truth = np.array([zeros_of(*case) for case in RECORDED])[:, chosen]

    def recorded(speed, threshold, phase):
        section = ss.Section(
            lambda system, t, y, dy, mode, args: threshold - y.x - jax.numpy.sin(t + phase), direction
        )
        run = ss.simulate(
            Carriage(speed), 0.0, END, Carried(0.0), saveat=ss.SaveAt(sections=section),
            integrator=ss.Integrator(method, ss.AdaptiveStep(1e-8)),
        )  # fmt: skip
        return run.crossings[0].count, run.crossings[0].t[:3]

    count, times = jax.jit(jax.vmap(recorded))(*np.array(RECORDED).T)
    assert np.array_equal(count, [truth.shape[1]] * len(RECORDED))
    np.testing.assert_allclose(times[:, : truth.shape[1]], truth, atol=1e-8)
