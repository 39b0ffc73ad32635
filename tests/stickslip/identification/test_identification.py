"""Fits through stick and slip: known values, covariance by Monte Carlo, products not seen."""

import functools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.identification import (
    GradientDescent,
    _many_starts,
    best,
    least_squares,
    many_starts,
    sensitivities,
    sensitivity,
)
from stickslip.systems import CoulombOscillator, Motion

TIMES = jnp.linspace(0.5, 20.0, 40)
# Friction enters as coefficient times load, so one combination of these is not seen.
TRUTH = {"load": 2.0, "mu_k": 0.25, "mu_s": 0.5, "stiffness": 1.0}
START = {"load": 1.9, "mu_k": 0.27, "mu_s": 0.54, "stiffness": 1.03}
PRODUCTS = np.array([[1, 1, 0, 0], [1, 0, 1, 0], [0, 0, 0, 1]])  # load mu_k, load mu_s, stiffness
NAMES = sorted(TRUTH)
SIGMA = 1e-3
COPIES = 500


def positions(values):
    """Positions of a block on a belt at 0.2 m/s: two sticks and slips within 20 s."""
    friction = (values["mu_s"] * values["load"], values["mu_k"] * values["load"])
    block = CoulombOscillator(1.0, values["stiffness"], *friction, 0.2)
    found = ss.simulate(
        block, 0.0, TIMES[-1], Motion(x=0.0, v=0.2), "stick", throw=False,
        saveat=ss.SaveAt(ts=TIMES, max_events=None),
    )  # fmt: skip
    return found.outputs.y.x


run = jax.jit(positions)


def data(**changes):
    return run({name: jnp.asarray(v) for name, v in (TRUTH | changes).items()})


@jax.jit
@jax.vmap
def fitted(start, measured):
    return least_squares(lambda p: (positions(p) - measured) / SIGMA, start)


@functools.cache
def many():
    """Fits to noisy copies of the data, the first without noise."""
    noise = SIGMA * np.random.default_rng(0).normal(size=(COPIES, len(TIMES)))
    noise[0] = 0
    start = {name: jnp.full((COPIES,), value) for name, value in START.items()}
    return fitted(start, data()[None] + noise)


def products(values):
    """Logarithms of the combinations that are seen, over their true values."""
    logs = np.log(np.stack([values[name] / TRUTH[name] for name in NAMES], axis=-1))
    return logs @ PRODUCTS.T


@pytest.mark.more
def test_noise_free_data_give_the_values_back():
    found = many()
    assert bool(found.successful[0])
    assert np.max(np.abs(products(found.values)[0])) < 1e-10
    assert float(found.cost[0]) < 1e-12
    assert int(found.steps[0]) < 30


@pytest.mark.more
def test_covariance_is_that_of_repeated_experiments():
    """Spread of the estimates over noise against the first-order covariance; 499 copies tell to 6 %."""
    found = many()
    assert bool(jnp.all(found.successful))
    logs = products(found.values)[1:]
    predicted = PRODUCTS @ np.asarray(found.sensitivity.covariance()[0]) @ PRODUCTS.T
    size = np.sqrt(np.outer(np.diag(predicted), np.diag(predicted)))
    np.testing.assert_allclose(np.cov(logs.T) / size, predicted / size, atol=0.2)
    # Chi squared over its degrees of freedom, 37 and not 36: 1 with standard error sqrt(2/37/499).
    chi = 2 * np.mean(found.cost[1:]) / 37
    assert chi == pytest.approx(1.0, abs=0.04)
    assert np.all(np.abs(np.mean(logs, axis=0)) < 5 * np.sqrt(np.diag(predicted) / 499))


@pytest.mark.more
def test_products_that_cannot_be_seen():
    found = jax.tree.map(lambda a: a[0], many())
    matrix = found.sensitivity
    np.testing.assert_array_equal(matrix.seen_directions(), [True, True, True, False])
    hidden = matrix.directions[3] * np.sign(matrix.directions[3][0])
    np.testing.assert_allclose(hidden, np.array([1, -1, -1, 0]) / np.sqrt(3), atol=1e-9)
    errors = found.standard_errors()
    assert {name for name, e in errors.items() if not np.isfinite(e)} == {"load", "mu_k", "mu_s"}
    relative = float(errors["stiffness"]) / float(found.values["stiffness"])
    assert relative == pytest.approx(np.sqrt(matrix.covariance()[3, 3]))
    up, down = (data(stiffness=s) / SIGMA for s in (1 + 1e-6, 1 - 1e-6))
    slope = (up - down) / 2e-6
    np.testing.assert_allclose(matrix.matrix[:, 3], slope, atol=1e-6 * np.max(np.abs(slope)))


