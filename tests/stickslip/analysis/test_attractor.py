"""Period and slow approach from points alone: the logistic map, whose cycles are known."""

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.analysis._attractor import period_of


def logistic(a, dropped, kept, x=0.3):
    out = []
    for i in range(dropped + kept):
        x = a * x * (1.0 - x)
        if i >= dropped:
            out.append(x)
    return np.array(out)


def verdict(points, size=64, **options):
    options = {"tolerance": 1e-4, "max_period": 16, **options}
    padded = np.full((size, 1), np.nan)
    padded[: len(points), 0] = points
    period, slow = period_of(jnp.asarray(padded), jnp.asarray(len(points), jnp.int32), **options)
    return int(period), bool(slow)


# Cascade: 3 < period 2 < 3.449 < period 4 < 3.544 < period 8 < 3.5644; period 3 from 1 + sqrt(8).
@pytest.mark.parametrize(("a", "period"), [(2.8, 1), (3.3, 2), (3.5, 4), (3.55, 8), (3.84, 3)])
@pytest.mark.parametrize("count", [40, 64])
def test_period_of_the_logistic_map(a, period, count):
    assert verdict(logistic(a, 5000, count)) == (period, False)


@pytest.mark.parametrize("a", [3.7, 3.9, 4.0])
def test_chaos_has_no_period(a):
    assert verdict(logistic(a, 5000, 64)) == (0, False)


def test_slow_approach_is_flagged():
    # Multiplier 2 - a = -0.9: the difference shrinks tenfold in about 22 points.
    period, slow = verdict(logistic(2.9, 0, 64, x=0.5))
    assert slow
    assert verdict(logistic(2.9, 500, 64, x=0.5)) == (1, False)
    del period


@pytest.mark.parametrize("count", [0, 1, 3])
def test_too_few_points_say_nothing(count):
    assert verdict(logistic(3.3, 1000, count)) == (0, False)
