"""Programs on which XLA aborted the process: fused calls with an operand that nothing depends on.

Constants as parameters (moved into the call), results nobody reads (the loop stops carrying them),
and arrays the system closes over (lifted to operands) each made one.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid.executor import FUSED, use_executor
from stickslip.systems import CoulombOscillator, Motion

SPEEDS = jnp.linspace(0.2, 0.4, 200)
STEP = ss.Integrator(method="tsit5", step=ss.FixedStep(0.1))


def logged(v, mass):
    block = CoulombOscillator(mass, 1.0, 1.0, 0.5, v)
    return ss.simulate(block, 0.0, 8.0, Motion(x=0.0, v=v), "stick").y1.x


def unread(v, mass):
    block = CoulombOscillator(mass, 1.0, 1.0, 0.5, v)
    start = Motion(x=0.0 * v, v=v)
    return ss.simulate(
        block, 0.0, 8.0, start, "stick", integrator=STEP, saveat=ss.SaveAt(max_events=None), throw=False
    ).y1.x


def lanes(function, executor):
    return ss.map_lanes(function, executor=executor)(SPEEDS)


@pytest.mark.more
@pytest.mark.parametrize("function", [logged, unread])
@pytest.mark.parametrize("mass", [1.0, np.array(1.0)], ids=["number", "array"])
def test_constants_and_unread_results(function, mass):
    fused, portable = (lanes(lambda v: function(v, mass), e) for e in ("fused", "portable"))
    # Rounding moves the adaptive steps of `logged`, their own error is 1e-9.
    np.testing.assert_allclose(fused, portable, rtol=0, atol=1e-11)


def test_a_single_lane():
    def one(v):
        return unread(v, jnp.asarray(1.0))

    with use_executor(FUSED):
        fused = jax.jit(one)(0.3)
    np.testing.assert_allclose(fused, jax.jit(one)(0.3), rtol=0, atol=1e-13)


def test_a_run_alone_with_its_log():
    with use_executor(FUSED):
        fused = logged(0.3, 1.0)
    np.testing.assert_allclose(fused, logged(0.3, 1.0), rtol=0, atol=1e-11)


@pytest.mark.more
@pytest.mark.parametrize(
    "derivative",
    [pytest.param(jax.grad, marks=pytest.mark.slow), jax.jacfwd],
    ids=["reverse", "forward"],
)
def test_derivatives_of_recorded_crossings(derivative):
    """Counts of rows come out of a fused call with zero tangents, which no reduction could take."""
    section = ss.Section(lambda system, t, y, dy, mode, args: dy.v + 0.2, "rising")

    def times(v):
        block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, v)
        start = Motion(x=0.0 * v, v=v)
        run = ss.simulate(
            block, 0.0, 8.0, start, "stick",
            saveat=ss.SaveAt(sections=section, max_events=4, max_crossings=2), integrator=STEP,
            throw=False,
        )  # fmt: skip
        return run.crossings[0].t[0]

    # Release at 1/v; then x falls through 0.7 at the angle that belongs to it.
    v = np.asarray(SPEEDS)
    h = 1e-6

    def truth(v):
        amplitude, phase = np.hypot(0.5, v), np.arctan2(v, 0.5)
        return 1.0 / v + phase + np.arccos(0.2 / amplitude)

    slope = (truth(v + h) - truth(v - h)) / (2 * h)
    np.testing.assert_allclose(lanes(derivative(times), "fused"), slope, rtol=1e-6)
