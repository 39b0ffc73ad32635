"""Forces that bend or jump without a comparison in their program: roots, cuts, poles, steep ones."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid.status import DISCONTINUOUS, GRAZING
from stickslip.systems import Motion


class Place(NamedTuple):
    x: Any


class Flow(ss.AbstractSmoothSystem):
    """x' = f(x), which takes the time of the integral of dx / f: dx(t)/dx(0) = f(x(t)) / f(x(0))."""

    rate: Any = eqx.field(static=True)

    def vector_field(self, t, y, mode, args):
        return Place(self.rate(y.x))


STARTS = np.array([-0.3, -0.05, 0.1, 0.19])


def ends(rate, **how):
    """Ends, slopes of these by the starts, and flags."""

    def end(x):
        run = ss.simulate(Flow(rate), 0.0, 0.5, Place(x), **how)
        return run.y1.x, run.flags

    along = jax.vmap(lambda x: jax.jvp(end, (x,), (jnp.ones(()),), has_aux=True))
    return jax.jit(along)(STARTS)


LOCATED = {
    "cube root": lambda x: 2.0 - jnp.cbrt(x - 0.2),
    "arccos": lambda x: 1.0 + jnp.arccos(jnp.clip(2.0 * x, -1.0, 1.0)),
    "arcsin": lambda x: 2.0 + jnp.arcsin(jnp.clip(2.0 * x, -1.0, 1.0)),
    "arccosh": lambda x: 1.0 + jnp.arccosh(1.0 + jnp.maximum(x - 0.2, 0.0)),
    "arctan2": lambda x: 2.0 + 0.3 * jnp.arctan2(x - 0.2, -0.3),
    "angle": lambda x: 2.0 + 0.3 * jnp.angle(jax.lax.complex(-0.3 + 0.0 * x, x - 0.2)),
    "wrapped": lambda x: 3.0 + 0.3 * jnp.arctan2(jnp.sin(10.0 * x + 1.0), jnp.cos(10.0 * x + 1.0)),
}


@pytest.mark.parametrize("name", LOCATED)
def test_what_has_a_border_is_located(name):
    """The jump of an angle was passed over: the slope was off by its whole size, without a flag."""
    x, slope, flags = ends(LOCATED[name])
    # Steps up to a border steeper than a root are so short that a crossing looks like a touch.
    assert not np.any(flags if name != "cube root" else flags & ~GRAZING)
    right = jax.vmap(LOCATED[name])(x) / jax.vmap(LOCATED[name])(STARTS)
    np.testing.assert_allclose(slope, right, atol=1e-8 if name in ("arctan2", "angle") else 5e-6)


SUDDEN = {
    "direction": lambda x: 2.0 - (x - 0.2) / jnp.sqrt((x - 0.2) ** 2),
    "steep": lambda x: 2.0 - jnp.tanh(1e9 * (x - 0.2)),
    "pole": lambda x: 2.0 - jnp.arctan(0.1 / (x - 0.2)),
}
SMOOTH = {
    "even": lambda x: 2.0 - jnp.tanh(50.0 * (x - 0.2)),
    "steep and seen": lambda x: 2.0 - jnp.tanh(1e4 * (x - 0.2)),
    "flat": lambda x: 2.0 - jnp.exp(-0.01 / (x - 0.2) ** 2),
    "peak": lambda x: 2.0 - 1.0 / (1.0 + 1e4 * (x - 0.2) ** 2),
}


@pytest.mark.parametrize("name", SUDDEN)
@pytest.mark.parametrize("tol", [1e-8, pytest.param(1e-10, marks=pytest.mark.more)])
def test_what_jumps_inside_a_step_is_flagged(name, tol):
    """Steps collapse onto it, and the slope is lost: 1, where it is 1/3."""
    how = ss.Integrator(step=ss.AdaptiveStep(tol, tol))
    x, slope, flags = ends(SUDDEN[name], integrator=how)
    rate = jax.vmap(SUDDEN[name])
    wrong = np.abs(slope - rate(x) / rate(STARTS)) > 0.1
    assert np.all(np.asarray(flags)[wrong] == DISCONTINUOUS)
    assert np.mean(wrong & (flags == DISCONTINUOUS)) > 0.5


@pytest.mark.parametrize("name", SMOOTH)
def test_what_steps_resolve_is_not(name):
    x, slope, flags = ends(SMOOTH[name])
    rate = jax.vmap(SMOOTH[name])
    assert not np.any(flags)
    np.testing.assert_allclose(slope, rate(x) / rate(STARTS), atol=3e-6)


class Drag(ss.AbstractSmoothSystem):
    """x'' = -x - c |v| v as for a motion in several directions, by the root of a sum of squares."""

    c: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-y.x - self.c * jnp.sqrt(y.v**2 + 1e-30) * y.v)


def test_a_drag_by_a_root_of_squares_is_smooth_enough():
    def end(c):
        run = ss.simulate(Drag(c), 0.0, 9.0, Motion(x=1.0, v=0.3))
        return run.y1.x, run.flags

    both = jax.jit(jax.vmap(lambda c: jax.jvp(end, (c,), (jnp.ones(()),), has_aux=True)))
    h = 1e-2
    x, slope, flags = map(np.asarray, both(0.3 + h * np.arange(-2.0, 3.0)))
    assert not np.any(flags)
    assert slope[2] == pytest.approx((8 * (x[3] - x[1]) - (x[4] - x[0])) / (12 * h), abs=1e-6)
