"""A step is a loop over its stages for one lane and written out for many: the same numbers."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

import stickslip as ss
from stickslip.hybrid._alone import alone_or_batched
from stickslip.hybrid.executor import COMPACT, FUSED, PORTABLE
from stickslip.hybrid.stepper import as_stepper
from stickslip.systems import CoulombOscillator, Motion

T, Y, H = 0.3, {"a": np.array([0.7, -0.2]), "b": np.array(1.1)}, 0.05
THETA = 1.3


def field(theta, t, y):
    """Any smooth field: every component depends on all of them, on time and on the parameter."""
    a, b = y["a"], y["b"]
    return {"a": jnp.sin(theta * t + b) * a[::-1] - a * b, "b": jnp.cos(a[0] * theta) - a[1] * t}


def textbook(theta, t, y, dy, h, a, b, c, weights):
    """The definition of an explicit Runge-Kutta step, to be used with numbers from elsewhere."""

    def along(rows, slopes):
        terms = [jax.tree.map(lambda k, w=w: h * w * k, k) for w, k in zip(rows, slopes, strict=False)]
        return jax.tree.map(lambda *parts: sum(parts[1:], parts[0]), *terms)

    slopes = [dy]
    for i in range(1, len(b)):
        stage = jax.tree.map(jnp.add, y, along(a[i][:i], slopes))
        slopes.append(field(theta, t + float(c[i]) * h, stage))
    y1 = jax.tree.map(jnp.add, y, along(b, slopes))
    slopes.append(field(theta, t + h, y1))
    return y1, slopes[-1], tuple(along(row, slopes) for row in weights)


RK4 = (
    [[], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]],
    [1 / 6, 1 / 3, 1 / 3, 1 / 6],
    [0.0, 0.5, 0.5, 1.0],
    [],
)
_SCIPY = scipy.integrate.DOP853
DOP853 = (
    _SCIPY.A.tolist(),
    _SCIPY.B.tolist(),
    _SCIPY.C.tolist(),
    [_SCIPY.E5.tolist(), _SCIPY.E3.tolist()],
)
METHODS = {"rk4": RK4, "dop853": DOP853}


def in_a_batch(function):
    def run(theta, t, y, dy, h):
        copies = jax.tree.map(lambda x: jnp.stack([jnp.asarray(x)] * 3), (theta, t, y, dy, h))
        return jax.tree.map(lambda x: x[1], jax.vmap(function)(*copies))

    return run


def arguments():
    return jax.tree.map(jnp.asarray, (THETA, T, Y, field(THETA, T, Y), H))


def close(found, expected, tolerance):
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance), found, expected
    )


@pytest.mark.more
@pytest.mark.parametrize("form", ["alone", "compact", "batch", "fused"])
@pytest.mark.parametrize("method", METHODS)
def test_a_step_and_its_derivatives_are_those_of_the_definition(method, form):
    stepper = as_stepper(method)
    execute = {"compact": COMPACT, "fused": FUSED}.get(form, PORTABLE)
    prepare = in_a_batch if form == "batch" else lambda function: function

    def stepped(theta, t, y, dy, h):
        return stepper.step(lambda t, y: field(theta, t, y), t, y, dy, h, execute)

    def reference(*arguments):
        return textbook(*arguments, *METHODS[method])

    given = arguments()
    value, rate = jax.jit(lambda *a: jax.jvp(prepare(stepped), a, a))(*given)
    expected, expected_rate = jax.jvp(reference, given, given)
    close(value[:2], expected[:2], 1e-14)
    close(value[2], expected[2], 1e-15)
    close(rate[:2], expected_rate[:2], 1e-13)

    if (method, form) == ("dop853", "batch"):
        return  # outside of a time loop the compiler fuses the twelve stages for minutes

    def end(y1, dy1):
        return (jax.tree.map(jnp.cos, y1), jax.tree.map(jnp.sin, dy1)), y1["b"] * 2.0

    def pulled(theta, t, y, dy, h):
        return stepper.vjp(field, theta, t, y, dy, h, end, execute)

    extra, bars = jax.jit(prepare(pulled))(*given)
    (y1, dy1), pull = jax.vjp(lambda *a: reference(*a, given[4])[:2], *given[:4])
    cotangents, expected_extra = end(y1, dy1)
    close(extra, expected_extra, 1e-14)
    close(bars, pull(cotangents), 1e-13)


@pytest.mark.more
def test_a_compact_step_can_be_differentiated_backwards():
    """Crossings of sections are landed on with such a step, outside of the written-out sweep."""
    stepper, given = as_stepper("dop853"), arguments()

    def total(step):
        return lambda *a: sum(jnp.sum(leaf) for leaf in jax.tree.leaves(step(*a)[:2]))

    def stepped(theta, t, y, dy, h):
        return stepper.step(lambda t, y: field(theta, t, y), t, y, dy, h, COMPACT)

    found = jax.grad(total(stepped), (0, 1, 2, 3, 4))(*given)
    expected = jax.grad(total(lambda *a: textbook(*a, *DOP853)), (0, 1, 2, 3, 4))(*given)
    close(found, expected, 1e-12)


def end_position(belt_speed):
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, belt_speed)
    return ss.simulate(block, 0.0, 30.0, Motion(x=0.0, v=belt_speed), "stick", throw=False).y1.x


DERIVATIVES = {
    "value": end_position,
    "jvp": lambda v: jax.jvp(end_position, (v,), (jnp.ones_like(v),))[1],
    "grad": jax.grad(end_position),
}


@pytest.mark.more
@pytest.mark.parametrize(
    "what", ["value", *(pytest.param(w, marks=pytest.mark.slow) for w in ("jvp", "grad"))]
)
def test_runs_alone_and_in_batches_agree(what):
    function, speed = DERIVATIVES[what], jnp.asarray(0.2)
    alone = jax.jit(function)(speed)
    for many in (jax.vmap(function), ss.map_lanes(function, executor="fused")):
        np.testing.assert_allclose(jax.jit(many)(jnp.stack([speed] * 3))[1], alone, rtol=1e-11)
    truth = 0.658436755 if what == "value" else 16.2232182593  # closed form, see the README
    np.testing.assert_allclose(alone, truth, rtol=1e-8)


def test_which_form_runs():
    def two_forms(x):
        def scaled(factor):
            return lambda multiply, x: {"out": factor * multiply(x)}

        return alone_or_batched(scaled(1.0), scaled(10.0), [(lambda y: x * y, (x,))], x)["out"]

    x = jnp.asarray(3.0)

    def rate(x):
        return jax.jvp(two_forms, (x,), (jnp.ones_like(x),))[1]

    def looped(x):
        return jax.lax.fori_loop(0, 2, lambda _, y: y + two_forms(x), 0.0 * x)

    assert jax.jit(two_forms)(x) == two_forms(x) == 9.0
    assert rate(x) == 6.0
    assert looped(x) == 18.0
    batch = jnp.stack([x, x])
    assert jax.vmap(jax.jit(two_forms))(batch).tolist() == [90.0, 90.0]
    assert jax.vmap(rate)(batch).tolist() == [60.0, 60.0]
    assert jax.jvp(jax.vmap(two_forms), (batch,), (batch,))[1].tolist() == [180.0, 180.0]
    assert jax.vmap(looped)(batch).tolist() == [180.0, 180.0]
    assert jax.lax.map(two_forms, batch).tolist() == [9.0, 9.0]


SIZES = """
import jax
import stickslip as ss
from stickslip.systems import BlockOnBelt, BlockState