def test_sensitivity_of_a_formula():
    t = jnp.linspace(0.1, 1.0, 7)
    found = sensitivity(lambda p: p["a"] * jnp.exp(-p["b"] * t), dict(a=3.0, b=2.0))
    expected = 3 * np.exp(-2 * t[:, None]) * np.stack([np.ones(7), -2 * t], axis=1)
    np.testing.assert_allclose(found.matrix, expected, rtol=1e-12)
    np.testing.assert_allclose(found.covariance(), np.linalg.inv(expected.T @ expected), rtol=1e-9)


def test_fewer_data_than_unknowns():
    found = sensitivity(lambda p: jnp.stack([p["a"] * p["b"]]), dict(a=1.0, b=2.0))
    np.testing.assert_array_equal(found.seen_directions(), [True, False])
    assert all(np.isinf(float(e)) for e in found.relative_standard_errors().values())


def rosenbrock(p):
    return jnp.stack([10.0 * (p["b"] - p["a"] ** 2), 1.0 - p["a"]])


@pytest.mark.more
def test_many_starts_and_the_best():
    """The valley of Rosenbrock, and a residual with a second minimum."""
    starts = {"a": np.array([0.3, 2.0, 1.2]), "b": np.array([3.0, 0.2, 1.0])}
    found = many_starts(rosenbrock, starts)
    assert bool(jnp.all(found.successful))
    np.testing.assert_allclose(found.values["a"], 1.0, rtol=1e-7)

    def two(p):
        return jnp.stack([jnp.sin(6.0 * jnp.log(p["a"])), 0.1 * jnp.log(p["a"])])

    found = many_starts(two, {"a": np.array([0.2, 0.9, 3.0])})
    assert len(np.unique(np.round(found.values["a"], 3))) == 3
    assert float(best(found).values["a"]) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.more
def test_many_starts_compile_once_for_all_steps_and_numbers_of_starts(compiled):
    random = np.random.default_rng(3)

    def run(number):
        ends = many_starts(rosenbrock, {n: random.uniform(0.3, 3.0, number) for n in "ab"})
        np.testing.assert_allclose(ends.values["a"], np.ones(number), rtol=1e-6)
        assert len(set(np.asarray(ends.steps).tolist())) > 1  # they do not end together

    run(6)
    compiled.clear()
    run(8)
    run(6)
    assert not compiled


@pytest.mark.more
def test_many_starts_show_how_far_they_are(monkeypatch, capsys):
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    starts = {"a": np.array([0.3, 2.0, 1.2]), "b": np.array([3.0, 0.2, 1.0])}
    many_starts(rosenbrock, starts, progress=False)
    assert capsys.readouterr().err == ""
    many_starts(rosenbrock, starts, progress=True)
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("many_starts: 3 of 3 starts (100%), ")
    steps = int(np.max(many_starts(rosenbrock, starts).steps))
    assert f"; step {steps}, lowest cost " in last


def test_an_interruption_of_many_starts_says_where_the_best_had_come(monkeypatch):
    """After the step that followed the end of the first: costs are known from single evaluations."""
    starts = {"a": np.array([0.3, 1.001, 1.2]), "b": np.array([3.0, 1.0, 1.0])}
    evaluate, tried, left = _many_starts.evaluate_rows, [], [3]

    def stopped(program, z, shared, todo, whole):
        if left[-1] < 3:
            raise KeyboardInterrupt
        left.append(todo.size)
        tried.append(np.exp(z[todo]))
        return evaluate(program, z, shared, todo, whole)

    monkeypatch.setattr(_many_starts, "evaluate_rows", stopped)
    with pytest.raises(KeyboardInterrupt) as caught:
        many_starts(lambda p: jnp.append(rosenbrock(p), 1.0), starts)
    a, b = np.concatenate(tried).T
    costs = 0.5 + 50.0 * (b - a**2) ** 2 + 0.5 * (1.0 - a) ** 2
    i = np.argmin(costs)
    said = str(caught.value)
    ended = re.match(
        rf"interrupted after {len(tried)} steps: no fit is kept; ([12]) of 3 starts had ended\. "
        r"The lowest cost was (.*), at a = (.*), b = (.*)\.$", said,
    )  # fmt: skip
    assert ended, said
    assert 3 - int(ended[1]) <= left[-1] < 3
    np.testing.assert_allclose(float(ended[2]), costs[i], rtol=1e-5)
    np.testing.assert_allclose([float(ended[3]), float(ended[4])], [a[i], b[i]], rtol=1e-3)


