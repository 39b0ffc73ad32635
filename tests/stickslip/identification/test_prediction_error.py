"""Innovation form: the Kalman filter of a linear loop, with a known gain and by its likelihood."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import stickslip as ss
from stickslip.identification import (
    Huber,
    KalmanFilter,
    LevenbergMarquardt,
    MultipleShooting,
    Observed,
    Problem,
    Record,
    Unknown,
    compare,
)
from stickslip.identification._corrections import involute

TRUTH = {"decay": 0.5, "gain": 1.0}
STEP = 0.05
DRIVE = 3.0  # of the controller
PROCESS, SENSOR = 0.3, 0.1


def steady() -> tuple[float, float, float]:
    """Variance of the process per step, gain of the steady filter, deviation of its innovations."""
    phi = np.exp(-TRUTH["decay"] * STEP)
    process = PROCESS**2 * (1.0 - phi**2) / (2.0 * TRUTH["decay"])
    a, b, q, r = (np.array([[value]]) for value in (phi, 1.0, process, SENSOR**2))
    p = scipy.linalg.solve_discrete_are(a, b, q, r)[0, 0]
    return process, p / (p + SENSOR**2), np.sqrt(p + SENSOR**2)


VARIANCE, KALMAN, DEVIATION = steady()


class Speed(NamedTuple):
    v: Any


class Lag(ss.AbstractSmoothSystem):
    """A speed that decays, driven by a command that is held."""

    decay: Any
    gain: Any
    command: Any
    units: ClassVar = {"v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return Speed(self.gain * self.command(t) - self.decay * y.v)


def logged(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Measured speed and command of the loop: the controller answers noise of both kinds."""
    rng = np.random.default_rng(seed)
    a, b = TRUTH.values()
    phi, v, rows = np.exp(-a * STEP), 0.0, []
    for t in STEP * np.arange(count):
        y = v + SENSOR * rng.normal()
        u = DRIVE * (0.4 * np.sin(1.3 * t) + 0.2 * np.sin(2.9 * t) - y)
        rows.append((y, u))
        v = phi * v + b / a * (1.0 - phi) * u + np.sqrt(VARIANCE) * rng.normal()
    speed, command = np.array(rows).T
    return speed, command


