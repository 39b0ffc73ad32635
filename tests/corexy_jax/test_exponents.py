"""Lyapunov exponents of the machine where a motor rolls: the belt takes a direction away."""

import numpy as np
import pytest

import corexy_jax as cx
import stickslip as ss
from stickslip.analysis import Segments, lyapunov_spectrum


@pytest.mark.slow
def test_exponents_of_a_machine_that_rolls_on_one_motor():
    """Constant voltages: each speed decays by the back-emf, with the inertia that its mode leaves it.

    With the velocities $q = B z$ that the resting contacts allow: $B^T M B \\dot z = -B^T D B z$.
    """
    p, _ = cx.scenario(1)
    machine = cx.CoreXY(p, cx.UserVoltage(lambda t, args: (6.0 + 0.0 * t, 3.0 + 0.0 * t)))
    integrator = ss.Integrator("tsit5", ss.AdaptiveStep(1e-9, 1e-11), max_steps=1_000_000)
    found = lyapunov_spectrum(machine, machine.state(), Segments(0.02, 200, 2.0), integrator=integrator)
    assert machine.mode_names[int(found.mode1)] == "RS +++0++0+"
    resting = machine.directions[np.asarray(machine.states(found.mode1)) == 0.0]
    assert np.linalg.matrix_rank(resting) == 2
    allowed = np.linalg.svd(resting)[2][2:].T
    damping = np.diag([0.0, 0.0, 1.0, 1.0]) * float(p.K_t * p.K_e / (p.R * p.r**2))
    inertia = np.diag(np.asarray(machine.mass_matrix(None), float))
    rates = np.linalg.eigvals(
        np.linalg.solve(allowed.T @ inertia @ allowed, -allowed.T @ damping @ allowed)
    )
    assert found.words.tolist() == ["ok"] * 7 + ["lost"] * 2
    np.testing.assert_allclose(found.exponents[:5], 0.0, atol=1e-4)
    np.testing.assert_allclose(found.exponents[5:7], np.sort(rates)[::-1], rtol=1e-6)


def test_a_mode_in_which_a_belt_that_slides_would_hold():
    """Modes of this machine have names of their own: the contacts at rest are read from the mode."""
    p, voltage = cx.scenario(1)
    machine = cx.CoreXY(p, voltage)
    moving = machine.state(vx=0.5, vy=0.25, omega_1=10.0)
    with pytest.raises(ValueError, match=r"mode0 = 'RR 0{8}', and it slides at .*contact"):
        ss.simulate(machine, 0.0, 1.0, moving, "RR 00000000")
    machine.check_start(0.0, machine.state(), 0, None)
