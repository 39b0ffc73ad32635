"""Rows of parameters that are looked up: reverse derivatives by the fused executor, or the portable one."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import Motion

END, FORCE = 10.0, 4.0


class Pushed(ss.AbstractSmoothSystem):
    """A free mass under `FORCE` from `begin` to `end`."""

    begin: Any
    end: Any

    def vector_field(self, t, y, mode, args):
        inside = (t >= self.begin) & (t < self.end)
        return Motion(y.v, jnp.where(inside, FORCE, 0.0))


def test_reverse_derivatives_by_the_times_of_breaks_fuse():
    """Their look at the next break was an index, whose reverse derivative the compiler refuses."""

    def position(times):
        system = ss.WithBreaks(Pushed(*times), times)
        return ss.simulate(system, 0.0, END, system.start(Motion(0.0, 0.0)), throw=False).y1.y.x

    begin = np.linspace(0.5, 3.0, 16)
    times = np.stack([begin, begin + 2.0], axis=1)
    mapped = ss.map_lanes(jax.grad(position), executor="fused", workers=1)
    found = mapped(times)
    assert {executor for executor, *_ in mapped._compiled} == {"fused"}
    # x = F (e - b)^2 / 2 + F (e - b) (10 - e)
    np.testing.assert_allclose(found[:, 0], -FORCE * (END - begin), rtol=1e-9)
    np.testing.assert_allclose(found[:, 1], FORCE * (END - begin - 2.0), rtol=1e-9)


class Looked(ss.AbstractSmoothSystem):
    """A mass that moves at 1 m/s and collects what a row holds where it is."""

    row: Any

    def vector_field(self, t, y, mode, args):
        place = jnp.clip(jnp.floor(y.x), 0, 2).astype(jnp.int32)
        return Motion(jnp.ones_like(y.x), self.row[place])


def test_an_index_of_ones_own_is_differentiated_by_the_portable_executor():
    def collected(row):
        step = ss.Integrator("rk4", ss.FixedStep(0.25))
        start = Motion(0.1, 0.0)
        return ss.simulate(Looked(row), 0.0, 2.5, start, integrator=step, throw=False).y1.v

    rows = np.random.default_rng(0).normal(size=(16, 3))
    mapped = ss.map_lanes(jax.grad(collected), executor="fused", workers=1)
    with pytest.warns(UserWarning, match="portable executor"):
        found = mapped(rows)
    # 0.9 s in the first row, 1 s in the second, 0.6 s in the last; a step of 0.25 s may straddle.
    np.testing.assert_allclose(found, [[0.9, 1.0, 0.6]] * 16, atol=0.25)
    np.testing.assert_allclose(np.sum(found, axis=1), 2.5, rtol=1e-12)
