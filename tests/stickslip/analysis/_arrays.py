"""One machine with two states: written with scalars, and with the same numbers in arrays."""

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion


class Scalars(NamedTuple):
    """In the order in which a dictionary of `v` and `x` is flattened, so that sums round alike."""

    v_0: Any
    v_1: Any
    x_0: Any
    x_1: Any


class Carrying(ss.AbstractHybridSystem):
    """A block with dry friction, number 0, that pulls mass number 1 and does not feel it."""

    block: CoulombOscillator
    spring: Any  # [1/s^2]
    arrays: bool = eqx.field(static=True)

    units: ClassVar = {
        "x": "m", "v": "m/s", "x_0": "m", "x_1": "m", "v_0": "m/s", "v_1": "m/s",
    }  # fmt: skip
    mode_names: ClassVar = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2).mode_names
    guard_names: ClassVar = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2).guard_names

    def scalars(self, y):
        return Scalars(y["v"][0], y["v"][1], y["x"][0], y["x"][1]) if self.arrays else y

    def own(self, v_0, v_1, x_0, x_1):
        if self.arrays:
            return {"x": jnp.stack([x_0, x_1]), "v": jnp.stack([v_0, v_1])}
        return Scalars(v_0, v_1, x_0, x_1)

    def one(self, y):
        y = self.scalars(y)
        return Motion(x=y.x_0, v=y.v_0)

    def vector_field(self, t, y, mode, args):
        block, y = self.block.vector_field(t, self.one(y), mode, args), self.scalars(y)
        pull = self.spring * (y.x_0 - y.x_1) - 0.1 * y.v_1
        return self.own(block.v, pull, block.x, y.v_1)

    def guards(self, t, y, mode, args):
        return self.block.guards(t, self.one(y), mode, args)

    def transition(self, t, y, mode, guard, args):
        block, mode = self.block.transition(t, self.one(y), mode, guard, args)
        y = self.scalars(y)
        return self.own(block.v + 0.0 * y.v_0, y.v_1, block.x + 0.0 * y.x_0, y.x_1), mode

    def initial_mode(self, t, y, args):
        return self.block.initial_mode(t, self.one(y), args)

    def energy(self, y):
        y = self.scalars(y)
        return 0.5 * (y.v_0**2 + y.v_1**2 + y.x_0**2 + y.x_1**2)

    def powers(self, t, y, mode, args):
        """What changes `energy`, of each mass: in an array, or by name."""
        slope, y = self.scalars(self.vector_field(t, y, mode, args)), self.scalars(y)
        first = y.v_0 * slope.v_0 + y.x_0 * slope.x_0
        second = y.v_1 * slope.v_1 + y.x_1 * slope.x_1
        return {"mass": jnp.stack([first, second])} if self.arrays else {"0": first, "1": second}


def machine(belt_speed, arrays):
    return Carrying(CoulombOscillator(1.0, 1.0, 1.0, 0.5, belt_speed), 1.7, arrays)


class Free(ss.AbstractSmoothSystem):
    """An oscillator in each element, whatever the shape: it takes scalars and arrays alike."""

    stiffness: Any
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return {"x": y["v"], "v": -self.stiffness * y["x"]}
