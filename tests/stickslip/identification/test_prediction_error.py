"""Innovation form with a known gain: the Kalman filter of a linear Gaussian loop, written by hand."""

from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import stickslip as ss
from stickslip.identification import MultipleShooting, Observed, Problem, Record, Unknown

TRUTH = {"decay": 0.5, "gain": 1.0}
STEP = 0.05
DRIVE = 3.0  # of the controller
PROCESS, SENSOR = 0.3, 0.1


def steady() -> tuple[float, float, float]:
    """Variance of the process per step, gain of the steady filter, deviation of its innovations."""
    phi = np.exp(-TRUTH["decay"] * STEP)
    process = PROCESS**2 * (1.0 - phi**2) / (2.0 * TRUTH["decay"])
    square = [np.array([[value]]) for value in (phi, 1.0, process, SENSOR**2)]
    p = scipy.linalg.solve_discrete_are(*square)[0, 0]
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
