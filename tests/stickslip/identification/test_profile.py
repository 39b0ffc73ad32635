"""Profile intervals: closed forms, SciPy, bounds, edges, and what cannot be seen."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
import scipy.stats

from stickslip.identification import LevenbergMarquardt, Unknown, least_squares, profile, unseen
from stickslip.identification._profile import VERDICTS

RNG = np.random.default_rng(0)
MATRIX = RNG.normal(size=(30, 3))
TRUTH = np.array([1.5, -2.0, 0.7])
DATA = MATRIX @ TRUTH + RNG.normal(size=30)
STARTS = {"a": Unknown(1.0), "b": Unknown(-1.0), "c": 1.0}
T = np.linspace(0.0, 1.0, 20)
QUANTILE = scipy.stats.chi2.ppf(0.95, 1)


def linear(p):
    return jnp.asarray(MATRIX) @ jnp.stack([p["a"], p["b"], p["c"]]) - DATA


def rises(p, data, last=1.0):
    t = last * jnp.asarray(T)
    return (p["a"] * (1.0 - jnp.exp(-p["b"] * t)) - data) / 0.1


def rows(by_name):
    """In the order of the names."""
    return np.stack([np.asarray(by_name[name]) for name in sorted(by_name)])


def clean(last=1.0):
    return 2.0 * (1.0 - np.exp(-last * T))


@pytest.mark.more
@pytest.mark.parametrize("level", [0.95, 0.68])
def test_of_a_linear_model_profile_and_wald_intervals_agree(level):
    """The sum of squares is a parabola: both are the interval of the textbook."""
    fit = least_squares(linear, STARTS)
    found = profile(linear, fit, level=level)
    covariance = np.linalg.inv(MATRIX.T @ MATRIX)
    middle = covariance @ MATRIX.T @ DATA
    half = scipy.stats.norm.ppf(0.5 + 0.5 * level) * np.sqrt(np.diag(covariance))
    for ends, sign in (((found.lower, found.wald_lower), -1), ((found.upper, found.wald_upper), 1)):
        for end in ends:
            assert np.max(np.abs((rows(end) - middle) / half - sign)) < 1e-6
    assert set(found.verdicts.values()) == {"identifiable"}
    assert float(found.fall) == pytest.approx(0.0, abs=1e-9)
    # Every point on the way lies on the parabola, and the others follow along the line.
    along, heights = rows(found.values), rows(found.rises)
    here = np.isfinite(heights)
    offset = (along - middle[:, None, None]) / np.sqrt(np.diag(covariance))[:, None, None]
    np.testing.assert_allclose(heights[here], offset[here] ** 2, atol=1e-6)
    slope = covariance[:, 0] / covariance[0, 0]
    way = (along[0] - middle[0])[..., None] * slope + middle
    others = np.moveaxis(rows(found.others["a"]), 0, -1)
    np.testing.assert_allclose(others[here[0]], way[here[0]], atol=1e-4)


@pytest.mark.more
def test_a_curved_profile_is_that_of_scipy():
    data = clean() + 0.02 * np.random.default_rng(5).normal(size=20)
    fit = least_squares(lambda p: rises(p, data), dict(a=2.5, b=0.8))
    found = profile(lambda p: rises(p, data), fit, "a")

    def rest(a):
        def cost(log_b):
            return float(np.sum(((a * (1 - np.exp(-np.exp(log_b) * T)) - data) / 0.1) ** 2))

        return scipy.optimize.minimize_scalar(cost, bracket=(-0.5, 0.5), tol=1e-14).fun

    least = rest(float(found.estimate["a"]))
    ends = [
        scipy.optimize.brentq(lambda a: rest(a) - least - QUANTILE, *bracket, xtol=1e-12)
        for bracket in ((0.5, float(found.estimate["a"])), (float(found.estimate["a"]), 50.0))
    ]
    width = ends[1] - ends[0]
    assert abs(float(found.lower["a"]) - ends[0]) < 1e-6 * width
    assert abs(float(found.upper["a"]) - ends[1]) < 1e-6 * width
    # The valley is curved: the straight interval misses its upper end by far.
    assert abs(float(found.wald_upper["a"]) - ends[1]) > 0.1 * width


def product(p):
    return jnp.stack([p["k1"] * p["k2"] - 6.0, 2.0 * p["c"] - 8.0, p["c"] - 4.5])


@pytest.mark.more
def test_a_product_hides_its_factors():
    fit = least_squares(product, dict(k1=1.0, k2=2.0, c=3.0))
    found = profile(product, fit)
    verdict = found.verdicts
    assert verdict["k1"] == verdict["k2"] == "structurally not identifiable"
    assert verdict["c"] == "identifiable"
    assert float(found.lower["c"]) == pytest.approx(4.1 - np.sqrt(QUANTILE / 5), rel=1e-7)
    assert max(np.nanmax(found.rises[name]) for name in ("k1", "k2")) < 1e-9
    products = np.stack(
        [np.asarray(found.others[name]["k1"] * found.others[name]["k2"]) for name in ("k1", "k2")]
    )
    np.testing.assert_allclose(products[np.isfinite(products)], 6.0, rtol=1e-6)
    assert unseen(fit) == ["k1 * k2 is seen, k1 / k2 is not"]


@pytest.mark.slow
def test_flat_without_a_singular_sensitivity():
    """A profile that is flat to rounding tells it even where the Jacobian has full rank."""

    def residual(p):
        return jnp.stack([jnp.where(p["a"] > 2.0, 0.0, p["a"] - 2.0), 1e-4 * jnp.sin(p["a"])])

    fit = least_squares(residual, dict(a=3.0))
    assert profile(residual, fit, limits={"a": (2.0, 9.0)}).verdicts == {
        "a": "structurally not identifiable"
    }


@pytest.mark.more
def test_a_bound_of_another_unknown_ends_the_interval():
    unknowns = dict(k1=Unknown(1.0), k2=Unknown(2.0, bounds=(0.0, 5.0)), c=3.0)
    fit = least_squares(product, unknowns)
    found = profile(product, fit, "k1")
    # With k2 at its bound of 5 the first residual is 5 k1 - 6.
    assert float(found.lower["k1"]) == pytest.approx((6.0 - np.sqrt(QUANTILE)) / 5.0, abs=1e-7)


@pytest.mark.more
def test_practically_not_identifiable_within_bounds():
    """Of a rise that has hardly bent yet, only the product of height and rate is seen well."""
    data = clean(0.3)
    start = dict(a=Unknown(2.0, bounds=(0.0, 1e4)), b=Unknown(1.0, bounds=(1e-3, 50.0)))
    fit = least_squares(lambda p: rises(p, data, 0.3), start)
    found = profile(lambda p: rises(p, data, 0.3), fit)
    assert found.verdicts == {"a": "identifiable", "b": "practically not identifiable"}
    assert [int(e) for e in found.ends["b"]] == [1, 0]
    assert float(found.lower["b"]) == pytest.approx(1e-3, rel=1e-3)
    assert "from <0.001" in str(found)
    # The height has an upper end only because the rate has a lower bound: a root of a parabola.
    shape = (1.0 - np.exp(-1e-3 * 0.3 * T)) / 0.1
    parabola = [shape @ shape, -2.0 * shape @ data / 0.1, data @ data / 0.01 - QUANTILE]
    assert float(found.upper["a"]) == pytest.approx(max(np.roots(parabola)), rel=1e-6)


@pytest.mark.more
def test_the_edge_of_where_a_model_runs():
    def residual(p):
        return jnp.where(p["a"] < 2.0, jnp.nan, jnp.stack([p["a"] - 2.5]))

    found = profile(residual, least_squares(residual, dict(a=3.0)))
    assert [int(e) for e in found.ends["a"]] == [2, 0]
    assert float(found.lower["a"]) == pytest.approx(2.0, abs=1e-6)
    assert float(found.upper["a"]) == pytest.approx(2.5 + np.sqrt(QUANTILE))


@pytest.mark.slow
def test_beyond_a_jump_the_others_give_way():
    """Of a disc cut by a line beyond which nothing fits: the interval ends where line and circle meet,
    far beyond where the way outwards meets the line, and no further."""

    def cut(p):
        return jnp.where(p["a"] + p["b"] > 0.3, 1e3, 1.0) * jnp.stack([p["a"], p["b"]])

    fit = least_squares(cut, {"a": Unknown(0.05), "b": Unknown(-0.1)})
    found = profile(cut, fit, "a")
    corner = 0.15 + np.sqrt(0.5 * QUANTILE - 0.15**2)
    assert corner - 2e-3 < float(found.upper["a"]) <= corner
    assert [int(end) for end in found.ends["a"]] == [0, 2]
    assert float(found.lower["a"]) == pytest.approx(-np.sqrt(QUANTILE), rel=1e-6)
    # Every point told is one: the rise there is that of the closed form.
    here = np.isfinite(found.rises["a"][1])
    below = np.asarray(found.values["a"][1][here])
    least = below**2 + np.minimum(0.3 - below, 0.0) ** 2
    assert np.all(found.rises["a"][1][here] >= least - 1e-9)


@pytest.mark.more
def test_a_fit_that_is_no_minimum_is_told():
    fit = least_squares(linear, STARTS)
    poor = least_squares(linear, STARTS, LevenbergMarquardt(max_steps=1))
    found = profile(linear, poor)
    assert float(found.fall) == pytest.approx(2.0 * float(poor.cost - fit.cost), rel=1e-6)
    np.testing.assert_allclose(rows(found.estimate), [fit.values[n] for n in "abc"], rtol=1e-6)


@pytest.mark.slow
def test_an_upper_bound_alone():
    unknowns = dict(a=Unknown(1.0, bounds=(None, 3.0)), b=Unknown(-1.0, bounds=(None, 0.0)), c=1.0)
    found = profile(linear, least_squares(linear, unknowns))
    assert np.nanmax(rows(found.values)[:, 0]) <= np.max(rows(found.estimate))
    np.testing.assert_allclose(rows(found.lower), rows(found.wald_lower), rtol=1e-5)
    np.testing.assert_allclose(rows(found.upper), rows(found.wald_upper), rtol=1e-5)


@pytest.mark.more
def test_under_jit_and_vmap_and_compiled_once(compiled):
    data = clean() + 0.02 * np.random.default_rng(3).normal(size=(4, 20))

    def ends(data):
        fit = least_squares(lambda p: rises(p, data), dict(a=2.5, b=0.8))
        found = profile(lambda p: rises(p, data), fit)
        return found.lower, found.upper, found.verdict

    every = jax.jit(jax.vmap(ends))(data)
    alone = [ends(row) for row in data]
    for i, one in enumerate(alone):
        for a, b in zip(map(rows, every), map(rows, one), strict=True):
            a = np.moveaxis(a, 1, 0)
            np.testing.assert_allclose(a[i], b, rtol=1e-6)
    compiled.clear()
    ends(data[0] + 0.01)
    assert compiled == []


@pytest.mark.slow
def test_intervals_cover_the_truth():
    """400 records of the curved model: 95% within three binomial standard deviations."""
    records = clean() + 0.1 * np.random.default_rng(4).normal(size=(400, 20))

    def covers(data):
        fit = least_squares(lambda p: rises(p, data), dict(a=2.0, b=1.0))
        found = profile(lambda p: rises(p, data), fit, "b")
        return (found.lower["b"] < 1.0) & (found.upper["b"] > 1.0)

    part = float(jnp.mean(jax.jit(jax.vmap(covers))(records)))
    assert abs(part - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / 400)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (
            ("load", "mu_k", "mu_s"),
            ["load * mu_s, mu_k / mu_s are seen, load / (mu_k * mu_s) is not"],
        ),
        (("load",), ["load is not seen"]),
    ],
)
def test_words_for_what_is_not_seen(names, expected):
    def residual(p):
        if len(names) == 1:
            return jnp.stack([p["b"] + 0.0 * p["load"]])
        return jnp.stack([p["load"] * p["mu_k"], p["load"] * p["mu_s"]]) - 1.0

    start = dict.fromkeys(names, 1.0) | ({"b": 1.0} if len(names) == 1 else {})
    assert unseen(least_squares(residual, start)) == expected


def test_words_for_sums_and_powers():
    signed = {"a": Unknown(4.0), "b": Unknown(-1.0, scale=0.01)}
    found = unseen(least_squares(lambda p: jnp.stack([p["a"] + 2.0 * p["b"] - 1.0]), signed))
    # Along what is not seen b falls by half of what a rises.
    assert found == ["a + 2 b is seen, a - 0.5 b is not"]
    found = unseen(least_squares(lambda p: jnp.stack([p["m"] * p["w"] ** 2 - 5.0]), dict(m=1.0, w=1.0)))
    assert found == ["m * w^2 is seen, m^2 / w is not"]
    none = unseen(least_squares(lambda p: jnp.stack([0.0 * p["m"] * p["w"]]), dict(m=1.0, w=1.0)))
    assert none == ["m is not seen", "w is not seen"]


def test_bad_input():
    fit = least_squares(linear, STARTS)
    for given, error, text in (
        (dict(names="d"), ValueError, "names = 'd': it must be names among a, b, c"),
        (dict(limits={"d": (0, 1)}), ValueError, r"limits\['d'\]"),
        (dict(limits={"a": (5, 9)}), ValueError, r"limits\['a'\] = .* around the estimate"),
        (dict(limits={"c": (-1, 9)}), ValueError, r"limits\['c'\] = .* inside of the bounds"),
        (dict(limits={"a": 3}), TypeError, r"limits\['a'\]"),
    ):
        with pytest.raises(error, match=text):
            profile(linear, fit, **given)
    assert len(VERDICTS) == 4
