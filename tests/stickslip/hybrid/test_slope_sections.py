"""Sections of an acceleration: two crossings within one step are both found.

An oscillator from x = 1 has the acceleration -cos t. It is below -0.999 for 0.0447 s on either side of
every whole turn, which is far shorter than a step.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss


class Motion(NamedTuple):
    x: float
    v: float


class Oscillator(ss.AbstractSmoothSystem):
    """Unit mass on a unit spring."""

    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, -y.x)


TURNS = 7
END = 2.0 * np.pi * TURNS + 1.0


def crossings(level, direction, method):
    """Times at which the acceleration goes through `-level`."""
    section = ss.Section(lambda system, t, y, dy, mode, args: dy.v + args, direction)
    integrator = ss.Integrator(method, ss.AdaptiveStep(1e-7))
    start = Motion(1.0, 0.0)
    run = ss.simulate(
        Oscillator(),
        0.0,
        END,
        start,
        args=level,
        saveat=ss.SaveAt(sections=(section,)),
        integrator=integrator,
    )
    return run.crossings[0].count, run.crossings[0].t


def exact(level, direction):
    turns = 2.0 * np.pi * np.arange(TURNS + 1)
    half = np.arccos(level)
    leaves, enters = turns + half, turns[1:] - half
    found = {"rising": leaves, "falling": enters, "both": np.concatenate([leaves, enters])}
    return np.sort(found[direction])


@pytest.mark.more
@pytest.mark.parametrize("method", ["dop853", "tsit5"])
@pytest.mark.parametrize("direction", ["rising", "falling", "both"])
def test_both_crossings_within_a_step_are_found(direction, method):
    count, times = crossings(0.999, direction, method)
    known = exact(0.999, direction)
    assert count == len(known)
    # A phase error of 1e-6 over the run.
    np.testing.assert_allclose(times[: len(known)], known, atol=3e-5)


@pytest.mark.more
def test_lanes_of_all_depths_have_all_their_crossings():
    levels = 1.0 - 10.0 ** np.linspace(-4.0, -0.5, 40)
    counts, _ = ss.map_lanes(lambda level: crossings(level, "both", "dop853"))(jnp.asarray(levels))
    np.testing.assert_array_equal(counts, 2 * TURNS + 1)


@pytest.mark.more
def test_derivative_of_a_crossing_that_a_look_inside_found():
    def third(level):
        return crossings(level, "both", "dop853")[1][2]

    slope = jax.grad(third)(0.999)
    # t = 2 pi + arccos(level)
    assert abs(slope * np.sqrt(1.0 - 0.999**2) + 1.0) < 1e-4
