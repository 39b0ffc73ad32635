"""Operations that the compiler does not know in a fused loop: avoided, or left to portable code."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.sweep import lanes
from stickslip.systems import Motion

END, FORCE = 10.0, 4.0


class Pushed(ss.AbstractSmoothSystem):
    """A free mass under `FORCE` from `begin` to `end`."""

    begin: Any
    end: Any

    def vector_field(self, t, y, mode, args):
        inside = (t >= self.begin) & (t < self.end)
        return Motion(y.v, jnp.where(inside, FORCE, 0.0))


@pytest.mark.slow
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


class Coupled(ss.AbstractSmoothSystem):
    """Rows of masses on springs under a load: products of matrices, and what is added to them."""

    stiffness: Any

    def vector_field(self, t, y, mode, args):
        x, v = y
        return v, jnp.sin(t) - self.stiffness @ x - 0.1 * (self.stiffness @ v)


def test_products_of_matrices_fuse(monkeypatch):
    matrix = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])

    def end(speed):
        step = ss.Integrator("rk4", ss.FixedStep(0.1))
        start, kept = (jnp.zeros(3), speed * jnp.ones(3)), ss.SaveAt(max_events=None)
        run = ss.simulate(Coupled(matrix), 0.0, 2.0, start, integrator=step, saveat=kept, throw=False)
        return run.y1[0]

    speeds = np.linspace(-1.0, 1.0, 16)
    mapped = ss.map_lanes(end, executor="fused", workers=1)
    found = mapped(speeds)
    assert {executor for executor, *_ in mapped._compiled} == {"fused"}
    # Its four stages have eight products: few lanes are not worth the time of the compiler.
    monkeypatch.setattr(lanes, "fused_is_trusted", lambda: True)
    for count, chosen in ((4, "portable"), (64, "fused")):
        mapped = ss.map_lanes(end, workers=1)
        np.testing.assert_allclose(mapped(np.full(count, speeds[0])), count * [found[0]], rtol=1e-12)
        assert {executor for executor, *_ in mapped._compiled} == {chosen}

    def field(t, y):
        return [*y[3:], *(np.sin(t) - matrix @ y[:3] - 0.1 * matrix @ y[3:])]

    for speed, x in zip(speeds[::5], found[::5], strict=True):
        start = [0.0] * 3 + [speed] * 3
        right = solve_ivp(field, (0.0, 2.0), start, rtol=1e-10, atol=1e-12).y[:3, -1]
        np.testing.assert_allclose(x, right, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    "words",
    ["Unhandled opcode for elemental IR emission: scatter", "Fusion kind not implemented on CPU"],
)
def test_what_no_chunk_avoids_is_computed_by_the_portable_executor_at_once(monkeypatch, words):
    seen, compiled_program = [], lanes.compiled_program

    def refuse(traced, lowered, devices):
        fused = "xla_cpu_small_call" in lowered.as_text()
        seen.append(fused)
        if fused:
            raise jax.errors.JaxRuntimeError(f"UNIMPLEMENTED: {words}")
        return compiled_program(traced, lowered, devices)

    def position(begin):
        step = ss.Integrator("rk4", ss.FixedStep(0.5))
        pushed = Pushed(begin, END + 1.0)
        start = Motion(0.0, 0.0)
        return ss.simulate(pushed, 0.0, END, start, integrator=step, throw=False).y1.v

    monkeypatch.setattr(lanes, "compiled_program", refuse)
    mapped = ss.map_lanes(position, executor="fused", workers=1)
    with pytest.warns(UserWarning, match="portable executor"):
        found = mapped(np.zeros(64))
    assert seen == [True, False]
    np.testing.assert_allclose(found, FORCE * END, rtol=1e-12)