def innovations(p: Any, speed: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Of the filter in closed form; where the record begins nothing is corrected."""
    a, b = p
    phi, v, rows = np.exp(-a * STEP), 0.0, []
    for k, (y, u) in enumerate(zip(speed, command, strict=True)):
        rows.append((v - y) / DEVIATION)
        v = phi * (v + (KALMAN * (y - v) if k and np.isfinite(y) else 0.0)) + b / a * (1.0 - phi) * u
    return np.array(rows)[np.isfinite(speed)]


def corrected(values, state, innovations):
    return Speed(state.v + KALMAN * innovations["v"])


def problem(speed: np.ndarray, command: np.ndarray, correct: Any = corrected) -> Problem:
    times = STEP * np.arange(speed.size)
    return Problem(
        lambda p, inputs: Lag(p["decay"], p["gain"], inputs["command"]), lambda p, inputs: Speed(0.0),
        {name: Unknown(value) for name, value in TRUTH.items()},
        {"v": Observed(lambda t, y, system: y.v, DEVIATION, "m/s")},
        Record(times, {"v": speed}, inputs={"command": command}, missing="nan"),
        integrator=ss.Integrator("tsit5", ss.AdaptiveStep(1e-9, 1e-9)), correct=correct,
    )  # fmt: skip


def test_residuals_are_the_innovations_of_the_kalman_filter():
    speed, command = logged(0, 30)
    speed[[7, 8, 20]] = np.nan
    given = problem(speed, command)
    for p in (tuple(TRUTH.values()), (0.9, 0.7)):
        found = given.residual(dict(zip(TRUTH, p, strict=True)))
        np.testing.assert_allclose(found, innovations(p, speed, command), rtol=0, atol=1e-7)
    with pytest.raises(ValueError, match="another than MultipleShooting"):
        given.fit(method=MultipleShooting(3))


def test_records_of_different_lengths_are_corrected_alike():
    speed, command = logged(1, 30)
    times = STEP * np.arange(30)
    cut = Record(times[:20], {"v": speed[:20]}, inputs={"command": command[:20]})
    whole = Record(times, {"v": speed}, inputs={"command": command})
    both = problem(speed, command).with_records([cut, whole]).residual(TRUTH)
    every = innovations(tuple(TRUTH.values()), speed, command)
    np.testing.assert_allclose(both, np.concatenate([every[:20], every]), rtol=0, atol=1e-7)


# Some of the fits that simulate from the beginning are said not to explain the data.
@pytest.mark.filterwarnings("ignore:The fit converged, and its reduced chi squared:UserWarning")
@pytest.mark.slow
def test_noise_within_the_motion_does_not_bias_the_fit():
    """As an input the measured command answers the noise of the motion: simulated from the beginning
    the loop is taken for another. Innovations give the estimate of maximum likelihood."""
    off: dict[str, list] = {"innovations": [], "simulation": []}
    first = {"innovations": problem(*logged(0, 300)), "simulation": problem(*logged(0, 300), None)}
    for seed in range(16):
        log = logged(seed, 300)
        for name, one in first.items():
            fit = one.with_records(problem(*log).records).fit()
            values = np.array([float(fit.values[n]) for n in TRUTH])
            off[name].append(values / list(TRUTH.values()) - 1.0)
            if name == "innovations":
                theirs = scipy.optimize.least_squares(innovations, values, args=log, xtol=1e-14)
                np.testing.assert_allclose(values, theirs.x, rtol=0, atol=1e-5)
    told = {}
    for name, rows in off.items():
        told[name] = np.mean(rows, axis=0), np.std(rows, axis=0, ddof=1) / np.sqrt(len(rows))
    mean, error = told["innovations"]
    assert np.all(np.abs(mean) < 3.0 * error), told
    mean, error = told["simulation"]
    assert np.max(np.abs(mean) / error) > 5.0, told
    assert np.max(np.abs(mean)) > 0.2, told


SENSORS = {"v": SENSOR, "again": 2.0 * SENSOR}  # which both measure the speed


def filtered(rows, command, spread=0.2):
    """Problem whose density of the noise in the motion is an unknown."""
    times = STEP * np.arange(command.size)
    return Problem(
        lambda p, inputs: Lag(p["decay"], TRUTH["gain"], inputs["command"]),
        lambda p, inputs: Speed(0.0), {"decay": 0.6, "density": 0.2},
        {name: Observed(lambda t, y, system: y.v, SENSORS[name], "m/s") for name in rows},
        Record(times, rows, inputs={"command": command}, missing="nan"),
        integrator=ss.Integrator("tsit5", ss.AdaptiveStep(1e-9, 1e-9)),
        correct=KalmanFilter(lambda p, inputs: Speed(p["density"]), lambda p, inputs: Speed(spread)),
    )  # fmt: skip


def by_hand(decay, density, rows, command, spread=0.2):
    """Innovations of the filter of Kalman in their standard deviations, and these in those of the
    sensors, in closed form: one sensor after the other."""
    phi = np.exp(-decay * STEP)
    noise = density**2 * (1.0 - phi**2) / (2.0 * decay)
    v, p, found = 0.0, spread**2, {name: [] for name in rows}
    for k, u in enumerate(command):
        for name, row in rows.items():
            if np.isfinite(row[k]):
                off, size = row[k] - v, p + SENSORS[name] ** 2
                found[name].append((-off / np.sqrt(size), np.sqrt(size) / SENSORS[name]))
                v, p = v + p / size * off, p * SENSORS[name] ** 2 / size
        v, p = phi * v + TRUTH["gain"] / decay * (1.0 - phi) * u, phi**2 * p + noise
    return np.concatenate([np.array(part) for part in found.values()]).T


def two_records():
    """Two records of unlike lengths with two sensors, values missing, and an input that jumps: the
    problem of both, its residuals and logarithms by hand, and the rows of each."""
    speed, command = logged(3, 30)
    speed[[7, 8, 20]] = np.nan
    again = logged(3, 30)[0] + 2.0 * SENSOR * np.random.default_rng(4).normal(size=30)
    times, lengths = STEP * np.arange(30), (12, 30)

    def cut(n):
        return {"v": speed[:n], "again": again[:n]}

    records = [
        Record(times[:n], cut(n), inputs={"command": command[:n]}, missing="nan", name=str(n))
        for n in lengths
    ]
    given = filtered(cut(30), command).with_records(records)

    def parts(decay, density):
        both = np.hstack([by_hand(decay, density, cut(n), command[:n]) for n in lengths])
        return np.stack([both[0], np.log(both[1])])

    return given, parts, [cut(n) for n in lengths]


def test_half_the_sum_of_squares_is_the_likelihood():
    given, parts, _ = two_records()
    for p in ((0.5, 0.3), (0.9, 0.0001)):
        white, logs = parts(*p)
        row = np.asarray(given.residual({"decay": p[0], "density": p[1]}))
        np.testing.assert_allclose(row[: white.size], white, rtol=0, atol=1e-7)
        assert np.sum(row**2) == pytest.approx(np.sum(white**2) + np.sum(1.0 + 2.0 * logs), rel=1e-9)


def test_an_involute_turns_by_the_root_of_its_length():
    arc, h = jnp.array([-0.1, 0.02, 0.7, 3.0]), 1e-6
    found = jax.vmap(jax.jacfwd(involute))(arc)
    expected = [(a - b) / (2 * h) for a, b in zip(involute(arc + h), involute(arc - h), strict=True)]
    np.testing.assert_allclose(np.stack(found)[:, 1:], np.stack(expected)[:, 1:], rtol=0, atol=1e-8)
    np.testing.assert_array_equal(np.stack(found)[:, 0], [1.0, 0.0])  # at its cusp


@pytest.mark.more
def test_the_curvature_of_a_fit_is_that_of_fisher():
    given, parts, cuts = two_records()
    # In logarithms of the unknowns.
    fit = given.fit()
    z, h = np.log([float(fit.values[name]) for name in ("decay", "density")]), 1e-5
    moved = [parts(*np.exp(z + h * e)) - parts(*np.exp(z - h * e)) for e in np.eye(2)]
    slopes = np.array(moved).reshape(2, -1) / (2.0 * h)
    matrix = np.asarray(fit.sensitivity.matrix)
    np.testing.assert_allclose(matrix.T @ matrix, slopes @ slopes.T, rtol=1e-5)
    white, logs = parts(*np.exp(z))
    slope = slopes @ np.concatenate([white, np.ones(logs.size)])
    np.testing.assert_allclose(slope, 0.0, atol=1e-3)
    size, logs = np.sum(white**2), 2.0 * np.sum(logs)
    assert float(fit.log_spread) == pytest.approx(logs, abs=1e-6)
    assert float(fit.reduced_chi_squared) == pytest.approx(size / (white.size - 2), rel=1e-6)
    assert compare({"a": fit}).table["aic"][0] - 2 * 2 == pytest.approx(size + logs, abs=1e-6)
    for part, rows in zip(given.parts(given.residual(fit.values)).values(), cuts, strict=True):
        assert {name: row.size for name, (_, row) in part.items()} == {
            name: np.isfinite(row).sum() for name, row in rows.items()
        }


def test_a_robust_loss_has_no_likelihood():
    speed, command = logged(3, 30)
    with pytest.raises(ValueError, match=r"loss = .*: it must be None where a KalmanFilter corrects"):
        filtered({"v": speed}, command).fit(method=LevenbergMarquardt(loss=Huber()))


@pytest.mark.slow
def test_how_fast_a_motion_wanders_is_found_with_an_interval():
    """Coverage of both intervals over 200 records, of the stated and of the robust errors."""
    program, held = None, np.zeros((2, 2))
    for seed in range(200):
        rng = np.random.default_rng(10_000 + seed)
        phi, v, rows = np.exp(-0.5 * STEP), 0.2 * rng.normal(), []
        command = np.where(np.sin(1.3 * STEP * np.arange(400)) > 0.0, 0.5, -0.5)
        for u in command:
            rows.append(v + SENSOR * rng.normal())
            v = phi * v + 2.0 * (1.0 - phi) * u + np.sqrt(VARIANCE) * rng.normal()
        record = Record(STEP * np.arange(400), {"v": np.array(rows)}, inputs={"command": command})
        program = filtered({"v": np.array(rows)}, command) if program is None else program
        fit = program.with_records(record).fit()
        for i, robust in enumerate((False, True)):
            for j, (name, truth) in enumerate({"decay": 0.5, "density": PROCESS}.items()):
                value, error = float(fit.values[name]), float(fit.standard_errors(robust)[name])
                held[i, j] += abs(np.log(value / truth)) < 1.96 * error / value
    assert np.all((held > 180) & (held < 200)), held  # 190 less or more three standard deviations
