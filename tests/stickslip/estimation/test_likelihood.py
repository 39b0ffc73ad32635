"""The likelihood: its slopes by everything, and what maximises it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.estimation import Gaussian, Noise, kalman_filter
from stickslip.identification import KalmanFilter, Observed, Problem, Record
from tests.stickslip.estimation._machines import Pushed, place
from tests.stickslip.estimation._truth import kicks_of, wander

T = 0.4 * np.arange(1, 13)


def likelihood(values, t, x):
    system = Pushed(values["static"], values["kinetic"], values["belt"])
    start = Gaussian(
        system.state(x=values["x"], v_x=values["belt"]), system.state(x=values["spread"], d=0.01)
    )
    noise = Noise({"x": values["noise"]}, system.state(d=values["wander"]))
    return kalman_filter(system, 0.0, start, t, {"x": x}, place, noise).log_likelihood


@pytest.mark.more
def test_slopes_are_those_of_differences_forward_and_reverse():
    values = {
        "static": 1.0, "kinetic": 0.5, "belt": 0.3, "x": 0.5, "spread": 0.02, "noise": 0.02,
        "wander": 0.03,
    }  # fmt: skip
    rng = np.random.default_rng(2)
    x = 0.5 + 0.3 * np.minimum(T, 1.7) + 0.02 * rng.normal(size=T.size)
    x[3] = np.nan
    reverse = jax.grad(likelihood)(values, T, x)
    for name, value in values.items():
        h = 1e-4 * value

        def at(a, name=name):
            return likelihood(values | {name: a}, T, x)

        inner, outer = at(value + h) - at(value - h), at(value + 2 * h) - at(value - 2 * h)
        difference = (8 * inner - outer) / (12 * h)
        assert float(reverse[name]) == pytest.approx(float(difference), rel=2e-6, abs=1e-6), name
    forward = jax.jvp(
        lambda f: likelihood(values | {"kinetic": f}, T, x), (jnp.asarray(0.5),), (jnp.asarray(1.0),)
    )[1]
    assert float(forward) == pytest.approx(float(reverse["kinetic"]), rel=1e-9)


@pytest.mark.more
def test_friction_and_the_wandering_of_a_force_are_found_by_the_likelihood():
    """A record of 40 s that drifts: within three standard errors, where the likelihood is largest."""
    truth = {
        "static": 1.0, "kinetic": 0.5, "belt": 0.3, "x": 0.0, "spread": 1e-3, "noise": 1e-3,
        "wander": 5e-3,
    }  # fmt: skip
    system, dt, count = Pushed(1.0, 0.5, 0.3), 0.2, 200
    t = dt * np.arange(1, count + 1)
    kicks = kicks_of(truth["wander"], dt, (count,), jax.random.key(7))
    y = system.state(v_x=0.3)

    @jax.jit
    def motion(y):
        def onwards(carry, row):
            (t, kick), (y, mode) = row, carry
            found = wander(system, t - dt, dt, y, mode, kick)
            return found, found[0].x

        return jax.lax.scan(onwards, (y, system.initial_mode(0.0, y, None)), (jnp.asarray(t), kicks))[1]

    x = np.asarray(motion(y)) + truth["noise"] * np.random.default_rng(7).normal(size=count)

    def pushed(p, inputs):
        return Pushed(p["static"], p["kinetic"], 0.3)

    fit = Problem(
        pushed, lambda p, inputs: pushed(p, inputs).state(v_x=0.3),
        {"static": 1.02, "kinetic": 0.49, "wander": 0.02},
        {"x": Observed(lambda t, y, system: y.x, truth["noise"], "m")},
        Record(t, {"x": x}, begin=0.0),
        correct=KalmanFilter(
            lambda p, inputs: pushed(p, inputs).state(d=p["wander"]),
            lambda p, inputs: pushed(p, inputs).state(x=truth["spread"], d=0.01),
        ),
    ).fit()  # fmt: skip
    assert fit.successful
    errors = fit.standard_errors()
    for name in fit.values:
        assert abs(float(fit.values[name]) - truth[name]) < 3.0 * float(errors[name]), str(fit)
    assert max(float(errors["static"]), float(errors["kinetic"])) < 0.03
    assert float(errors["wander"]) < 0.4 * truth["wander"]
    best = float(likelihood(truth | fit.values, t, x))
    for name, error in errors.items():
        for side in (-0.02, 0.02):
            moved = {name: float(fit.values[name]) + side * float(error)}
            assert float(likelihood(truth | fit.values | moved, t, x)) < best
