"""Accuracy of the elementary functions against extended precision, and their derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip import _fastmath as fast

RANDOM = np.random.default_rng(20)
# Each operation outside of `jit` would be a program of its own.
exp, tanh, side_of = jax.jit(fast.exp), jax.jit(fast.tanh), jax.jit(fast.side_of)


def worst(value, reference):
    return float(np.max(np.abs(np.asarray(value).astype(np.longdouble) - reference)))


def test_exp_is_exact_over_its_range():
    z = np.concatenate(
        [
            RANDOM.uniform(-708.0, 709.0, 200_000),
            RANDOM.uniform(-1.0, 1.0, 200_000),
            # Half-way between two powers of two the rounding of the exponent may go either way.
            (np.arange(-1020, 1022) + 0.5) * np.log(2.0),
            np.nextafter((np.arange(-1020, 1022) + 0.5) * np.log(2.0), 0.0),
            -(10.0 ** RANDOM.uniform(-300, 2.8, 20_000)),
        ]
    )
    reference = np.exp(z.astype(np.longdouble))
    assert worst(np.asarray(exp(z)) / reference, 1.0) < 4e-16


@pytest.mark.parametrize(
    ("z", "value"),
    [
        (0.0, 1.0),
        (-0.0, 1.0),
        (-5e-324, 1.0),
        (-708.0, np.exp(-708.0)),
        (-1e308, np.exp(-708.0)),
        (-np.inf, np.exp(-708.0)),
        (709.0, np.exp(709.0)),
        (1e308, np.exp(709.0)),
        (np.inf, np.exp(709.0)),
        (np.nan, np.nan),
        (-np.nan, np.nan),
    ],
)
def test_exp_at_the_ends(z, value):
    found = exp(np.array([z, 0.0]))
    np.testing.assert_allclose(found[0], value, rtol=4e-16)
    assert found[1] == 1.0


def test_exp_in_single_precision():
    z = np.linspace(-80.0, 80.0, 1001, dtype=np.float32)
    value = exp(z)
    assert value.dtype == jnp.float32
    np.testing.assert_allclose(value, np.exp(np.asarray(z, np.float64)), rtol=2e-5)
    assert tanh(z).dtype == side_of(z).dtype == jnp.float32


def test_derivatives_of_exp_are_its_value():
    z = jnp.array([-700.0, -1.0, 0.0, 2.0, 300.0])
    value = exp(z)
    for derivative in (
        jax.grad(fast.exp),
        jax.jacfwd(jax.jacfwd(fast.exp)),
        jax.jacrev(jax.jacfwd(fast.exp)),
        jax.jacfwd(jax.jacrev(fast.exp)),
    ):
        np.testing.assert_array_equal(jax.jit(jax.vmap(derivative))(z), value)


def test_tanh():
    x = np.concatenate([RANDOM.uniform(-25.0, 25.0, 100_000), 10.0 ** RANDOM.uniform(-300, 300, 5000)])
    value = np.asarray(tanh(x))
    assert worst(value, np.tanh(x.astype(np.longdouble))) < 3e-16
    assert np.abs(value).max() == 1.0
    np.testing.assert_array_equal(tanh(-x), -value)
    assert tanh(0.0) == 0.0
    assert np.isnan(tanh(np.nan))
    slopes = jax.jit(jax.vmap(jax.grad(fast.tanh)))(x)
    assert worst(slopes, 1.0 / np.cosh(np.clip(x, -300, 300).astype(np.longdouble)) ** 2) < 5e-16
    first = jax.grad(fast.tanh)
    second = jax.grad(first)
    at_zero = jax.jit(lambda x: (first(x), second(x), jax.grad(second)(x)))(0.0)
    assert at_zero[:2] == (1.0, 0.0)
    np.testing.assert_allclose(at_zero[2], -2.0, rtol=1e-14)


def test_where_broadcasts_and_keeps_types():
    condition = jnp.array([True, False])
    value = fast.where(condition, 1.0, jnp.array([3.0, 4.0], dtype=jnp.float32))
    assert value.dtype == jnp.float32
    np.testing.assert_array_equal(value, [1.0, 4.0])
    assert fast.where(True, 1, 2).shape == ()


def test_side_of():
    np.testing.assert_array_equal(side_of(np.array([-2.0, -0.0, 0.0, 3.0])), [-1, 1, 1, 1])


@pytest.mark.more
@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("odd", [False, True])
def test_power_and_its_derivatives(exponent, odd):
    def power(base, exponent):
        return fast.power(base, exponent, jnp.array(odd))

    base, exponent = np.array([-2.0, -0.3, 0.7, 5.0]), jnp.array(exponent)
    sign = np.sign(base) if odd else np.ones(4)
    other_sign = np.ones(4) if odd else np.sign(base)

    def at(function):
        return jax.jit(jax.vmap(function, in_axes=(0, None)))(base, exponent)

    np.testing.assert_allclose(at(power), sign * abs(base) ** exponent, rtol=1e-14)
    first = at(jax.grad(power))
    np.testing.assert_allclose(first, other_sign * exponent * abs(base) ** (exponent - 1), rtol=1e-14)
    second = at(jax.jacfwd(jax.grad(power)))
    expected = sign * exponent * (exponent - 1) * abs(base) ** (exponent - 2)
    np.testing.assert_allclose(second, expected, rtol=1e-14)
    by_exponent = at(jax.grad(power, argnums=1))
    expected = sign * abs(base) ** exponent * np.log(abs(base))
    np.testing.assert_allclose(by_exponent, expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("exponent", "odd", "derivatives"),
    [(1.0, True, (1.0, 0.0, 0.0)), (2.0, False, (0.0, 2.0, 0.0)), (3.0, True, (0.0, 0.0, 6.0))],
)
def test_integer_powers_are_polynomials_through_zero(exponent, odd, derivatives):
    first = jax.grad(fast.power)
    second = jax.grad(first)
    functions = first, second, jax.grad(second), jax.grad(fast.power, argnums=1)
    found = jax.jit(lambda *at: [function(*at) for function in functions])(0.0, exponent, odd)
    np.testing.assert_array_equal(found, [*derivatives, 0.0])


def test_compiles_without_calls():
    """64 lanes, the size of the fused executor's chunks: everything must end up in line."""

    def step(z):
        return fast.exp(-z * z) + fast.tanh(z) * fast.side_of(z)

    program = jax.jit(step).lower(jnp.zeros(64)).compile().as_text()
    assert " call(" not in program
    assert "custom-call" not in program


