"""Unknowns of any sign, within bounds, with priors: against closed forms of linear least squares."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.identification import (
    LevenbergMarquardt,
    Normal,
    Unknown,
    best,
    least_squares,
    many_starts,
    sensitivity,
)
from stickslip.identification._unknowns import scalars

RNG = np.random.default_rng(0)
SIGMA = 0.1
# Columns in the alphabetical order of the names.
MATRIX = RNG.normal(size=(30, 3))
NAMES = ("mass", "offset", "share")
TRUTH = np.array([90.0, -3.0, 0.3])
DATA = MATRIX @ TRUTH + SIGMA * RNG.normal(size=30)
UNKNOWNS = {
    "offset": Unknown(-1.0, unit="N"),
    "mass": Unknown(50.0, bounds=(0, None), unit="kg"),
    "share": Unknown(0.5, bounds=(0.0, 1.0)),
}


def residual(p):
    return (MATRIX @ jnp.stack([p[name] for name in NAMES]) - DATA) / SIGMA


def row(values):
    return np.array([float(values[name]) for name in NAMES])


@pytest.mark.more
def test_linear_model_has_the_closed_form():
    fit = least_squares(residual, UNKNOWNS, LevenbergMarquardt(tolerance=1e-15))
    exact = np.linalg.lstsq(MATRIX, DATA)[0]
    np.testing.assert_allclose(row(fit.values), exact, rtol=1e-9)
    covariance = SIGMA**2 * np.linalg.inv(MATRIX.T @ MATRIX)
    np.testing.assert_allclose(fit.covariance(), covariance, rtol=1e-7)
    np.testing.assert_allclose(row(fit.standard_errors()), np.sqrt(np.diag(covariance)), rtol=1e-7)
    np.testing.assert_allclose(fit.jacobian, MATRIX / SIGMA, rtol=1e-7)
    assert fit.units == {"mass": "kg", "offset": "N", "share": ""}
    assert fit.names == NAMES
    assert all(int(side) == 0 for side in fit.active_bounds.values())
    assert bool(fit.successful)


def test_prior_is_a_row_of_the_residual():
    """With a prior the estimate is that of the rows and the prior's row together."""
    mean, sd = -2.0, 0.005
    prior = UNKNOWNS | {"offset": Unknown(-1.0, prior=Normal(mean, sd))}
    fit = least_squares(residual, prior, LevenbergMarquardt(tolerance=1e-15))
    matrix = np.vstack([MATRIX / SIGMA, np.array([0.0, 1.0 / sd, 0.0])])
    exact = np.linalg.lstsq(matrix, np.append(DATA / SIGMA, mean / sd))[0]
    np.testing.assert_allclose(row(fit.values), exact, rtol=1e-9)
    np.testing.assert_allclose(fit.covariance(), np.linalg.inv(matrix.T @ matrix), rtol=1e-7)
    assert fit.residual.shape == (31,)
    np.testing.assert_allclose(fit.data_residual, residual(fit.values), atol=1e-9)
    # The unscaled value of the standard prior weighs: without it the offset is elsewhere.
    assert abs(exact[1] - np.linalg.lstsq(MATRIX, DATA)[0][1]) > 0.1


@pytest.mark.parametrize("bounds", [(None, None), (-4.0, None), (None, 7.0), (-4.0, 7.0), (0.0, None)])
@pytest.mark.parametrize("value", [0.25, 2.0, 6.9])
def test_coordinates_are_a_smooth_bijection(bounds, value):
    space, values = scalars("start", {"a": Unknown(value, bounds=bounds)})
    z = space.coordinates(values)
    assert float(space.values(z)["a"]) == pytest.approx(value, rel=1e-14)
    slope = jax.grad(lambda z: space.values(z)["a"])(z)
    assert float(slope[0]) == pytest.approx(float(space.slopes(values)[0]), rel=1e-12)
    far = space.values(jnp.array([[-30.0], [30.0]]))["a"]
    low, high = bounds
    assert low is None or float(jnp.min(far)) >= low
    assert high is None or float(jnp.max(far)) <= high


def test_a_bound_that_is_active():
    """The closed form without the bound is beyond it: the estimate lies at it, the rest is refitted."""
    start = UNKNOWNS | {"share": Unknown(0.7, bounds=(0.5, 1.0))}
    fit = least_squares(residual, start, LevenbergMarquardt(tolerance=1e-15, max_steps=200))
    assert {name: int(side) for name, side in fit.active_bounds.items()} == {
        "mass": 0, "offset": 0, "share": -1,
    }  # fmt: skip
    rest = np.linalg.lstsq(MATRIX[:, :2], DATA - 0.5 * MATRIX[:, 2])[0]
    np.testing.assert_allclose(row(fit.values), [*rest, 0.5], rtol=1e-5)


