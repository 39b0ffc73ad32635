"""Period and slow approach from points alone: sequences whose periods are known."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.analysis import _attractor
from stickslip.analysis._attractor import PERIOD_STATUS, period_of, points_needed


def logistic(a, dropped, kept, x=0.3):
    out = []
    for i in range(dropped + kept):
        x = a * x * (1.0 - x)
        if i >= dropped:
            out.append(x)
    return np.array(out)


def verdict(points, size=64, span=None, **options):
    """Period, reason and slowness of `points`, one observable a column, of a motion between 0 and 1."""
    options = {"tolerance": 1e-4, "max_period": 16, **options}
    points = np.asarray(points, float)
    points = points.reshape(len(points), 1)
    span = np.array([[0.0], [1.0]]) if span is None else span
    padded = np.full((size, points.shape[1]), np.nan)
    padded[: len(points)] = points
    start = options.pop("start", None)
    judge = jax.jit(functools.partial(period_of, **options))
    count = jnp.asarray(len(points), jnp.int32)
    found = judge(jnp.asarray(padded), count, jnp.asarray(span), start=start)
    return int(found.period), PERIOD_STATUS[int(found.status)], bool(found.slow)


# Cascade: 3 < period 2 < 3.449 < period 4 < 3.544 < period 8 < 3.5644; period 3 from 1 + sqrt(8).
CYCLES = [(2.8, 1), (3.3, 2), (3.5, 4), (3.55, 8), (3.566, 16), (3.84, 3)]


@pytest.mark.more
@pytest.mark.parametrize(("a", "period"), CYCLES)
@pytest.mark.parametrize("count", [40, 64])
def test_period_of_the_logistic_map(a, period, count):
    assert verdict(logistic(a, 50_000, count)) == (period, "repeats", False)


@pytest.mark.parametrize("a", [3.7, 3.9, 4.0])
def test_chaos_has_no_period(a):
    assert verdict(logistic(a, 5000, 64)) == (0, "none", False)


def test_slow_approach_is_flagged():
    # Multiplier 2 - a = -0.9: the difference shrinks tenfold in about 22 points.
    assert verdict(logistic(2.9, 0, 64, x=0.5))[2]
    assert verdict(logistic(2.9, 500, 64, x=0.5)) == (1, "repeats", False)


@pytest.mark.parametrize("multiplier", [-0.99, -0.9, 0.9, 0.95, 0.99, 0.999, 0.9999, 0.95 + 0.2j])
def test_an_approach_is_neither_chaos_nor_a_period(multiplier):
    """Steps far above the tolerance that shrink by 0.01% to 10% a point, straight or spiralling."""
    points = 0.5 + 0.2 * np.real(np.power(multiplier + 0j, np.arange(64)))
    period, why, _ = verdict(points)
    assert (period, why) == (-1, "not_settled")


def test_a_creep_within_the_tolerance_from_point_to_point_is_no_period():
    """Each step is half the tolerance: neighbours are equal, but the points go on and on."""
    points = 0.5 + 5e-5 * np.arange(64)
    assert verdict(points)[:2] == (-1, "not_settled")


# A sweep of sizes and origins, with periods known beforehand.

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def sequences():
    """Name, two observables of a motion between -1 and 1, and the period."""
    n = np.arange(64)
    for period in (1, 2, 3, 4, 8, 16):
        angle = 2 * np.pi * (n % period) / period + 0.3
        yield f"cycle of {period}", np.stack([np.cos(angle), np.sin(angle)], axis=1), period
    angle = 2 * np.pi * GOLDEN * n
    yield "rotation", np.stack([np.cos(angle), np.sin(angle)], axis=1), 0
    x = 2 * logistic(4.0, 100, 65) - 1
    yield "chaos", np.stack([x[:-1], x[1:]], axis=1), 0


SEQUENCES = {name: (points, period) for name, points, period in sequences()}
# Sizes and origins whose rounding is below the tolerance, 64 eps |origin| < 2e-4 size.
SCALES = [1e-14, 1e-10, 1e-6, 1e-3, 1.0, 1e3]
OFFSETS = [0.0, 1.0, -1e3, 1e6]


@jax.jit
def many(points, span):
    def one(points, span):
        count = jnp.asarray(points.shape[0], jnp.int32)
        return period_of(points, count, span, tolerance=1e-4, max_period=16)

    return jax.vmap(one)(points, span)


def sweep(extra):
    """Status and period of all sequences at all sizes and origins, beside observables `extra`."""
    rng = np.random.default_rng(5)
    rows, spans, expected = [], [], []
    for points, period in SEQUENCES.values():
        for scale in SCALES:
            for offset in OFFSETS:
                resolved = _attractor.ENGINE.some_roundings * (abs(offset) + scale) < 2e-4 * scale
                moves = _attractor.ENGINE.some_roundings * (abs(offset) + scale) < 2 * scale
                columns, ends = [offset + scale * points], [[offset - scale] * 2, [offset + scale] * 2]
                for values, low, high in extra(scale, offset, rng):
                    columns.append(values[:, None])
                    ends[0], ends[1] = [*ends[0], low], [*ends[1], high]
                rows.append(np.concatenate(columns, axis=1))
                spans.append(ends)
                told = period if resolved else -1
                why = "repeats" if period else "none"
                expected.append(
                    (told, why if resolved else ("below_rounding" if moves else "constant"))
                )
    found = many(jnp.asarray(np.array(rows)), jnp.asarray(np.array(spans)))
    words = [PERIOD_STATUS[int(s)] for s in found.status]
    return list(zip(np.asarray(found.period).tolist(), words, strict=True)), expected


def alone(scale, offset, rng):
    return []


def beside_one_that_vanishes(scale, offset, rng):
    """A speed at the maxima of its position: zero to rounding, of size `scale` elsewhere."""
    return [(1e-14 * scale * rng.standard_normal(64), -scale, scale)]


def beside_a_constant(scale, offset, rng):
    """Exact, and with rounding."""
    return [
        (np.full(64, offset + 3.0), offset + 3.0, offset + 3.0),
        (3.0 + 2e-16 * rng.standard_normal(64), 3.0 - 1e-15, 3.0 + 1e-15),
        (np.zeros(64), 0.0, 0.0),
    ]


EXTRAS = [alone, beside_one_that_vanishes, beside_a_constant]


@pytest.mark.more
@pytest.mark.parametrize("extra", EXTRAS)
def test_size_and_origin_do_not_matter(extra):
    found, expected = sweep(extra)
    assert [period for period, _ in found] == [period for period, _ in expected]
    told = [i for i, (period, _) in enumerate(expected) if period >= 0]
    assert [found[i] for i in told] == [expected[i] for i in told]
    assert sum(period >= 0 for period, _ in expected) > 100


@pytest.mark.parametrize("extra", EXTRAS)
def test_the_sweep_fails_with_the_scale_of_the_points_alone(extra, monkeypatch):
    """The old rule: each observable in units of its own largest value on the section."""

    def old(points, count, span, **options):
        scale = jnp.max(jnp.abs(points), axis=0)
        scaled = points / jnp.where(scale > 0, scale, 1.0)[None, :]
        zero = jnp.zeros(points.shape[1])
        return period_of(scaled, count, jnp.stack([zero, zero + 1.0]), **options)

    monkeypatch.setitem(globals(), "many", jax.jit(jax.vmap(lambda p, s: old(
        p, jnp.asarray(64, jnp.int32), s, tolerance=1e-4, max_period=16
    ))))  # fmt: skip
    found, expected = sweep(extra)
    assert [period for period, _ in found] != [period for period, _ in expected]


# What cannot be told


@pytest.mark.parametrize("count", [0, 1, 3])
def test_too_few_points_say_nothing(count):
    assert verdict(logistic(3.3, 1000, count)) == (-1, "too_few_points", False)


def test_how_many_points_are_needed():
    assert [points_needed(p) for p in (1, 2, 3, 4, 16)] == [4, 5, 6, 8, 32]
    for a, period in CYCLES:
        enough = points_needed(period)
        cycle = logistic(a, 50_000, 64)
        assert verdict(cycle[:enough])[:2] == (period, "repeats")
        assert verdict(cycle[: enough - 1])[:2] == (-1, "too_few_points")
    chaos = logistic(3.9, 5000, 64)
    assert verdict(chaos[:32])[:2] == (0, "none")
    assert verdict(chaos[:31])[:2] == (-1, "too_few_points")
    assert verdict(chaos[:31], max_period=8)[:2] == (0, "none")
    # Without room for two rounds of the longest period there is none that could be excluded.
    assert verdict(chaos[:31], size=31)[:2] == (-1, "too_few_points")


def test_points_that_are_not_finite():
    for bad in (np.nan, np.inf):
        points = logistic(3.3, 1000, 40)
        points[7] = bad
        assert verdict(points)[:2] == (-1, "not_finite")
    assert verdict(logistic(3.3, 1000, 40), span=np.array([[0.0], [np.nan]]))[:2] == (-1, "not_finite")


def test_equal_points():
    """Of a motion that moves between them a cycle of one; of one that does not, a rest."""
    points = np.full(40, 0.7)
    assert verdict(points) == (1, "repeats", False)
    assert verdict(points, span=np.array([[0.7], [0.7]]))[:2] == (-1, "constant")
    assert verdict(0 * points, span=np.array([[0.0], [0.0]]))[:2] == (-1, "constant")


def test_what_is_zero_on_the_section_alone_tells_nothing():
    points = 1e-16 * np.random.default_rng(1).standard_normal(40)
    span = np.array([[-1.0], [1.0]])
    assert verdict(points, span=span)[:2] == (-1, "zero_on_section")


def test_a_motion_below_the_rounding_of_its_start_is_a_rest():
    points = 1e-20 * 0.5 ** np.arange(40)
    span, start = np.array([[0.0], [1e-20]]), jnp.ones(1)
    assert verdict(points, span=span, start=start)[:2] == (-1, "constant")
