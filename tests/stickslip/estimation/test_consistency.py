"""Filter and smoother against simulated truths: many runs, and a cloud of particles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from stickslip.estimation import Gaussian, Noise, kalman_filter, smooth
from tests.stickslip.estimation._machines import Pushed, place
from tests.stickslip.estimation._truth import draw, kicks_of, wander

SD = 1e-4  # of the start, of measurements, and of what the force wanders in a second


def filtered(system, mean, t, x):
    spread = system.state(x=SD, d=SD, v_x=SD)
    noise = Noise({"x": SD}, system.state(d=SD))
    return kalman_filter(system, 0.0, Gaussian(mean, spread), t, {"x": x}, place, noise)


def normalised(truth, estimate):
    """Squares of errors in standard deviations, with degrees of freedom; errors where none may be."""
    error = np.stack([np.subtract(truth[n], getattr(estimate.means, n)) for n in ("x", "d", "v_x")], -1)
    wide = np.asarray(estimate.covariances)
    unit = np.sqrt(np.einsum("nkii->nki", wide))
    wrong = np.sum((error != 0.0) & (unit == 0.0), axis=-1)
    unit = np.where(unit == 0.0, 1.0, unit)
    values, axes = np.linalg.eigh(wide / unit[..., None] / unit[..., None, :])
    along = np.einsum("nkij,nki->nkj", axes, error / unit)
    used = values > 1e-5  # what has just come loose has a speed that follows from its place
    squares = np.sum(np.where(used, along**2 / np.where(used, values, 1.0), 0.0), axis=-1)
    return squares, np.sum(used, axis=-1), wrong


@pytest.mark.slow
def test_errors_are_as_large_as_the_covariance_says_over_a_thousand_runs():
    """Normalised errors inside their 95% band, with sticks from two stamps to all of them."""
    runs, stamps, dt = 1000, 40, 0.3
    t = dt * np.arange(1, stamps + 1)
    rng = np.random.default_rng(0)
    force, speed = rng.uniform(0.6, 1.2, runs), rng.uniform(0.1, 0.4, runs)
    stuck = rng.random(runs) < 0.5
    places = rng.uniform(-0.5, 0.5, runs)
    speeds = np.where(stuck, speed, speed * rng.uniform(-1.0, 0.8, runs))

    def one(force, speed, x, v, key):
        system = Pushed(force, 0.5 * force, speed)
        first, second, third = jax.random.split(key, 3)
        mean = system.state(x=x, v_x=v)
        y = draw(system, mean, system.state(x=SD, d=SD, v_x=SD), first)

        def onwards(carry, row):
            (t, kicks), (y, mode) = row, carry
            found = wander(system, t - dt, dt, y, mode, kicks)
            return found, found

        start = y, system.initial_mode(0.0, y, None)
        rows = jnp.asarray(t), kicks_of(SD, dt, (stamps,), second)
        _, (truth, modes) = jax.lax.scan(onwards, start, rows)
        seen = truth.x + SD * jax.random.normal(third, (stamps,))
        found = filtered(system, mean, t, seen)
        return {n: getattr(truth, n) for n in ("x", "d", "v_x")}, modes, found, smooth(found)

    keys = jax.random.split(jax.random.key(0), runs)
    truth, modes, found, later = jax.jit(jax.vmap(one))(force, speed, places, speeds, keys)
    for estimate in (found.estimate, later):
        same = np.asarray(modes) == np.asarray(estimate.modes)
        assert np.sum(~same) <= 10  # of 40,000: an event within a few microseconds of a stamp
        squares, freedom, wrong = normalised(truth, estimate)
        assert not np.any(wrong[same])
        inside = []
        for k in range(stamps):
            count = freedom[same[:, k], k].sum()
            low, high = stats.chi2.ppf([0.025, 0.975], count)
            inside.append(low < squares[same[:, k], k].sum() < high)
        assert inside[-1]
        assert sum(inside) >= 0.9 * stamps
    low, high = stats.chi2.ppf([0.025, 0.975], runs * stamps)
    assert low < float(found.nis.sum()) < high
    names = Pushed().mode_names
    sticks = np.asarray(found.estimate.modes) == names.index("stick")
    assert 0.3 < sticks.mean() < 0.7
    lengths = {len(word) for row in sticks for word in "".join("-s"[int(s)] for s in row).split("-")}
    assert lengths >= set(range(3, 20))
    jax.clear_caches()


@pytest.mark.slow
def test_means_are_those_of_particles():
    """Bootstrap filter with systematic resampling; its standard error from 40 clouds of 2,500."""
    system, dt, clouds, each = Pushed(1.0, 0.5, 0.2), 0.5, 40, 2_500
    t = dt * np.arange(1, 11)
    rng = np.random.default_rng(3)
    mean, spread = system.state(x=0.55, v_x=0.2), system.state(x=SD, d=SD, v_x=SD)

    @jax.jit
    def ahead(t, y, mode, key):
        # So fine that hardly any of the noise comes on the wrong side of an event.
        kicks = kicks_of(SD, dt, (each,), key, 32)
        return jax.vmap(lambda y, m, k: wander(system, t, dt, y, m, k))(y, mode, kicks)

    y = draw(system, mean, spread, jax.random.key(5))
    mode, seen = system.initial_mode(0.0, y, None), []
    for k, end in enumerate(t):
        y, mode = wander(system, end - dt, dt, y, mode, kicks_of(SD, dt, (), jax.random.key(100 + k)))
        seen.append(float(y.x) + SD * rng.normal())
    found = filtered(system, mean, t, np.array(seen))
    assert len(set(np.asarray(found.estimate.modes).tolist())) == 2

    means = np.zeros((clouds, len(t), 3))
    # From one key: first draws of keys that are neighbours have the same mean to four standard errors.
    keys = jax.random.split(jax.random.key(17), (clouds, each))
    for cloud in range(clouds):
        y = jax.vmap(lambda k: draw(system, mean, spread, k))(keys[cloud])
        mode = jax.vmap(lambda y: system.initial_mode(0.0, y, None))(y)
        for k, end in enumerate(t):
            y, mode = ahead(end - dt, y, mode, jax.random.key(1000 * (cloud + 1) + k))
            rows = np.stack([y.x, y.d, y.v_x], axis=1)
            weights = np.exp(-0.5 * ((seen[k] - rows[:, 0]) / SD) ** 2)
            weights /= weights.sum()
            # About one of them, so that a speed that all have is not rounded.
            means[cloud, k] = rows[0] + weights @ (rows - rows[0])
            points = (np.arange(each) + rng.random()) / each
            taken = np.minimum(np.searchsorted(np.cumsum(weights), points), each - 1)
            y, mode = jax.tree.map(lambda a, taken=taken: a[taken], (y, mode))
    estimate = np.stack([found.estimate.means.x, found.estimate.means.d, found.estimate.means.v_x], 1)
    error = means.std(axis=0, ddof=1) / np.sqrt(clouds)
    off = np.abs(means.mean(axis=0) - estimate)
    held = error < 1e-12  # a speed that all particles have: the rounding of their mean
    assert np.any(held)
    assert np.all(off[held] < 1e-15)
    assert np.max(off[~held] / error[~held]) < 3.0