@pytest.mark.more
def test_positive_number_is_an_unknown_above_zero():
    t = jnp.linspace(0.0, 1.0, 20)

    def decay(p):
        return p["size"] * jnp.exp(-p["rate"] * t) - 3.0 * jnp.exp(-2.0 * t)

    plain = least_squares(decay, dict(size=1.0, rate=1.0))
    stated = least_squares(
        decay, dict(size=Unknown(1.0, (0, None)), rate=Unknown(1.0, bounds=(0, None)))
    )
    assert plain.values == stated.values
    np.testing.assert_array_equal(plain.sensitivity.matrix, stated.sensitivity.matrix)
    errors = plain.standard_errors()
    relative = plain.sensitivity.relative_standard_errors()
    assert float(errors["size"]) == float(relative["size"]) * float(plain.values["size"])


@pytest.mark.slow
def test_many_starts_and_vmap_of_unknowns():
    rows = {
        "offset": Unknown([-1.0, 2.0, 0.0]),
        "mass": Unknown([50.0, 10.0, 200.0], bounds=(0, None)),
        "share": Unknown([0.5, 0.2, 0.9], bounds=(0.0, 1.0)),
    }
    exact = np.linalg.lstsq(MATRIX, DATA)[0]
    found = many_starts(residual, rows, method=LevenbergMarquardt(tolerance=1e-15))
    assert bool(jnp.all(found.successful))
    for i, name in enumerate(NAMES):
        np.testing.assert_allclose(found.values[name], exact[i], rtol=1e-8)
    np.testing.assert_allclose(row(best(found).standard_errors()),
        SIGMA * np.sqrt(np.diag(np.linalg.inv(MATRIX.T @ MATRIX))), rtol=1e-6)  # fmt: skip
    each = jax.vmap(lambda u: least_squares(residual, u, LevenbergMarquardt(tolerance=1e-15)))(rows)
    np.testing.assert_allclose(each.values["offset"], exact[1], rtol=1e-8)
    assert each.covariance().shape == (3, 3, 3)


def test_sensitivity_by_an_unknown_of_any_sign():
    found = sensitivity(residual, UNKNOWNS)
    # By value over scale, by the logarithm, and by the logit of the share.
    np.testing.assert_allclose(found.matrix, MATRIX / SIGMA * [50.0, 1.0, 0.25], rtol=1e-12)


def test_bad_unknowns():
    for make, error, text in (
        (lambda: Unknown(2.0, (3.0, None)), ValueError, r"start = 2.0: it must be above bounds\[0\]"),
        (lambda: Unknown(2.0, (None, 2.0)), ValueError, r"start = 2.0: it must be below bounds\[1\]"),
        (lambda: Unknown(2.0, (3.0, 1.0)), ValueError, r"bounds = \(3.0, 1.0\): it must be a pair"),
        (lambda: Unknown(2.0, ("a", None)), TypeError, r"bounds\[0\] = 'a'"),
    ):
        with pytest.raises(error, match=text):
            make()
    with pytest.raises(ValueError, match=r"start\['a'\] = .* of shape \(2,\)"):
        least_squares(lambda p: p["a"][None], {"a": Unknown([1.0, 2.0])})


@pytest.mark.more
def test_a_fit_prints_its_estimates():
    t = jnp.linspace(0.0, 1.0, 20)
    data = 3.0 + 2.0 * t

    def residual(p):
        return (p["offset"] + p["slope"] * t - data) / 0.1

    unknowns = {"offset": Unknown(1.0, unit="N"), "slope": Unknown(0.5, bounds=(0.0, 1.5))}
    text = str(least_squares(residual, unknowns))
    # The slope stops at its bound; what is left is a straight line of rows, not noise.
    name, equals, value, _, error, unit = text.splitlines()[0].split()
    assert (name, equals, unit) == ("offset", "=", "N")
    np.testing.assert_allclose(float(value), 3.25, atol=1e-3)
    assert float(error) > 0
    assert text.splitlines()[1].startswith("slope = 1.")
    assert text.splitlines()[1].endswith("at its upper bound")
    assert " steps; reduced chi squared 2." in text.splitlines()[2]
    rows = {"a": jnp.array([0.5, 2.0, 3.0])}
    many = many_starts(lambda p: jnp.stack([p["a"] - 1.0, 0.0 * p["a"]]), rows)
    assert str(many).startswith("3 fits, 3 converged, lowest cost ")
