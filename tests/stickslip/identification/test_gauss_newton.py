"""Gauss-Newton steps: one for a linear model, SciPy's optimum for others, none to nowhere."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

from stickslip.identification import GaussNewton, Unknown, least_squares, many_starts

TIMES = np.linspace(0.0, 4.0, 60)


def found(residual, unknowns, **options):
    return least_squares(residual, unknowns, GaussNewton(**options))


def test_a_linear_model_is_done_at_once():
    rng = np.random.default_rng(0)
    columns, data = rng.normal(size=(30, 3)), rng.normal(size=30)
    unknowns = {name: Unknown(5.0) for name in "abc"}
    fit = found(lambda p: columns @ jnp.stack([p["a"], p["b"], p["c"]]) - data, unknowns)
    true = np.linalg.lstsq(columns, data, rcond=None)[0]
    np.testing.assert_allclose([float(fit.values[k]) for k in "abc"], true, rtol=0, atol=1e-9)
    assert bool(fit.successful)
    assert int(fit.steps) <= 3


def decay(p):
    return p["size"] * jnp.exp(-p["rate"] * TIMES) + p["rest"]


@pytest.mark.parametrize("start", [(1.0, 0.2, 0.0), (3.0, 3.0, 1.0), (0.3, 8.0, -2.0)])
def test_the_optimum_is_that_of_scipy(start):
    noise = np.random.default_rng(1).normal(size=TIMES.size)
    data = np.asarray(decay({"size": 2.0, "rate": 0.9, "rest": 0.4})) + 0.05 * noise
    unknowns = {"size": start[0], "rate": start[1], "rest": Unknown(start[2])}
    fit = found(lambda p: (decay(p) - data) / 0.05, unknowns)
    names = list(unknowns)
    theirs = scipy.optimize.least_squares(
        lambda x: (np.asarray(decay(dict(zip(names, x, strict=True)))) - data) / 0.05,
        [2.0, 0.9, 0.4], xtol=1e-14, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    np.testing.assert_allclose([float(fit.values[k]) for k in names], theirs.x, rtol=1e-6)
    assert int(fit.steps) <= 20


def test_steps_that_go_too_far_are_halved():
    """atan(x) = 0: undamped steps from beyond 1.39 diverge."""
    fit = found(lambda p: jnp.arctan(p["x"])[None], {"x": Unknown(3.0)})
    assert bool(fit.successful)
    assert abs(float(fit.values["x"])) < 1e-6


def test_many_starts_take_it():
    rows = {"size": np.array([1.0, 2.0, 4.0]), "rate": np.array([0.3, 0.9, 2.0])}
    data = np.asarray(2.0 * np.exp(-0.9 * TIMES))
    fits = many_starts(
        lambda p: p["size"] * jnp.exp(-p["rate"] * TIMES) - data, rows, method=GaussNewton()
    )
    np.testing.assert_allclose(fits.values["rate"], 0.9, rtol=1e-7)
    assert np.all(fits.successful)
