"""The loop of Newton's method: where it ends, and that it is the same in NumPy and traced."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.continuation._newton import newton


def root(x, number):
    """Heron's step to the root of two; the error is that of the square."""
    x = 0.5 * (x + 2.0 / x)
    return x, abs(x * x - 2.0)


def test_the_steps_are_those_of_heron_in_numpy_and_traced():
    # From 1: 3/2, 17/12, 577/408 and 665857/470832, whose square is off by 4.5e-12.
    here = newton(root, np.float64(1.0), enough=1e-11, most=9)
    there = jax.jit(lambda x: newton(root, x, enough=1e-11, most=9, loop=jax.lax.while_loop))(1.0)
    for end in (here, there):
        assert int(end.steps) == 4
        assert bool(end.solved)
        assert float(end.carried) == pytest.approx(665857 / 470832, rel=4e-16)


def test_an_error_that_rounding_keeps_is_an_end_below_what_is_nearly_solved():
    def step(errors, number):
        return errors[1:], errors[0]

    falling = newton(step, [1e-3, 1e-7, 1e-11, 0.9e-11, 1e-30], enough=0.0, nearly=1e-6, most=5)
    assert falling.solved
    assert falling.steps == 4
    # Above it the same is no end: steps may be small although much is left.
    slow = newton(step, [1e-3, 1e-7, 1e-11, 0.9e-11, 1e-30], enough=0.0, nearly=1e-12, most=5)
    assert not slow.solved
    assert slow.steps == 5


@pytest.mark.parametrize("loop", ["numpy", "traced"])
def test_a_step_that_fails_ends_it_without_solution(loop):
    where = jnp.where if loop == "traced" else np.where
    extra = {"loop": jax.lax.while_loop} if loop == "traced" else {}

    def step(carried, number):
        return carried + 1.0, where(number == 2, np.nan, 1.0)

    end = newton(step, np.float64(0.0), enough=1e-9, nearly=1e-6, most=9, **extra)
    assert not end.solved
    assert int(end.steps) == 3
    assert float(end.carried) == 3.0