def run(k3, **options):
    start = BlockState(0.0, 0.0, 0.0, 0.0)
    return ss.simulate(BlockOnBelt.constructed(k3=k3), 0.0, 12.0, start, **options)

def end(k3):
    return run(k3).y1

def turns(k3):
    found = run(k3, saveat=ss.SaveAt(sections=ss.Section(lambda system, t, y, dy, mode, args: y.vx)))
    return found.y1.x, found.crossings[0].t

def text(function):
    return jax.jit(function).lower(85.0).compile().as_text()

def size(function):
    return text(function).count(" = ")

print(size(end), size(jax.grad(lambda k3: end(k3).x)), size(turns))
"""


# Instructions as one function and, as with newer versions of JAX, portable: plain, in reverse, with a
# section. Operands and results of a call are instructions too.
LARGEST = {"auto": (2_050, 7_200, 4_000), "portable": (1_600, 5_600, 3_550)}


@pytest.mark.more
@pytest.mark.parametrize("executor", LARGEST)
def test_programs_of_a_smooth_system_are_small(executor):
    """Instructions that XLA leaves, compiled as for users: portable 1,543, 5,515, with a section 3,490.

    The text has as many lines again for the stack frames, which are no part of the program. By lines it
    was 13,155 and 67,008 with every stage written out, and 3,494 and 8,228 without tolerances that
    follow the size of the motion and without the flags. With a recorded section 3,091 before one that
    is affine in the state was looked at inside of steps, 800 more where a crossing took a step of its
    own after the search, 680 more with a bracket for zeros at which no step ends and a branch for calm.
    """
    # The suite leaves passes of XLA out, see conftest.
    as_users = {**os.environ, "XLA_FLAGS": "", "STICKSLIP_EXECUTOR": executor}
    run = subprocess.run(
        [sys.executable, "-c", SIZES], env=as_users, capture_output=True, text=True, check=True
    )
    sizes = map(int, run.stdout.split())
    assert all(size <= most for size, most in zip(sizes, LARGEST[executor], strict=True))
