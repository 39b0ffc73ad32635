"""Declared machines of every structure, which the tests of `stickslip.mechanism` share."""

import itertools
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact


class Oscillator(AbstractMechanism):
    """A block on a spring and a belt."""

    mass: Any
    stiffness: Any
    law: Any
    belt_speed: Any
    load: Any = 1.0
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": -self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        return {"belt": Contact(self.law, self.load, self.belt_speed)}

    def potential_energy(self, q):
        return 0.5 * self.stiffness * q.x**2


class Pushed(AbstractMechanism):
    """1 kg on rough ground under a force that depends on the time."""

    law: Any
    push: Any  # a function of the time
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1}}

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": self.push(t)}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(self.law)}


class Chain(AbstractMechanism):
    """Blocks in a row on rough ground, each pulled along by a spring (Burridge and Knopoff).

    The coordinates are places of the blocks.
    """

    mass: Any
    pull: Any
    coupling: Any
    laws: Any
    speed: Any
    blocks: int = eqx.field(static=True)

    @property
    def coordinates(self):
        return {f"x_{i + 1}": "m" for i in range(self.blocks)}

    @property
    def contact_directions(self):
        return {f"block {i + 1}": {f"x_{i + 1}": 1} for i in range(self.blocks)}

    def mass_matrix(self, q):
        return (self.mass,) * self.blocks

    def forces(self, t, q, v, args):
        found = []
        for i in range(self.blocks):
            f = self.pull * (self.speed * t - q[i])
            if i > 0:
                f = f - self.coupling * (q[i] - q[i - 1])
            if i < self.blocks - 1:
                f = f - self.coupling * (q[i] - q[i + 1])
            found.append(f)
        return tuple(found)

    def contacts(self, t, q, v, args):
        return [Contact(law) for law in self.laws]


class Train(Chain):
    """The same with the distance to the block before as coordinate: a full mass matrix."""

    @property
    def contact_directions(self):
        rows = np.tril(np.ones((self.blocks, self.blocks)))
        return {f"block {i + 1}": tuple(rows[i]) for i in range(self.blocks)}

    def mass_matrix(self, q):
        n = self.blocks
        return tuple(tuple((n - max(i, j)) * self.mass for j in range(n)) for i in range(n))

    def forces(self, t, q, v, args):
        absolute = super().forces(t, tuple(itertools.accumulate(q)), v, args)
        return tuple(sum(absolute[i:]) for i in range(self.blocks))


def chain(blocks, kind=Chain, kinetic=0.6, speed=0.1, mass=1.0):
    laws = tuple(Coulomb(1.0 + 0.1 * (i % 3), kinetic) for i in range(blocks))
    return kind(mass, 1.0, 2.0, laws, speed, blocks)


class Arm(AbstractMechanism):
    """Two links of length 1 m with dry joints, driven in both: the mass matrix is not constant."""

    m: Any
    torque: Any
    laws: Any
    coordinates: ClassVar = {"a": "rad", "b": "rad"}
    contact_directions: ClassVar = {"shoulder": (1, 0), "elbow": (-1, 1)}

    def mass_matrix(self, q):
        c = 0.5 * self.m * jnp.cos(q.a - q.b)
        return ((4.0 / 3.0 * self.m, c), (c, self.m / 3.0))

    def forces(self, t, q, v, args):
        s = 0.5 * self.m * jnp.sin(q.a - q.b)
        drive = self.torque * jnp.sin(1.3 * t)
        other = 0.8 * self.torque * jnp.sin(2.1 * t + 0.4)
        return -s * v.b**2 + drive, s * v.a**2 - other

    def contacts(self, t, q, v, args):
        return [Contact(law) for law in self.laws]


def arm(torque=3.0):
    return Arm(1.0, torque, (Coulomb(1.0, 0.7), Coulomb(0.8, 0.5)))


class Bouncing(AbstractMechanism):
    """A shaker lifts a block off a belt and presses it on: the contact opens and closes.

    The pad of the contact is a spring between `y`, the shaken height, and the belt.
    """

    pad: Any
    lift: Any
    omega: Any
    law: Any
    belt_speed: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1}}
    opening: ClassVar = ("belt",)

    def mass_matrix(self, q):
        return 1.0, 2.0

    def forces(self, t, q, v, args):
        weight = -1.0 - 3.0 * q.y + self.lift * jnp.cos(self.omega * t)
        return -2.0 * q.x, weight - 0.1 * v.y

    def contacts(self, t, q, v, args):
        return {"belt": Contact(self.law, -self.pad * q.y, self.belt_speed, normal_direction={"y": 1})}

    def time_scale(self, args):
        return 1.0 / self.omega


def bouncing(lift=3.0):
    return Bouncing(5.0, lift, 1.7, Coulomb(0.5, 0.3), 0.2)


class BetweenBelts(AbstractMechanism):
    """A block that two belts of different speeds hold: two contacts of one velocity."""

    stiffness: Any
    laws: Any
    speeds: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"upper": {"x": 1}, "lower": {"x": 1}}

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": -self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        return [Contact(law, 1.0, w) for law, w in zip(self.laws, self.speeds, strict=True)]


class Carriage(AbstractMechanism):
    """Two velocities and four contacts: rails along both, belts along the diagonals."""

    laws: Any
    amplitude: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {
        "rail x": {"x": 1},
        "rail y": {"y": 1},
        "belt 1": (1, 1),
        "belt 2": (1, -1),
    }

    def mass_matrix(self, q):
        return 1.0, 1.5

    def forces(self, t, q, v, args):
        return (
            self.amplitude * jnp.sin(1.1 * t) - 0.5 * q.x,
            0.8 * self.amplitude * jnp.sin(1.9 * t + 0.3) - 0.5 * q.y,
        )

    def contacts(self, t, q, v, args):
        return [Contact(law) for law in self.laws]


def carriage(static=1.0, amplitude=3.0):
    limits = (0.5, 0.7, 0.4, 0.3)
    return Carriage(tuple(Coulomb(static * x, x) for x in limits), amplitude)


def flat(y):
    """All components of a state, in order."""
    return jnp.stack([jnp.asarray(x, jnp.float64) for x in y])
