"""A time loop of a single run as one function: the same numbers, and where it is left alone."""

import subprocess
import sys
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid.executor import FUSED, PORTABLE, SINGLE, use_executor
from stickslip.hybrid.one_call import LANES, OLDER
from stickslip.systems import CoulombOscillator, Motion

AT = jnp.array([1.1, 0.5, 0.2])


def motion(p, **options):
    block = CoulombOscillator(1.0, p[0], 1.0, p[1], p[2])
    return ss.simulate(block, 0.0, 12.0, Motion(x=0.0, v=p[2]), "stick", **options)


def found(p):
    run = motion(p)
    return run.y1, run.dy1, run.events.t, run.mode1


def end(p):
    return motion(p, saveat=ss.SaveAt(max_events=None)).y1.x


def calls(function, *operands):
    """How many calls of the traced program ask to be one function."""
    return jax.jit(lambda *a: function(*a)).lower(*operands).as_text().count("xla_cpu_small_call")


KINDS = {
    "run": (found, AT), "reverse": (jax.grad(end), AT), "forward": (jax.jacfwd(end), AT),
    "lanes": (jax.vmap(end), jnp.stack([AT, 1.1 * AT])),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_are_those_of_the_portable_program(kind):
    what, at = KINDS[kind]
    assert (calls(what, at) > 0) == OLDER
    one = jax.jit(lambda p: what(p))(at)
    with use_executor(PORTABLE):
        assert calls(what, at) == 0
        portable = jax.jit(lambda p: what(p))(at)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(portable), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-11)


class Stiffer(ss.AbstractSmoothSystem):
    """A spring that is twice as stiff beyond a place."""

    place: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-y.x - jnp.maximum(y.x - self.place, 0.0))


@pytest.mark.parametrize("executor", [SINGLE, FUSED], ids=["single", "fused"])
def test_slopes_where_a_force_bends(executor):
    """A third of the lanes met the bend to the last digit, and their slopes were no numbers."""
    places, t1 = jnp.linspace(0.3, 0.95, 16), 1.2

    def end(place):
        return ss.simulate(Stiffer(place), 0.0, t1, Motion(x=0.0, v=1.0)).y1.x

    def right(a):
        """x = sin t up to a, then a / 2 + (a / 2) cos w s + (v / w) sin w s, s later, w^2 = 2."""
        w, v = np.sqrt(2.0), jnp.sqrt(1.0 - a**2)
        s = t1 - jnp.arcsin(a)
        return a / 2 + a / 2 * jnp.cos(w * s) + v / w * jnp.sin(w * s)

    with use_executor(executor):
        ends, slopes = jax.jit(jax.vmap(lambda a: jax.jvp(end, (a,), (1.0,))))(places)
    met = places < np.sin(t1)
    np.testing.assert_allclose(ends, jnp.where(met, right(places), np.sin(t1)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        slopes,
        jnp.where(met, jax.vmap(jax.grad(right))(jnp.where(met, places, 0.5)), 0.0),
        rtol=0,
        atol=1e-8,
    )


def test_many_lanes_are_portable():
    lanes = jax.vmap(end)
    few, many = (jnp.tile(AT, (n, 1)) for n in (LANES, LANES + 1))
    assert (calls(lanes, few) > 0) == OLDER
    assert calls(lanes, many) == 0
    # Nested batches count together, whatever is traced in between.
    nested = jax.vmap(jax.jit(jax.vmap(end)))
    assert calls(nested, many[:64].reshape(8, 8, 3)) == calls(lanes, few)
    assert calls(nested, jnp.tile(AT, (9, 8, 1))) == 0


def test_the_environment_may_ask_for_portable_programs(monkeypatch):
    monkeypatch.setenv("STICKSLIP_EXECUTOR", "portable")
    assert calls(end, AT) == 0
    monkeypatch.setenv("STICKSLIP_EXECUTOR", "fastest")
    with pytest.raises(ValueError, match="STICKSLIP_EXECUTOR = 'fastest'"):
        end(AT)


class Decay(ss.AbstractHybridSystem):
    """Two and more components that decay, and a field that does something besides."""

    besides: Any = eqx.field(static=True)
    mode_names: ClassVar = ("only",)
    guard_names: ClassVar = ()

    def vector_field(self, t, y, mode, args):
        return -y + 1e-3 * self.besides(y)

    def guards(self, t, y, mode, args):
        return ()

    def transition(self, t, y, mode, guard, args):
        return y, mode

    def initial_mode(self, t, y, args):
        return 0


def solved(y):
    return jnp.linalg.solve(jnp.eye(y.size) + 0.1, y)


def told(y):
    return jax.pure_callback(np.sin, jax.ShapeDtypeStruct(y.shape, y.dtype), y)


LEFT_ALONE = {
    "LAPACK": (solved, 2), "Python": (told, 2), "products": (lambda y: jnp.outer(y, y) @ y, 2),
    "many numbers": (jnp.sin, 2000),
}  # fmt: skip


@pytest.mark.parametrize("kind", LEFT_ALONE)
def test_loops_that_the_compiler_does_not_take_are_portable(kind):
    besides, number = LEFT_ALONE[kind]
    step = ss.Integrator("rk4", ss.FixedStep(0.1), detect_dips=False)

    def decayed(y):
        return ss.simulate(Decay(besides), 0.0, 1.0, y, 0, integrator=step).y1

    start = jnp.linspace(0.5, 1.0, number)
    assert calls(decayed, start) == 0
    assert (
        calls(lambda y: ss.simulate(Decay(jnp.sin), 0.0, 1.0, y, 0, integrator=step).y1, start[:2]) > 0
    ) == OLDER
    np.testing.assert_allclose(decayed(start), start * np.exp(-1.0), rtol=0, atol=2e-3)


ABORTS = """
import jax
import jax.numpy as jnp
import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

QUICK = {"integrator": ss.Integrator("rk4", ss.FixedStep(0.1)), "saveat": ss.SaveAt(max_events=None)}

def end(v, args=None, **options):
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, v)
    return ss.simulate(block, 0.0, 8.0, Motion(x=0.0, v=v), "stick", args, throw=False, **options).y1.x

print(jax.jit(lambda: end(0.2, **QUICK))(), jax.grad(lambda a: end(0.2, {"unread": a}))(1.0))
print(jax.jit(lambda v: end(v, jnp.arange(3), **QUICK))(0.2))
"""


def test_constants_and_unread_operands_do_not_abort():
    """The compiler ends the process on a call with an operand that nothing in it depends on."""
    run = subprocess.run([sys.executable, "-c", ABORTS], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-500:]
    constant, slope, unread = map(float, run.stdout.split())
    assert slope == 0.0
    assert constant == pytest.approx(unread, abs=1e-13)
