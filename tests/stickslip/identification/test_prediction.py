"""Predictions and scores of a fit: beside differences, draws, arithmetic by hand, 200 repetitions."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.stats import norm

from stickslip import plot
from stickslip.identification import Observed, Prediction, Problem, Record, Unknown, load_fit
from stickslip.systems import CoulombOscillator, Motion

SD, TIMES = 0.02, np.linspace(0.0, 20.0, 41)
TRUTH = {"friction": 0.45, "stiffness": 1.2}
UNKNOWNS = {"friction": Unknown(0.4, bounds=(0.0, 1.0), unit="N"), "stiffness": 1.0}
OBSERVED = {"position": Observed(lambda t, y, system: y.x, SD, "m")}


def block(values, inputs):
    return CoulombOscillator(1.0, values["stiffness"], 1.0, values["friction"], 0.2)


def start(values, inputs):
    return Motion(x=0.0, v=0.2)


def record(values, **options):
    return Record(TIMES, {"position": values}, **options)


EMPTY = Problem(block, start, UNKNOWNS, OBSERVED, record(np.zeros(TIMES.size)))


def motion(values=None):
    return np.asarray(EMPTY.simulate(TRUTH if values is None else values).observed["position"])


@pytest.fixture(scope="module")
def clean():
    return motion()


@pytest.fixture(scope="module")
def problem(clean):
    return EMPTY.with_records(record(clean + SD * np.random.default_rng(0).normal(size=TIMES.size)))


@pytest.fixture(scope="module")
def fit(problem):
    return problem.fit()


def numbers(fit):
    return {name: float(value) for name, value in fit.values.items()}


def differences(fit, h=1e-5):
    """Slopes of the motion by the values, in the order of the names."""
    values = numbers(fit)
    rows = [
        motion({**values, n: values[n] + h}) - motion({**values, n: values[n] - h}) for n in fit.names
    ]
    return np.stack(rows, -1) / (2.0 * h)


@pytest.mark.more
@pytest.mark.parametrize("level", [0.5, 0.95])
def test_the_band_is_that_of_the_linearised_problem(problem, fit, level):
    slopes = differences(fit)
    covariance = np.linalg.inv(slopes.T @ slopes / SD**2)
    own = np.sqrt(np.einsum("ti,ij,tj->t", slopes, covariance, slopes))
    width = norm.ppf(0.5 + level / 2.0)
    found = problem.predict(fit, level=level)
    mean = motion(numbers(fit))
    np.testing.assert_allclose(found.mean["position"], mean, atol=1e-12)
    np.testing.assert_allclose(found.upper["position"] - mean, width * own, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(mean - found.lower["position"], width * own, rtol=1e-4, atol=1e-9)
    whole = width * np.hypot(own, SD)
    np.testing.assert_allclose(found.measured_upper["position"] - mean, whole, rtol=1e-4)


@pytest.mark.more
def test_draws_agree_with_the_slopes_where_hardly_anything_bends(problem, fit):
    by_slopes, by_draws = problem.predict(fit), problem.predict(fit, draws=2000, seed=1)
    assert by_draws.failed == 0
    size = by_slopes.upper["position"] - by_slopes.lower["position"]
    moves = size > 0.1 * size.max()
    for part in ("lower", "upper"):
        off = getattr(by_draws, part)["position"] - getattr(by_slopes, part)["position"]
        assert np.max(np.abs(off[moves]) / size[moves]) < 0.1
    again = problem.predict(fit, draws=2000, seed=1)
    np.testing.assert_array_equal(again.upper["position"], by_draws.upper["position"])


@pytest.mark.more
def test_what_no_datum_sees_has_no_band():
    """The friction of a slip acts from the first slip on: a record of the stick alone says nothing."""
    times = np.linspace(0.0, 3.0, 16)
    stuck = Record(times, {"position": 0.2 * times + SD * np.sin(77.0 * times)})
    fit = EMPTY.with_records(stuck).fit()
    assert np.isinf(float(fit.standard_errors()["friction"]))
    found = EMPTY.predict(fit, record(np.zeros(TIMES.size)))
    size = found.upper["position"] - found.lower["position"]
    np.testing.assert_allclose(size[TIMES < 3.9], 0.0, atol=1e-12)
    assert np.all(np.isinf(size[TIMES > 6.0]))
    with pytest.raises(ValueError, match=r"draws = 9: .*draws=None where the data do not see"):
        EMPTY.predict(fit, draws=9)


@pytest.mark.more
def test_a_score_is_arithmetic(fit, clean):
    rng = np.random.default_rng(5)
    values = clean + 3.0 * SD * rng.normal(size=TIMES.size)
    values[7] = np.nan
    further = record(values, missing="nan")
    found = EMPTY.score(fit, further, after=2.0, windows=3)
    model = motion(numbers(fit))
    np.testing.assert_allclose(found.windows, [2.0, 8.0, 14.0, 20.0])
    for k in range(3):
        low, high = found.windows[k : k + 2]
        there = (low <= TIMES) & ((high > TIMES) if k < 2 else (high >= TIMES)) & np.isfinite(values)
        off, spread = (values - model)[there], values[there] - values[there].mean()
        rms = np.sqrt(np.mean(off**2))
        np.testing.assert_allclose(found.rms["position"][k], rms, rtol=1e-9)
        np.testing.assert_allclose(found.chi_squared["position"][k], (rms / SD) ** 2, rtol=1e-9)
        part = 1.0 - np.linalg.norm(off) / np.linalg.norm(spread)
        np.testing.assert_allclose(found.fit["position"][k], part, rtol=1e-9)
    assert "position, 2 to 8 s: rms" in str(found)
    by_values = EMPTY.score(numbers(fit), further, after=2.0, windows=3)
    np.testing.assert_array_equal(by_values.rms["position"], found.rms["position"])
    with pytest.raises(ValueError, match=r"after = 20.0: it must be below 20.0 s"):
        EMPTY.score(fit, further, after=20.0)


def test_the_truth_scores_the_noise(clean):
    values = clean + SD * np.random.default_rng(2).normal(size=TIMES.size)
    assert 0.6 < float(EMPTY.score(TRUTH, record(values)).chi_squared["position"][0]) < 1.5
    assert float(EMPTY.score(TRUTH, record(clean)).fit["position"][0]) == pytest.approx(1.0)


@pytest.mark.more
def test_a_fit_of_other_unknowns_is_refused(fit):
    other = Problem(
        block, lambda p, inputs: Motion(x=p["x"], v=0.2),
        {**UNKNOWNS, "x": Unknown(0.0, per_record=True)}, OBSERVED, record(np.zeros(TIMES.size)),
    )  # fmt: skip
    for act in (other.predict, other.score):  # of its own record
        with pytest.raises(
            ValueError,
            match=r"fit = .*of friction, stiffness.*: .* a Fit of friction, stiffness, x\[0\]",
        ):
            act(fit)
    with pytest.raises(ValueError, match=r"record = 1: it must be"):
        EMPTY.predict(fit, 1)
    with pytest.raises(TypeError, match="record = 'a'"):
        EMPTY.predict(fit, "a")
    with pytest.raises(ValueError, match=r"level = 1.0"):
        EMPTY.predict(fit, level=1.0)


@pytest.mark.more
def test_a_picture_has_both_bands_and_the_data(problem, fit):
    found = problem.predict(fit)
    axis, below = plot.prediction(found)
    assert (axis.get_ylabel(), below.get_ylabel()) == ("position [m]", "residual [m]")
    assert len(axis.collections) == len(below.collections) == 2
    data, line = axis.lines
    np.testing.assert_array_equal(data.get_ydata(), found.record.values["position"])
    np.testing.assert_array_equal(line.get_ydata(), found.mean["position"])
    left, zero = below.lines
    residual = found.record.values["position"] - found.mean["position"]
    np.testing.assert_array_equal(left.get_ydata(), residual)
    assert not np.any(zero.get_ydata())
    (corners,) = (path.vertices for path in below.collections[0].get_paths())
    half = found.measured_upper["position"] - found.mean["position"]
    assert corners[:, 1].max() == pytest.approx(half.max(), rel=1e-12)
    (alone,) = plot.prediction(found, ax=[axis])  # in axes of one's own: the motion
    assert alone is axis
    plt.close(axis.figure)
    assert set(found.to_dataset()) == {"position" + part for part in (
        "", "_lower", "_upper", "_measured_lower", "_measured_upper")}  # fmt: skip
    assert str(found) == "Prediction: position at 41 times, bands of 0.95"


@pytest.mark.more
def test_a_fit_comes_back_from_its_file_and_predicts_the_same(problem, fit, tmp_path):
    back = load_fit(fit.save(tmp_path / "fit.nc"))
    assert str(back) == str(fit)
    assert back.digest == problem.digest
    one, other = problem.predict(fit), problem.predict(back)
    np.testing.assert_array_equal(one.measured_upper["position"], other.measured_upper["position"])


@pytest.mark.more
def test_the_bands_hold_what_they_say():
    """Over 200 records: the true motion lies in the band of the unknowns, further measurements in that
    of measurements, at 95% of the times."""
    clean = motion()
    moves = TIMES > 5.0  # until then it sticks, whatever the unknowns are
    own, whole = [], []
    for seed in range(200):
        rng = np.random.default_rng(1000 + seed)
        noisy, further = (clean + SD * rng.normal(size=TIMES.size) for _ in range(2))
        problem = EMPTY.with_records(record(noisy))
        found: Prediction = problem.predict(problem.fit(), record(further))
        inside = (found.lower["position"] <= clean) & (clean <= found.upper["position"])
        own.append(inside[moves].mean())
        whole.append(found.inside()["position"])
    assert 0.93 < np.mean(own) < 0.97
    assert 0.93 < np.mean(whole) < 0.97


BEGINS = np.linspace(0.0, 12.0, 121)
OWN = {**UNKNOWNS, "stiffness": 1.15, "x": Unknown(1.3, per_record=True, scale=1.0)}


def from_rest(p, inputs):
    return Motion(x=p["x"], v=0.0)


NEAR = {**TRUTH, "x[at 1.0]": 1.0, "x[at 1.6]": 1.6}


def begun_at(x, seed):
    """A record of a block that is let go at `x`, with noise."""
    clean = Problem(
        block, from_rest, {**UNKNOWNS, "x": Unknown(x, scale=1.0)}, OBSERVED,
        Record(BEGINS, {"position": 0.0 * BEGINS}),
    ).simulate({**TRUTH, "x": x}).observed["position"]  # fmt: skip
    noise = SD * np.random.default_rng(seed).normal(size=BEGINS.size)
    return Record(BEGINS, {"position": np.asarray(clean) + noise}, name=f"at {x}"), np.asarray(clean)


@pytest.fixture(scope="module")
def two_starts():
    problem = Problem(block, from_rest, OWN, OBSERVED, [begun_at(1.0, 1)[0], begun_at(1.6, 2)[0]])
    return problem, problem.fit(start=NEAR)


@pytest.mark.more
def test_a_further_record_begins_where_its_first_part_says(two_starts):
    """Each record starts elsewhere: of a further one the start is found before what is scored."""
    problem, fit = two_starts
    further, _ = begun_at(1.25, 3)
    found = problem.score(fit, further, after=6.0)
    assert 0.6 < float(found.chi_squared["position"][0]) < 1.6
    assert found.windows[0] == 6.0
    alike = Record(BEGINS, further.values, name="at 1.0")  # as one that was fitted is called
    np.testing.assert_allclose(
        problem.score(fit, alike, after=6.0).rms["position"], found.rms["position"]
    )
    shared = {name: float(fit.values[name]) for name in ("friction", "stiffness")}
    again = problem.score(shared, further, after=6.0)
    np.testing.assert_allclose(again.rms["position"], found.rms["position"], rtol=1e-9)
    stated = problem.score({**shared, "x[at 1.25]": 1.25}, further)
    assert 0.6 < float(stated.chi_squared["position"][0]) < 1.6
    for act in (problem.score, problem.predict):
        with pytest.raises(ValueError, match=r"after = 0\.0: it must be above 0: x of a further"):
            act(fit, further)


@pytest.mark.more
def test_the_band_of_a_further_record_knows_of_its_start(two_starts):
    """The start is found again with other shared values, by differences, and has its own error."""
    problem, fit = two_starts
    further, _ = begun_at(1.25, 3)
    names, early = ("friction", "stiffness"), BEGINS < 4.0
    alone = Problem(
        block, from_rest, {**UNKNOWNS, "x": Unknown(1.3, scale=1.0)}, OBSERVED,
        Record(BEGINS, {"position": 0.0 * BEGINS}),
    )  # fmt: skip

    def rows(shared, x):
        values = {**dict(zip(names, shared, strict=True)), "x": x}
        return np.asarray(alone.simulate(values).observed["position"])

    def slope(shared, x, h=1e-6):
        return (rows(shared, x + h) - rows(shared, x - h)) / (2.0 * h)

    def start_of(shared, x=1.25):
        for _ in range(8):
            by_x = slope(shared, x)[early]
            x -= by_x @ (rows(shared, x) - further.values["position"])[early] / (by_x @ by_x)
        return x

    best = np.array([float(fit.values[name]) for name in names])
    x = start_of(best)
    by_shared = []
    for i in range(2):
        h = 1e-5 * np.eye(2)[i]
        both = [rows(s, start_of(s)) for s in (best + h, best - h)]
        by_shared.append((both[0] - both[1]) / 2e-5)
    by_shared, by_x = np.stack(by_shared, -1), slope(best, x)
    where = [fit.names.index(name) for name in names]
    covariance = np.asarray(fit.covariance())[np.ix_(where, where)]
    variance = np.einsum("ti,ij,tj->t", by_shared, covariance, by_shared)
    variance += by_x**2 * SD**2 / np.sum(by_x[early] ** 2)
    found = problem.predict(fit, further, after=4.0)
    np.testing.assert_allclose(found.mean["position"], rows(best, x), atol=1e-7)
    size = found.upper["position"] - found.mean["position"]
    np.testing.assert_allclose(size, norm.ppf(0.975) * np.sqrt(variance), rtol=1e-3, atol=1e-7)
    drawn = problem.predict(fit, further, after=4.0, draws=1000, seed=1)
    wide = drawn.upper["position"] - drawn.lower["position"]
    assert drawn.failed == 0
    np.testing.assert_allclose(wide[::10], 2.0 * size[::10], rtol=0.15)


@pytest.mark.more
def test_bands_of_further_records_hold_what_they_say(two_starts):
    problem, _ = two_starts
    inside = []
    for seed in range(60):
        records = [begun_at(x, 10 * seed + i)[0] for i, x in enumerate((1.0, 1.6))]
        fit = problem.with_records(records).fit(start=NEAR)
        further, clean = begun_at(1.25, 10 * seed + 5)
        found = problem.predict(fit, further, after=4.0)
        held = (found.lower["position"] <= clean) & (clean <= found.upper["position"])
        inside.append(held[BEGINS > 4.0].mean())
    assert 0.90 < np.mean(inside) < 0.99
