"""Levenberg-Marquardt at bounds and in any units: SciPy's solver of bounded linear least squares."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

from stickslip.identification import LevenbergMarquardt, Unknown, least_squares

ENDS = ((None, None), (0.0, None), (None, 1.0), (-1.0, 2.0), (0.0, None), (0.5, 1.5))
NAMES = "abcdef"
STARTS = (0.3, 2.0, -1.0, 0.5, 1.0, 0.9)
COUNT = 120


def rows_of(p, matrix, data):
    return matrix @ jnp.stack([p[name] for name in NAMES]) - data


@pytest.fixture(scope="module")
def cases():
    """Problems of which most have an optimum at some bounds; columns of very different size."""
    rng = np.random.default_rng(11)
    matrix = rng.normal(size=(COUNT, 12, 6)) * 10.0 ** rng.uniform(-3, 3, (COUNT, 1, 6))
    truth = rng.normal(0.5, 1.0, size=(COUNT, 6))
    data = np.einsum("crk,ck->cr", matrix, truth) + rng.normal(0, 0.1, (COUNT, 12))
    return matrix, data


def test_optima_at_bounds_are_those_of_scipy(cases):
    matrix, data = cases
    unknowns = {
        name: Unknown(start, bounds=ends) for name, start, ends in zip(NAMES, STARTS, ENDS, strict=True)
    }

    def one(matrix, data):
        method = LevenbergMarquardt(tolerance=1e-13)
        return least_squares(lambda p: rows_of(p, matrix, data), unknowns, method)

    fits = jax.vmap(one)(matrix, data)
    low = [-np.inf if a is None else a for a, _ in ENDS]
    high = [np.inf if b is None else b for _, b in ENDS]
    at_bound = 0
    for i in range(COUNT):
        sizes = np.linalg.norm(matrix[i], axis=0)  # SciPy loses digits where columns differ in size
        known = scipy.optimize.lsq_linear(
            matrix[i] / sizes, data[i], (np.array(low) * sizes, np.array(high) * sizes), method="bvls"
        )
        at_bound += bool(np.any(known.active_mask))
        assert float(fits.cost[i]) <= known.cost * (1 + 1e-9) + 1e-12
        assert float(fits.cost[i]) >= known.cost * (1 - 1e-9) - 1e-12
    assert at_bound > COUNT // 2
    assert np.all(np.asarray(fits.successful))
    assert np.asarray(fits.steps).max() <= 40


def test_units_do_not_matter():
    """The same fit with the noise and one unknown in other units takes the same steps."""
    t = np.linspace(0.0, 3.0, 40)
    data = 2.0 * np.exp(-1.3 * t) + 0.01 * np.sin(37.0 * t)

    def fit(noise, unit):
        start = dict(a=Unknown(unit, bounds=(0.0, None)), rate=Unknown(0.2, scale=1.0))

        def residual(p):
            return (p["a"] / unit * jnp.exp(-p["rate"] * t) - data) / noise

        return least_squares(residual, start)

    here, there = fit(1.0, 1.0), fit(1e-9, 1e6)
    assert bool(here.successful)
    assert int(here.steps) == int(there.steps) <= 12
    assert float(there.values["a"]) / 1e6 == pytest.approx(float(here.values["a"]), rel=1e-9)


def test_what_came_near_a_bound_by_mistake_comes_back():
    """A start next to a bound where the optimum is not: steps are those of the value."""
    t = np.linspace(0.0, 3.0, 40)
    data = 2.0 * np.exp(-1.3 * t) + 0.5

    def residual(p):
        return p["a"] * jnp.exp(-p["rate"] * t) + p["level"] - data

    start = dict(
        a=Unknown(1e-3, bounds=(0.0, None)), rate=Unknown(1.0, bounds=(0.0, None)),
        level=Unknown(10.0 - 1e-9, bounds=(-10.0, 10.0)),
    )  # fmt: skip
    fit = least_squares(residual, start)
    found = [float(fit.values[name]) for name in ("a", "rate", "level")]
    np.testing.assert_allclose(found, [2.0, 1.3, 0.5], rtol=1e-6)


def test_a_step_that_was_refused_does_not_end_the_fit():
    """After refusals the step is short, but the cost has still to fall: Rosenbrock's valley."""

    def valley(p):
        return jnp.stack([100.0 * (p["y"] - p["x"] ** 2), 1.0 - p["x"]])

    for start in ((-1.2, 1.0), (-4.0, -3.0), (8.0, -50.0)):
        x, y = (Unknown(value, scale=1.0) for value in start)
        fit = least_squares(valley, dict(x=x, y=y), LevenbergMarquardt(max_steps=300))
        assert bool(fit.successful)
        assert float(fit.values["x"]) == pytest.approx(1.0, abs=1e-4)
