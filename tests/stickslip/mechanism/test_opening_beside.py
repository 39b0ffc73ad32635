"""Contacts that open beside others of the same direction: each looks after itself then."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact

END = 10.0


class Pressed(AbstractMechanism):
    """1 kg on a rail, shaken along and across: a pad presses it on the rail too, where `y` < 0."""

    p: Any

    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"pad": {"x": 1.0}, "rail": {"x": -2.0}}
    opening: ClassVar = ("pad",)

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        push, lift, rate, *_ = self.p
        return {
            "x": push * jnp.sin(rate * t) - 0.5 * q.x,
            "y": lift * jnp.sin(1.7 * t) - 1.0 - 0.2 * v.y,
        }

    def time_scale(self, args):
        return 1.0 / jnp.maximum(self.p[2], 1.7)

    def contacts(self, t, q, v, args):
        *_, speed, pad, rail = self.p
        return {
            "pad": Contact(Coulomb(pad), -5.0 * q.y, speed, normal_direction={"y": 1.0}),
            "rail": Contact(Coulomb(rail), surface_speed=-2.0 * speed),
        }


def marched(p, y, steps=20_000):
    """Small steps, the friction of pad and rail together as one contact of all its force."""
    push, lift, rate, speed, pad, rail = p.T
    x, vx, vy, h = np.zeros(len(p)), np.zeros(len(p)), np.zeros(len(p)), END / steps
    y = np.full(len(p), y)
    opened = np.zeros(len(p), bool)
    for i in range(steps):
        t = (i + 0.5) * h
        middle = y + 0.5 * h * vy
        pressed = np.maximum(-5.0 * middle, 0.0)
        opened |= pressed == 0.0
        vy = vy + h * (lift * np.sin(1.7 * t) - 1.0 - 0.2 * vy + pressed)
        y = middle + 0.5 * h * vy
        free = vx + h * (push * np.sin(rate * t) - 0.5 * (x + 0.5 * h * vx)) - speed
        most = h * (pad * pressed + 2.0 * rail)
        u = speed + np.sign(free) * np.maximum(np.abs(free) - most, 0.0)
        x, vx = x + 0.5 * h * (u + vx), u
    return x, vx, opened


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [False, True])
def test_rail_alone_while_the_pad_is_open(swapped):
    """Whichever of the two is declared first."""

    class Machine(Pressed):
        if swapped:
            contact_directions: ClassVar = dict(reversed(Pressed.contact_directions.items()))

    low, high = [0.5, 1.0, 0.7, -0.3, 0.2, 0.1], [3.0, 3.0, 2.5, 0.3, 0.8, 0.4]
    p = np.random.default_rng(2).uniform(low, high, (30, 6))

    @jax.jit
    @jax.vmap
    def run(p):
        machine = Machine(p)
        start = machine.state(y=-0.2)
        return ss.simulate(machine, 0.0, END, start, throw=False, saveat=ss.SaveAt(max_events=256))

    found = run(jnp.asarray(p))
    assert np.all(found.successful)
    assert not np.any(np.asarray(found.flags))
    x, vx, opened = marched(p, -0.2)
    assert opened.sum() > 20
    np.testing.assert_allclose(found.y1.x, x, atol=5e-3)
    np.testing.assert_allclose(found.y1.v_x, vx, atol=1e-2)