@pytest.mark.parametrize(("fast_one", "exact"), [(fast.sin, np.sin), (fast.cos, np.cos)])
def test_sine_and_cosine(fast_one, exact):
    x = np.concatenate(
        [
            RANDOM.uniform(-1e6, 1e6, 200_000),
            RANDOM.uniform(-10.0, 10.0, 200_000),
            np.arange(-2000, 2000) * (np.pi / 4),
            np.nextafter(np.arange(-2000, 2000) * (np.pi / 4), 0.0),
            10.0 ** RANDOM.uniform(-300, 0, 5000),
        ]
    )
    assert worst(jax.jit(fast_one)(x), exact(x.astype(np.longdouble))) < 3e-16
    assert np.isnan(jax.jit(fast_one)(np.array([np.nan, np.inf, -np.inf]))).all()
    assert jax.eval_shape(fast_one, jnp.zeros(1, jnp.float32)).dtype == jnp.float32


def test_derivatives_of_sine_and_cosine():
    x = jnp.linspace(-30.0, 30.0, 101)
    first = jax.jit(jax.vmap(jax.grad(fast.sin)))(x)
    np.testing.assert_allclose(first, np.cos(x), atol=3e-16)
    second = jax.jit(jax.vmap(jax.jacfwd(jax.jacrev(fast.cos))))(x)
    np.testing.assert_allclose(second, -np.cos(x), atol=3e-16)
    assert float(jax.jit(fast.sin)(0.0)) == 0.0
