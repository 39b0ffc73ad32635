"""Derivatives through contacts of declared machines: both modes, closed form, central differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from tests.stickslip.mechanism._machines import (
    Arm,
    Bouncing,
    Chain,
    Oscillator,
    Train,
    carriage,
    flat,
)


def block_end(p):
    v, fs, fk = p
    block = Oscillator(1.0, 1.0, Coulomb(fs, fk), v)
    return ss.simulate(block, 0.0, 30.0, block.state(v_x=v), saveat=ss.SaveAt(max_events=None)).y1.x


@pytest.mark.more
def test_one_contact_as_the_closed_form():
    p = jnp.array([0.2, 1.0, 0.5])
    expected = [16.2232182593, -5.1724137931, 5.1724137931]
    np.testing.assert_allclose(jax.jit(jax.jacfwd(block_end))(p), expected, rtol=1e-8)
    np.testing.assert_allclose(jax.jit(jax.grad(block_end))(p), expected, rtol=1e-8)


def row_of(kind):
    def run(p):
        speed, kinetic, mass, first = p
        laws = tuple(Coulomb(1.0 + 0.1 * i, kinetic) for i in range(3))
        machine = kind(mass, 1.0, 2.0, laws, speed, 3)
        # Places 0.5, -0.8 and 0, or the distances between them.
        other = dict(x_2=-0.8) if kind is Chain else dict(x_2=-0.8 - first, x_3=0.8)
        y0 = machine.state(x_1=first, **other)
        return ss.simulate(machine, 0.0, 18.0, y0, saveat=ss.SaveAt(max_events=None))

    return run, [0.2, 0.6, 1.0, 0.5], 6


def arm_run(p):
    mass, torque, shoulder, elbow = p
    machine = Arm(mass, torque, (Coulomb(shoulder, 0.7), Coulomb(0.8, elbow)))
    return ss.simulate(
        machine, 0.0, 6.0, machine.state(a=0.3, b=-0.4, v_a=1.0), saveat=ss.SaveAt(max_events=None)
    )


def lifted(p):
    pad, lift, kinetic, speed = p
    machine = Bouncing(pad, lift, 1.7, Coulomb(0.5, kinetic), speed)
    return ss.simulate(
        machine, 0.0, 9.0, machine.state(x=0.3, y=-0.1), saveat=ss.SaveAt(max_events=None)
    )


def pulled(p):
    """Four contacts of two velocities, which give way together."""
    static, amplitude = p
    machine = carriage(static, amplitude)
    return ss.simulate(machine, 0.0, 9.0, machine.state(), saveat=ss.SaveAt(max_events=None))


CASES = {
    "chain": row_of(Chain),
    "chain, full mass matrix": row_of(Train),
    "arm": (arm_run, [1.0, 3.0, 1.0, 0.5], 4),
    "opening contact": (lifted, [5.0, 3.0, 0.3, 0.2], 6),
    "dependent contacts": (pulled, [1.3, 3.0], 6),
}
QUICK = ("opening contact",)
FORWARD = [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in CASES]


def differences(run, p, h=1e-5):
    """Central differences; all runs in one program, all through the same events."""
    moved = p[None] + h * jnp.concatenate([jnp.zeros((1, len(p))), jnp.eye(len(p)), -jnp.eye(len(p))])

    def end(p):
        found = run(p)
        return flat(found.y1), found.sequence, found.num_events, found.flags

    ends, sequence, events, flags = jax.jit(jax.vmap(end))(moved)
    assert (sequence == sequence[0]).all()
    assert (flags == 0).all()
    n = len(p)
    return (ends[1 : n + 1] - ends[n + 1 :]).T / (2 * h), int(events[0])


@pytest.mark.more
@pytest.mark.parametrize("name", FORWARD)
def test_both_modes_as_central_differences(name):
    agree_with_differences(*CASES[name])


def agree_with_differences(run, p, least, h=1e-5):
    """Forward and reverse derivatives of the end of `run(p)`, which has `least` events or more."""
    p = jnp.array(p)
    expected, events = differences(run, p, h)
    assert events >= least
    size = np.abs(expected).max()

    def end(p):
        return flat(run(p).y1)

    forward = jax.jit(jax.jacfwd(end))(p)
    np.testing.assert_allclose(forward, expected, atol=2e-6 * size)
    weights = jnp.cos(jnp.arange(len(expected), dtype=jnp.float64))
    reverse = jax.jit(jax.grad(lambda p: end(p) @ weights))(p)
    np.testing.assert_allclose(reverse, weights @ forward, rtol=1e-7, atol=1e-9 * size)


def test_equal_blocks_that_stop_and_start_together_are_flagged():
    """Which event of two at one instant is first is rounding, and derivatives may depend on it."""
    machine = Chain(1.0, 1.0, 2.0, (Coulomb(1.0, 0.5),) * 2, 0.2, 2)
    run = ss.simulate(
        machine, 0.0, 20.0, machine.state(x_1=1.3, x_2=1.3), saveat=ss.SaveAt(max_events=None)
    )
    assert int(run.num_events) >= 4
    assert not run.differentiable
