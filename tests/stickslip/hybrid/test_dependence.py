"""What is read off a function while tracing: dependence on the time, and straight lines."""

import jax
import jax.numpy as jnp
import pytest

from stickslip.hybrid.dependence import AFFINE, NONE, OTHER, degrees

CASES = [
    (lambda t, y: 3.0, NONE, NONE),
    (lambda t, y: 2.0 * y["v"] - y["x"] / 4.0 + 1.0, NONE, AFFINE),
    (lambda t, y: 5.0 - t, AFFINE, AFFINE),
    (lambda t, y: y["x"] * y["v"], NONE, OTHER),
    (lambda t, y: jnp.sin(t), OTHER, OTHER),
    (lambda t, y: jnp.where(t > 1.0, 1.0, 0.0), OTHER, OTHER),
    (lambda t, y: jnp.where(jnp.asarray(True), y["x"], t), AFFINE, AFFINE),
    (lambda t, y: jnp.abs(y["x"]), NONE, OTHER),
    (lambda t, y: jnp.floor(t) + 0.0 * y["x"], OTHER, OTHER),
    (lambda t, y: 1.0 / y["x"], NONE, OTHER),
    (lambda t, y: jnp.dot(jnp.ones(2), jnp.stack([y["x"], y["v"]])), NONE, AFFINE),
    (lambda t, y: jnp.dot(y["x"] * jnp.ones(2), y["v"] * jnp.ones(2)), NONE, OTHER),
    (lambda t, y: jax.jit(lambda a: 2.0 * a)(y["x"]), NONE, AFFINE),
    (lambda t, y: jax.lax.cond(True, lambda a: a, lambda a: -a, y["x"]), NONE, AFFINE),
    (lambda t, y: jax.lax.cond(t > 0, lambda a: a, lambda a: -a, y["x"]), OTHER, OTHER),
    (lambda t, y: jax.lax.fori_loop(0, 3, lambda _, a: a + t, 0.0), OTHER, OTHER),
    (lambda t, y: jnp.asarray(jnp.asarray(t, jnp.int32), jnp.float64), OTHER, OTHER),
]


@pytest.mark.parametrize(("function", "in_time", "in_both"), CASES)
def test_degrees(function, in_time, in_both):
    y = {"x": jnp.asarray(1.0), "v": jnp.asarray(2.0)}
    assert degrees(function, (jnp.asarray(0.5), y), (True, False)) == [in_time]
    assert degrees(function, (jnp.asarray(0.5), y), (True, True)) == [in_both]
