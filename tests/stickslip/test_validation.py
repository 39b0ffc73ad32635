"""Checks of arguments name the argument, its value and what is allowed."""

import doctest

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip import _validation as validation


def test_examples_of_the_docstring():
    assert doctest.testmod(validation).failed == 0


@pytest.mark.parametrize("value", [1.0, 2, np.array([0.5, 2.0]), jnp.array(3.0)])
def test_good_values_come_back_unchanged(value):
    assert validation.check_positive("mass", value) is value
    assert validation.check_nonnegative("mass", value) is value
    assert validation.check_finite("mass", value) is value
    assert validation.check_between("mass", value, 0.5, 3.0) is value
    assert validation.check_at_least("mass", value, "least", 0.5) is value


@pytest.mark.parametrize(
    ("check", "value", "message"),
    [
        (validation.check_positive, 0.0, r"^mass = 0\.0: it must be finite and positive\.$"),
        (validation.check_positive, np.inf, r"^mass = inf: it must be finite and positive\.$"),
        (validation.check_positive, [1.0, np.nan], r"^mass\[1\] = nan"),
        (validation.check_positive, jnp.array([[1.0, -2.0]]), r"^mass\[0, 1\] = -2\.0"),
        (validation.check_nonnegative, -1e-300, r"^mass = -1e-300: it must be finite and not neg"),
        (validation.check_nonnegative, np.nan, r"^mass = nan"),
        (validation.check_finite, -np.inf, r"^mass = -inf: it must be finite\.$"),
    ],
)
def test_bad_numbers_are_named(check, value, message):
    with pytest.raises(ValueError, match=message):
        check("mass", value)


def test_bounds_are_named():
    with pytest.raises(ValueError, match=r"^rho = 1\.5: it must be between 0\.0 and 1\.0 incl"):
        validation.check_between("rho", 1.5, 0.0, 1.0)
    with pytest.raises(ValueError, match=r"^t1 = 1\.0: it must be at least t0 = 2\.0\.$"):
        validation.check_at_least("t1", 1.0, "t0", 2.0)
    with pytest.raises(ValueError, match=r"^t1\[1\] = 1\.0: it must be at least t0 = 2\.0\.$"):
        validation.check_at_least("t1", np.array([3.0, 1.0]), "t0", 2.0)
    with pytest.raises(ValueError, match=r"^t1 = nan"):
        validation.check_at_least("t1", np.nan, "t0", 2.0)


def test_discrete_choices_are_listed():
    assert validation.check_in("kind", "tanh", ("tanh", "sqrt")) == "tanh"
    with pytest.raises(ValueError, match=r"^kind = 'cubic': it must be one of 'tanh', 'sqrt'\.$"):
        validation.check_in("kind", "cubic", ("tanh", "sqrt"))
    assert validation.check_type("law", 1.0, float, "a number") == 1.0
    with pytest.raises(TypeError, match=r"^law = 'Coulomb': it must be a friction law\.$"):
        validation.check_type("law", "Coulomb", (int, float), "a friction law")


@pytest.mark.parametrize("value", ["heavy", None, 1j, [1.0, [2.0]], object()])
def test_what_is_no_number_is_a_type_error(value):
    with pytest.raises(TypeError, match=r"^mass = .*it must be a real number"):
        validation.check_positive("mass", value)


def test_tracers_pass_unread():
    def traced(x):
        assert not validation.is_concrete({"a": [x, 1.0]})
        x = validation.check_positive("mass", x)
        return validation.check_at_least("mass", x, "least", 5.0)

    assert jax.jit(traced)(-1.0) == -1.0
    assert jax.grad(traced)(-1.0) == 1.0
    assert validation.is_concrete({"a": [jnp.ones(2), 1.0, "word", None]})


def test_concrete_values_are_read_inside_a_trace_too():
    with pytest.raises(ValueError, match=r"^mass = -1\.0"):
        jax.jit(lambda x: x * validation.check_positive("mass", -1.0))(1.0)


@pytest.mark.parametrize("value", [1, 2.0, np.float32(3.0), np.array([1, 2]), jnp.ones(3)])
def test_parameters_are_float64_arrays(value):
    parameter = validation.as_parameter(value)
    assert isinstance(parameter, jax.Array)
    assert parameter.dtype == jnp.float64
    np.testing.assert_array_equal(parameter, value)
