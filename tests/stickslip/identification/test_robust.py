"""Standard errors without trust in the stated noise, against noise whose law is known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import toeplitz

from stickslip.identification import (
    Observed,
    Problem,
    Record,
    Unknown,
    least_squares,
    load_fit,
    report,
)
from stickslip.identification._robust import long_run_covariance
from stickslip.systems import CoulombOscillator, Motion

T = np.linspace(0.0, 1.0, 1000)
SHAPES = np.stack([np.sin(20.0 * T), np.cos(20.0 * T), T * np.sin(20.0 * T)], axis=1)
TRUTH = np.array([1.0, 2.0, 3.0])
UNKNOWNS = {name: Unknown(1.0, (None, None), scale=1.0) for name in "abc"}


def coloured(rng, phi, count, size=1.0):
    """First-order noise from its stationary law, `[count, time]`."""
    steps = rng.normal(size=(count, T.size))
    found = [steps[:, 0] / np.sqrt(1.0 - phi**2)]
    for k in range(1, T.size):
        found.append(phi * found[-1] + steps[:, k])
    return size * np.stack(found, axis=1)


@jax.jit
@jax.vmap
def fitted(data):
    fit = least_squares(
        lambda p: jnp.asarray(SHAPES) @ jnp.stack([p[n] for n in "abc"]) - data, UNKNOWNS
    )
    both = [jnp.stack(list(fit.interval(0.95, robust).values())) for robust in (False, True)]
    return jnp.stack(both), jnp.stack([fit.covariance(False), fit.covariance(True)])


@pytest.mark.more
@pytest.mark.parametrize(("phi", "size"), [(0.0, 1.0), (0.0, 5.0), (0.5, 1.0), (0.9, 1.0), (0.0, 0.2)])
def test_intervals_hold_under_coloured_noise(phi, size):
    """Stated: white noise of 1. Of 400 fits the robust intervals hold 90 to 98.5%."""
    data = SHAPES @ TRUTH + coloured(np.random.default_rng(7), phi, 400, size)
    intervals, covariances = map(np.asarray, fitted(jnp.asarray(data)))
    held = np.mean((intervals[..., 0] <= TRUTH) & (TRUTH <= intervals[..., 1]), axis=(0, 2))
    if size < 1.0:  # noise below what is stated is taken as stated
        assert held.min() > 0.97
        return
    assert 0.90 < held[1] < 0.985
    assert held[0] < 0.75 or (phi, size) == (0.0, 1.0)
    # The exact covariance of the estimates by the law of the noise.
    bread = np.linalg.inv(SHAPES.T @ SHAPES)
    law = size**2 * toeplitz(phi ** np.arange(T.size)) / (1.0 - phi**2)
    exact = bread @ SHAPES.T @ law @ SHAPES @ bread
    variances = np.diagonal(covariances[:, 1].mean(axis=0))
    np.testing.assert_allclose(variances / np.diagonal(exact), 1.0, atol=0.2)


@pytest.mark.more
def test_long_run_covariance_of_white_scores_is_their_sum_of_squares():
    """The kernel is 1 at lag 0; beyond it white scores add up to nothing on average."""
    scores = np.random.default_rng(3).normal(size=(200, 50, 2))
    found = np.asarray(long_run_covariance(jnp.asarray(scores)))
    np.testing.assert_allclose(found / 10000.0, np.eye(2), atol=0.05)
    slow = np.full((1, 50, 1), 1.0)  # and of a constant, to the square of the sum, as far as 0.97 lets
    assert float(long_run_covariance(jnp.asarray(slow))[0, 0]) > 500.0


@pytest.fixture(scope="module")
def twice():
    """The same measurements under two names: twice the data for the stated noise, and no more news."""
    times = np.linspace(0.0, 6.0, 200)
    motion = np.where(times < 2.5, 0.2 * times, 0.5 + 0.0 * times)
    noise = 0.01 * np.random.default_rng(1).normal(size=times.size)
    rows = {name: motion + noise for name in ("one", "two")}

    def problem(*names):
        observed = {name: Observed(lambda t, y, system: y.x, 0.01, "m") for name in names}
        return Problem(
            lambda p, inputs: CoulombOscillator(1.0, p["k"], 1.0, 0.5, 0.2),
            lambda p, inputs: Motion(0.0, 0.2),
            {"k": 1.5},
            observed,
            Record(times, {name: rows[name] for name in names}),
        )

    with pytest.warns(UserWarning, match="reduced chi squared is 231"):
        one = problem("one").fit()
    with pytest.warns(UserWarning, match="above their noise"):
        return one, problem("one", "two").fit(), problem("one")


@pytest.mark.more
def test_channels_that_say_the_same_are_counted_once(twice, tmp_path):
    one, two, _ = twice
    stated = [float(fit.standard_errors()["k"]) for fit in (one, two)]
    robust = [float(fit.standard_errors(robust=True)["k"]) for fit in (one, two)]
    assert stated[1] == pytest.approx(stated[0] / np.sqrt(2.0), rel=1e-6)
    assert robust[1] == pytest.approx(robust[0], rel=0.02)
    read = load_fit(two.save(tmp_path / "fit.nc"))
    assert read.standard_errors(robust=True) == two.standard_errors(robust=True)
    assert read.grid == two.grid


@pytest.mark.more
def test_poor_fit_says_both(twice):
    """The motion of another machine: the stated errors are marked as such, and do not stand alone."""
    one, *_ = twice
    assert float(one.reduced_chi_squared) > 4.0
    robust, stated = (float(one.standard_errors(robust=r)["k"]) for r in (True, False))
    assert robust > 5.0 * stated
    assert f"+- {robust:.2g} (by the stated noise {stated:.2g})" in str(one)
    assert "robust" in one._repr_html_()
    assert f"{robust:.3g}" in str(report(one))


@pytest.mark.more
def test_bands_of_a_poor_fit(twice):
    """Of one unknown the band is as many times wider as its error; that of a measurement adds what the
    residuals are, not what was stated."""
    one, _, task = twice
    ratio = float(one.standard_errors(robust=True)["k"] / one.standard_errors()["k"])
    plain, robust = (task.predict(one, robust=r) for r in (False, True))
    widths = [found.upper["one"][50:] - found.mean["one"][50:] for found in (plain, robust)]
    assert np.max(widths[0]) > 0.0
    np.testing.assert_allclose(widths[1], ratio * widths[0], rtol=1e-9)
    measured = robust.measured_upper["one"][50:] - robust.mean["one"][50:]
    noise = 1.959964 * 0.01 * float(one.reduced_chi_squared) ** 0.5
    np.testing.assert_allclose(measured, np.hypot(widths[1], noise), rtol=1e-6)