@pytest.mark.slow
def test_many_starts_through_events_are_single_fits():
    """Starts of unequal length of way, in chunks that do not fit, by both executors."""
    measured = data()
    starts = {name: value * np.array([1.0, 0.98, 1.01, 1.005, 0.995]) for name, value in START.items()}

    def residual(p, measured):
        return (positions(p) - measured) / SIGMA

    alone = fitted(starts, jnp.broadcast_to(measured, (5, 40)))
    for executor in ("portable", "auto"):
        found = many_starts(residual, starts, measured, chunk_size=2, executor=executor)
        assert bool(jnp.all(found.successful))
        np.testing.assert_array_equal(found.steps, alone.steps)
        np.testing.assert_allclose(products(found.values), products(alone.values), atol=1e-9)


def test_sensitivities_are_those_of_each():
    t = jnp.linspace(0.1, 1.0, 7)

    def residual(p, t):
        return p["a"] * jnp.exp(-p["b"] * t)

    rows = {"a": np.array([3.0, 1.0, 2.0]), "b": np.array([2.0, 0.5, 1.0])}
    times = np.stack([t, 2 * t, t + 1])
    found = sensitivities(residual, rows, times)
    for i in range(3):
        one = sensitivity(lambda p, i=i: residual(p, times[i]), {k: a[i] for k, a in rows.items()})
        np.testing.assert_allclose(found.matrix[i], one.matrix, rtol=1e-12)
    with pytest.raises(ValueError, match=r"each\[0\] = .*, of shape \(2, 7\): it must be"):
        sensitivities(residual, rows, times[:2])


def test_a_step_that_fails_is_refused():
    def residual(p):
        return jnp.where(p["a"] < 2.0, jnp.nan, jnp.stack([p["a"] - 2.5]))

    found = least_squares(residual, dict(a=50.0))
    assert float(found.values["a"]) == pytest.approx(2.5)


@pytest.mark.usefixtures("standard_dtype_promotion")
def test_gradient_descent():
    found = least_squares(rosenbrock, dict(a=0.6, b=0.6), GradientDescent(steps=2000))
    assert bool(found.successful)
    assert float(found.values["a"]) == pytest.approx(1.0, abs=1e-2)
    stopped = least_squares(rosenbrock, dict(a=0.6, b=0.6), GradientDescent(steps=3))
    assert not bool(stopped.successful)


@pytest.mark.slow
@pytest.mark.usefixtures("standard_dtype_promotion")
def test_gradient_descent_through_events():
    measured = data()

    @jax.jit
    def fit(start):
        method = GradientDescent(steps=1000)
        return least_squares(lambda p: (positions(p) - measured) / SIGMA, start, method)

    found = fit(START)
    assert np.max(np.abs(products(START))) > 0.02
    assert np.max(np.abs(products(found.values))) < 0.01


def test_bad_input():
    with pytest.raises(
        ValueError, match=r"residual\(values\) = an array of shape \(\): it must be one array"
    ):
        least_squares(lambda p: p["a"], dict(a=1.0))
    with pytest.raises(ValueError, match=r"residual\(values\) = a tuple"):
        sensitivity(lambda p: (p["a"], p["a"]), dict(a=1.0))
    single = least_squares(rosenbrock, dict(a=1.0, b=1.0))
    with pytest.raises(ValueError, match=r"fits = Fit, of shape"):
        best(single)


def test_bad_input_of_many_starts():
    rows = {"a": np.ones(3), "b": np.ones(3)}
    for starts, text in (
        ({"a": np.ones(3), "b": np.ones(2)}, "starts = .* of shapes"),
        ({"a": 1.0, "b": 1.0}, "starts = .* of shapes"),
        ({"a": np.ones(3), "b": np.array([1.0, np.nan, 1.0])}, r"starts\['b'\]\[1\] = nan"),
        ({"a": np.ones(3), "b": np.array([1.0, 1.0, -2.0])}, r"starts\['b'\]\[2\] = -2.0"),
    ):
        with pytest.raises(ValueError, match=text):
            many_starts(rosenbrock, starts)
    with pytest.raises(ValueError, match=r"shared\[0\]\['x'\]\[1\] = inf: it must be finite"):
        many_starts(lambda p, data: p["a"] - data["x"], rows, {"x": np.array([1.0, np.inf])})
    with pytest.raises(ValueError, match=r"starts = .*: it must be known"):
        jax.jit(lambda a: many_starts(rosenbrock, {"a": a, "b": a}).steps)(np.ones(3))
