"""Steady loops in closed form: plays in NumPy, simulations under a prescribed motion, power laws."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.structure import Jenkins, LinearStructure, WithSliders, iwan, masing_loop

STRICT = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12), max_steps=100_000)
ROW = Jenkins([1.0], [1.0, 0.5, 2.0, 0.7], [0.3, 0.0, 0.2, 2.1])  # limits 0, 0.1, 0.3 and 3 m


def plays(element, xs):
    """Force of an element along a motion from rest, each slider by itself."""
    k, f = np.asarray(element.stiffness).ravel(), np.asarray(element.bound).ravel()
    z, forces = np.zeros(k.size), []
    for x in xs:
        z = np.clip(z, x - f / k, x + f / k)
        forces.append(np.sum(k * (x - z)))
    return np.array(forces)


def area(loop):
    x, f = np.asarray(loop.displacement), np.asarray(loop.force)
    return np.sum(0.5 * (f[..., 1:] + f[..., :-1]) * np.diff(x), axis=-1)


def test_one_slider_is_a_parallelogram():
    A, f_s, k_t = np.array([0.1, 0.2, 0.21, 5.0]), 0.1, 0.5
    loop = masing_loop(Jenkins([1.0], k_t, f_s), A)
    loss = np.array([0.0, 0.0, *(4 * f_s * (A[2:] - f_s / k_t))])
    np.testing.assert_allclose(loop.dissipation, loss, rtol=1e-14)
    np.testing.assert_allclose(loop.secant_stiffness, [0.5, 0.5, 0.1 / 0.21, 0.02], rtol=1e-14)
    np.testing.assert_allclose(loop.force[3], [-0.1, 0.1, 0.1, -0.1, -0.1], atol=1e-15)
    np.testing.assert_allclose(loop.displacement[3], [-5.0, -4.6, 5.0, 4.6, -5.0], atol=1e-14)
    # A spring and a dashpot at resonance, k = m w^2: the same loss in a turn.
    damping = 2.0 * loop.damping_ratio * loop.secant_stiffness / 1.3  # c = 2 zeta k / w
    np.testing.assert_allclose(np.pi * damping * 1.3 * A**2, loss, atol=1e-15)


@pytest.mark.parametrize("amplitude", [0.05, 0.1, 0.2, 0.9, 40.0])
def test_the_loop_is_that_of_plays_after_the_first_turn(amplitude):
    loop = masing_loop(ROW, amplitude)
    x = np.concatenate([[0.0, amplitude, -amplitude], np.asarray(loop.displacement)])
    np.testing.assert_allclose(loop.force, plays(ROW, x)[3:], atol=1e-13)
    assert float(loop.dissipation) == pytest.approx(area(loop), abs=1e-12)
    # Between the corners it is straight: no turn of any slider is missing.
    fine = np.linspace(-amplitude, amplitude, 1000)
    found = plays(ROW, np.concatenate([[0.0, amplitude, -amplitude], fine]))[3:]
    half = len(loop.force) // 2 + 1
    np.testing.assert_allclose(
        np.interp(fine, loop.displacement[:half], loop.force[:half]), found, atol=1e-12
    )


def loss(system, t, y, mode, args):
    """Of the element alone: the other powers are differences of numbers like those of the body."""
    return {"loss": -system.powers(t, y, mode, args)["friction of joint"]}


@pytest.mark.more
def test_it_is_the_simulation_under_a_prescribed_motion():
    # A body so heavy that the element does not disturb it: x = A cos t.
    heavy, amplitude = 1e13, 0.9
    system = WithSliders(LinearStructure([[heavy]], [[0.0]], [[heavy]]), {"joint": ROW})
    ledger = WithIntegrals(system, loss)
    begin = ledger.start(system.start(system.system.state()))
    begin = begin._replace(y=begin.y._replace(y=system.system.state([0.0], [amplitude])))
    times = np.array([2.5, 3.5, 4.5, *np.linspace(2.6, 4.4, 30)]) * np.pi
    run = ss.simulate(
        ledger, 0.0, 4.5 * np.pi, begin, integrator=STRICT, saveat=ss.SaveAt(ts=np.sort(times))
    )  # fmt: skip
    loop, y = masing_loop(ROW, amplitude), run.outputs.y.y
    force = jax.jit(jax.vmap(system.slider_forces))(run.outputs.t, y, run.outputs.mode)["joint"]
    x, loads = np.asarray(y.y.q[:, 0]), np.asarray(y.y.v[:, 0]) > 0.0
    np.testing.assert_allclose(x, amplitude * np.sin(np.asarray(run.outputs.t)), atol=1e-10)
    half = len(loop.force) // 2 + 1
    forth = np.interp(x, loop.displacement[:half], loop.force[:half])
    back = np.interp(x, loop.displacement[half - 1 :][::-1], loop.force[half - 1 :][::-1])
    # Farther than rounding from the ends, where either branch is right.
    inside = np.abs(x) < amplitude - 1e-6
    assert inside.sum() > 25
    np.testing.assert_allclose(np.where(loads, forth, back)[inside], force[inside], atol=1e-9)
    lost = np.asarray(run.outputs.y.integrals["loss"])
    turn = lost[-1] - lost[np.searchsorted(np.asarray(run.outputs.t), 2.5 * np.pi - 1e-9)]
    assert turn == pytest.approx(float(loop.dissipation), abs=1e-9)


@pytest.mark.more
@pytest.mark.parametrize(("exponent", "ratio"), [(-0.3, 0.5), (-0.8, 0.0), (0.0, 2.0)])
def test_small_loops_of_a_joint_lose_by_segalmans_power(exponent, ratio):
    slip_force, stiffness = 2.0, 5.0
    joint = iwan([1.0], slip_force, stiffness, exponent, ratio, 4000)
    share = ratio + (exponent + 1) / (exponent + 2)
    most = slip_force * (1 + ratio) / (stiffness * share)
    A = most * np.array([0.02, 0.04, 0.08])
    R = slip_force * (exponent + 1) / (most ** (exponent + 2) * share)
    # The integral of 4 phi (A - phi) R phi^chi over the limits below A.
    loss = 4 * R * A ** (exponent + 3) / ((exponent + 2) * (exponent + 3))
    found = np.asarray(masing_loop(joint, A).dissipation)
    np.testing.assert_allclose(found, loss, rtol=1e-3)  # of 80 sliders; (1/80)^2 and a little
    slope = np.diff(np.log(found)) / np.log(2.0)
    np.testing.assert_allclose(slope, 3.0 + exponent, atol=5e-4)


def test_its_ends_at_rest_without_force_and_at_any_scale():
    at_rest = masing_loop(ROW, 0.0)
    assert float(at_rest.secant_stiffness) == pytest.approx(3.7)  # but for the slider without force
    assert float(at_rest.dissipation) == float(at_rest.damping_ratio) == 0.0
    none = masing_loop(Jenkins([1.0], [1.0, 2.0], 0.0), [0.0, 0.3])
    for part in none[1:]:
        np.testing.assert_array_equal(part, np.zeros_like(part))
    # Nearly without force it is a rectangle, of the ratio 2/pi.
    assert float(masing_loop(Jenkins([1.0], 1.0, 1e-12), 1.0).damping_ratio) == pytest.approx(2 / np.pi)
    for scale in (1e-150, 1e150):
        near, far = masing_loop(ROW, 0.2), masing_loop(
            Jenkins([1.0], ROW.stiffness / scale, ROW.bound), 0.2 * scale
        )  # fmt: skip
        np.testing.assert_allclose(far.force, near.force, atol=1e-14)
        np.testing.assert_allclose(far.dissipation / scale, near.dissipation, rtol=1e-13)
        np.testing.assert_allclose(far.damping_ratio, near.damping_ratio, rtol=1e-13)
    # A traced amplitude that is negative is told.
    wrong = jax.jit(lambda a: masing_loop(ROW, a))(-0.2)
    assert all(bool(jnp.all(jnp.isnan(part))) for part in wrong)


@pytest.mark.more
def test_lanes_batches_and_derivatives():
    A = np.array([[0.05, 0.2], [0.9, 4.0]])
    whole = masing_loop(ROW, A)
    mapped = ss.map_lanes(lambda a: masing_loop(ROW, a))(A.ravel())
    assert whole.force.shape == (2, 2, 11)
    for one, other in zip(whole, mapped, strict=True):
        np.testing.assert_allclose(one.reshape(other.shape), other, atol=1e-13)

    def numbers(p):
        loop = masing_loop(Jenkins([1.0], p[0] * ROW.stiffness, p[1] * ROW.bound), p[2])
        return jnp.concatenate([loop.displacement, loop.force, jnp.stack(loop[2:])])

    at, h = np.array([1.1, 0.9, 0.47]), 1e-6
    ends = jax.jit(jax.vmap(numbers))(at + h * np.concatenate([np.eye(3), -np.eye(3)]))
    central = (ends[:3] - ends[3:]) / (2 * h)
    forward, back = jax.jit(lambda p: (jax.jacfwd(numbers)(p), jax.jacrev(numbers)(p)))(at)
    np.testing.assert_allclose(forward, central.T, atol=1e-8)
    np.testing.assert_allclose(back, forward, atol=1e-13)
    assert np.all(np.isfinite(jax.jit(jax.jacfwd(numbers))(np.array([1.0, 1.0, 0.0]))))


def test_a_bound_that_is_a_function_is_named():
    with pytest.raises(ValueError, match=r"element = Jenkins: .* numbers"):
        masing_loop(Jenkins([1.0], 1.0, lambda t, q, args: 0.1), 0.3)
