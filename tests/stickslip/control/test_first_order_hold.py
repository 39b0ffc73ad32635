"""An output that goes on between samples: cubics, whose stops and break-aways are roots."""

import jax
import numpy as np
import pytest

import stickslip as ss
from stickslip.control import PID, Extrapolated, FirstOrderHold, WithController
from tests.stickslip.control._axis import Axis, begin

T, STATIC, KINETIC = 0.02, 1.5, 1.0


def first(polynomial, until):
    """The first root within a time, from 0 on but not at it."""
    roots = np.roots(polynomial)
    roots = roots.real[(np.abs(roots.imag) < 1e-12) & (roots.real > 1e-9) & (roots.real < until)]
    return np.min(roots, initial=np.inf)


def reference(kp, ki, kd, samples, x, delay=0, latency=0.0):
    """Position, speed, and how often it stopped or broke away."""
    v = total = last = u = slope = 0.0
    events, outputs = 0, []

    def move(lasts):
        nonlocal x, v, u, events
        while lasts > 0.0:
            if v == 0.0 and abs(u) <= STATIC:
                limit = np.copysign(STATIC, slope)
                step = min((limit - u) / slope if slope else np.inf, lasts)
                u, lasts = u + slope * step, lasts - step
                if lasts > 0.0:
                    events, u = events + 1, limit * (1 + 1e-15)
                continue
            a = u - KINETIC * np.sign(v if v else u)
            step = min(first([0.5 * slope, a, v] if v else [0.5 * slope, a], lasts), lasts)
            x += v * step + 0.5 * a * step**2 + slope * step**3 / 6.0
            v += a * step + 0.5 * slope * step**2
            u, lasts = u + slope * step, lasts - step
            if lasts > 0.0:
                v, events = 0.0, events + 1

    for k in range(samples):
        total += -ki * T * x
        now = -kp * x + total - kd * v
        outputs.append((now, (now - last) / T))
        last = now
        move(latency)
        u, slope = outputs[k - delay] if k >= delay else (0.0, 0.0)
        move(T - latency)
    return x, v, events


def end(kp, ki, kd, samples, x, throw=True, **late):
    pid = PID(kp, ki, kd, period=T)
    hold = FirstOrderHold(pid, period=T)
    loop = WithController(Axis(STATIC, KINETIC), hold, T, hold.state(), **late)
    return ss.simulate(loop, 0.0, samples * T, begin(loop, x), throw=throw)


@pytest.mark.more
@pytest.mark.parametrize(
    "late", [{}, pytest.param({"delay": 1, "latency": 0.007}, marks=pytest.mark.slow)]
)
def test_random_loops_with_their_derivatives(late):
    def row(gains):
        run = end(*gains, 150, 0.1, throw=False, **late)
        return run.y1.y.x, (run.y1.y.v_x, run.num_events, run.flags)

    gains = np.random.default_rng(4).uniform([20.0, 20.0, 4.0], [60.0, 80.0, 9.0], (12, 3))
    (x, (v, events, flags)), slopes = jax.jit(jax.vmap(jax.value_and_grad(row, has_aux=True)))(gains)
    for i, (kp, ki, kd) in enumerate(gains):
        known = reference(kp, ki, kd, 150, 0.1, **late)
        assert float(x[i]) == pytest.approx(known[0], abs=1e-12)
        assert float(v[i]) == pytest.approx(known[1], abs=1e-11)
        assert int(events[i]) == known[2]
        for j, h in enumerate(1e-5 * np.eye(3)):
            ends = [reference(*(gains[i] + sign * h), 150, 0.1, **late) for sign in (-1, 1)]
            if ends[0][2] == ends[1][2] and int(flags[i]) == 0:
                slope = (ends[1][0] - ends[0][0]) / 2e-5
                assert float(slopes[i, j]) == pytest.approx(slope, rel=1e-6, abs=1e-9), (i, j)
    assert int(np.max(events)) >= 3


def test_it_breaks_away_between_samples():
    """The output of a ramp is a ramp: the block at rest moves when it is 1.5 N, at 0.75 s."""

    def rising(k, t, measured, state, args):
        return 2.0 * t, state

    hold = FirstOrderHold(rising, period=0.1)
    loop = WithController(Axis(STATIC, KINETIC), hold, 0.1, Extrapolated(0.0, 0.0))
    run = ss.simulate(loop, 0.0, 1.0, begin(loop, 0.0))
    assert float(run.events.t[0]) == pytest.approx(0.75, abs=1e-13)
    # v' = 2 t - 1 from there on.
    assert float(run.y1.y.v_x) == pytest.approx(0.75 - 0.75**2, abs=1e-12)
