"""The reverse sweep over runs of one segment, of several, and of several chapters."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid import _adjoint
from stickslip.hybrid._pieces import in_pieces
from stickslip.hybrid.accuracy import ACCURACY
from stickslip.hybrid.executor import FUSED, PORTABLE
from stickslip.systems import BlockOnBelt, BlockState
from tests.stickslip.hybrid._accuracy import set_accuracy
from tests.stickslip.hybrid._systems import State, StickSlip, fixed
from tests.stickslip.hybrid.test_own_method import Doubling

P = jnp.array([0.2, 1.0, 0.5])


def results(p, max_steps, saveat=None):
    """End, time of an event and, if wanted, outputs of about 160 attempts with 6 events."""
    v, fs, fk = p
    integrator = ss.Integrator(step=fixed(0.25).step, max_steps=max_steps)
    run = ss.simulate(
        StickSlip(v, fs, fk), 0.0, 30.0, State(0.0 * v, v), 0, integrator=integrator,
        saveat=ss.SaveAt(max_events=8) if saveat is None else saveat, throw=False,
    )  # fmt: skip
    logged = [] if saveat is None else [run.outputs.y.x]
    found = jnp.concatenate([jnp.stack([run.y1.x, run.events.t[3], run.events.y_after.x[4]]), *logged])
    return jnp.where(jnp.isnan(found), 0.0, found)


# About 160 attempts on tapes of 16 rows: the third is more than four chapters of four segments.
@pytest.mark.more
@pytest.mark.parametrize(
    "max_steps", [301, *(pytest.param(n, marks=pytest.mark.slow) for n in (240, 4001))]
)
@pytest.mark.parametrize(
    "batch", [pytest.param(False, marks=pytest.mark.slow), True], ids=["alone", "batch"]
)
def test_segments_and_chapters(monkeypatch, max_steps, batch):
    """A limit on the attempts of its own makes each case a program of its own."""
    if max_steps != 301:
        set_accuracy(monkeypatch, tape_rows=16)
    parts = _adjoint.layout(max_steps, fused=False)
    assert parts.rows * parts.segments * parts.chapters >= max_steps
    assert parts.rows == (256 if max_steps == 301 else 16)
    saveat = ss.SaveAt(ts=jnp.linspace(1.0, 29.0, 29), max_rows=256)

    def end(p):
        return results(p, max_steps, saveat)

    reverse, forward = jax.jacrev(end), jax.jacfwd(end)
    if batch:
        speeds = jnp.stack([P, P.at[0].set(0.27), P.at[2].set(0.4)])
        found, expected = jax.jit(jax.vmap(reverse))(speeds), jax.jit(jax.vmap(forward))(speeds)
    else:
        found, expected = jax.jit(reverse)(P), jax.jit(forward)(P)
    assert jnp.all(jnp.isfinite(expected))
    assert jnp.max(jnp.abs(expected)) > 1.0
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_many_segments_of_fused_lanes(monkeypatch):
    set_accuracy(monkeypatch, tape_rows=32)
    speeds = jnp.linspace(0.2, 0.3, 5)

    def slope(v):
        return jax.grad(lambda v: results(P.at[0].set(v), 1500)[0])(v)

    def forward(v):
        return jax.jacfwd(lambda v: results(P.at[0].set(v), 1500)[0])(v)

    found = ss.map_lanes(slope, executor="fused")(speeds)
    np.testing.assert_allclose(found, jax.jit(jax.vmap(forward))(speeds), rtol=1e-9)


@pytest.mark.parametrize("max_steps", [1, 7, 255, 256, 257, 1024, 100_000, 3_000_000])
def test_the_memory_grows_with_the_root(max_steps):
    for fused in (False, True):
        parts = _adjoint.layout(max_steps, fused)
        assert parts.rows * parts.segments * parts.chapters >= max_steps
        assert parts.rows <= ACCURACY.tape_rows
        assert parts.rows % parts.block == 0
        assert parts.places <= 2 * np.sqrt(max_steps / ACCURACY.tape_rows) + 5
        numbers = np.arange(parts.segments * parts.chapters)
        last = numbers[-parts.segments :]
        # All starts of a chapter and of the chapters before it have places of their own.
        kept = np.asarray(
            parts.place(np.concatenate([numbers[: -parts.segments : parts.segments], last]))
        )
        assert len(set(kept.tolist())) == len(kept)
        assert kept.max() < parts.places - 1


def test_what_results_share_is_computed_once():
    """What is dear becomes a call of its own: the exponential is there once, in one of two calls."""

    def several(x, y):
        common = jnp.exp(jnp.sin(x) * y) / (1.0 + y)
        return {"a": common * x, "b": common + y, "c": (common - x) * y}, y

    x, y = jnp.linspace(0.1, 1.0, 8), jnp.linspace(1.0, 2.0, 8)

    def run(execute):
        return jax.jit(lambda x, y: in_pieces(execute, several)(x, y))

    expected = several(x, y)
    for execute in (FUSED, PORTABLE):
        found = run(execute)(x, y)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-15), found, expected)
    text = str(jax.make_jaxpr(lambda x, y: in_pieces(FUSED, several)(x, y))(x, y))
    assert text.count(" exp ") == 1
    assert text.count("jit[") + text.count("pjit[") == 2


@pytest.mark.slow
def test_thousands_of_steps_without_events():
    """The block on a belt in four segments, fused, against finite differences.

    Its steps are fixed: adaptive ones change with the last digit of the stiffness, and with them the
    derivative of the discrete motion by up to 2e-5, backwards as well as forwards.
    """
    rest = BlockState(0.0, 0.0, 0.0, 0.0)

    def end(k3):
        block = BlockOnBelt.constructed(k3=k3)
        return ss.simulate(block, 0.0, 1.0, rest, integrator=fixed(1e-3)).y1.x

    k3 = jnp.array([75.0, 85.0, 95.0])
    found = ss.map_lanes(jax.grad(end), executor="fused")(k3)
    value = ss.map_lanes(end)
    rough, fine = ((value(k3 + h) - value(k3 - h)) / (2 * h) for h in (2e-2, 1e-2))
    np.testing.assert_allclose(found, (4 * fine - rough) / 3, rtol=1e-7)


class _LogDecay(ss.AbstractSmoothSystem):
    """y' = -r y log y, that is log y = log y0 exp(-r t); a step far too long ends where no log is."""

    rate: Any

    def vector_field(self, t, y, mode, args):
        return -self.rate * y * jnp.log(y)


@pytest.mark.more
@pytest.mark.parametrize("batch", [False, True], ids=["alone", "batch"])
def test_rejected_steps_into_nan_leave_no_trace(batch):
    class Bold(Doubling):
        def initial(self, y, dy, scale):
            return jnp.asarray(0.5)

    def end(rate, y0):
        integrator = ss.Integrator(step=Bold(), max_steps=256)
        return ss.simulate(_LogDecay(rate), 0.0, 0.1, y0, integrator=integrator)

    rates, y0 = jnp.array([50.0, 40.0]), jnp.array([2.0, 3.0])
    slope = jax.grad(lambda *a: end(*a).y1, argnums=(0, 1))
    if batch:
        found = jax.jit(jax.vmap(slope))(rates, y0)
    else:
        found = jax.tree.map(lambda *a: jnp.stack(a), *map(jax.jit(slope), rates, y0))
    left = np.exp(-0.1 * rates)
    y1 = y0**left
    expected = -0.1 * left * np.log(y0) * y1, left * y1 / y0
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-7)
