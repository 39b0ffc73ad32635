"""One compiled program for all three scenarios, shared by the tests."""

import functools
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import corexy_jax as cx
import stickslip as ss

ROWS = 601


class Either(cx.AbstractVoltage):
    """The harmonic or the square wave, straight or exchanged, by numbers: one program for all."""

    harmonic: cx.Harmonic
    square: cx.SquareWave
    choice: Any
    swap: Any

    has_breaks: ClassVar[bool] = True

    def volts(self, t, piece):
        pairs = zip(self.square.volts(t, piece), self.harmonic.volts(t, piece), strict=True)
        one, two = (jnp.where(self.choice > 0, a, b) for a, b in pairs)
        return jnp.where(self.swap > 0, two, one), jnp.where(self.swap > 0, one, two)

    def piece_of(self, t):
        return jnp.where(self.choice > 0, self.square.piece_of(t), 0.0)

    def piece_end(self, piece):
        return jnp.where(self.choice > 0, self.square.piece_end(piece), self.harmonic.piece_end(piece))


def shared(number: int, swap: float = 0.0) -> tuple[cx.CoreXYParameters, Either]:
    """Scenario with its input as one shape of `Either`, the motors exchanged if `swap` is 1."""
    p, v = cx.scenario(number)
    amplitudes = (v.v01, v.v02)  # pyright: ignore[reportAttributeAccessIssue]
    choice = jnp.asarray(1.0 if number == 3 else 0.0)
    return p, Either(cx.Harmonic(*amplitudes), cx.SquareWave(*amplitudes), choice, jnp.asarray(swap))


@eqx.filter_jit
def run(p, v, t1, tolerance) -> cx.CoreXYSolution:
    step = ss.AdaptiveStep(tolerance, tolerance)
    integrator = ss.Integrator(step=step)
    return cx.simulate_consistent(p, v, t1, rows=ROWS, integrator=integrator, max_events=128)


@functools.cache
def solution(number: int, tolerance: float = 1e-10) -> cx.CoreXYSolution:
    """The motion of a scenario over 6 s at 601 times."""
    return run(*shared(number), jnp.asarray(6.0), jnp.asarray(tolerance))


def columns(s: cx.CoreXYSolution) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities `[time, 4]` in the order of the reference."""
    y = s.y
    position = np.stack([y.x, y.y, y.theta_1, y.theta_2], axis=1)
    return position, np.stack([y.vx, y.vy, y.omega_1, y.omega_2], axis=1)
