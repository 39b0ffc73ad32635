"""Declared machines with rigid stops, which the tests of stops share."""

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from stickslip.mechanism import AbstractMechanism, Contact, Stop


class Ball(AbstractMechanism):
    """1 kg over a table that may shake, under a weight that may change with time."""

    e: Any
    rest: Any = 1e-6
    weight: Any = 1.0
    table: Any = 0.0  # amplitude of x_table = table * sin(omega * t)
    omega: Any = 1.0
    extra: Any = 0.0  # extra * cos(omega * t) lifts it
    coordinates: ClassVar = {"x": "m"}
    stops: ClassVar = ("table",)

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": -self.weight + self.extra * jnp.cos(self.omega * t)}

    def gaps(self, t, q, args):
        return {"table": Stop(q.x - self.table * jnp.sin(self.omega * t), self.e, self.rest)}

    def potential_energy(self, q):
        return self.weight * q.x

    def time_scale(self, args):
        return 1.0 / self.omega


class Pair(AbstractMechanism):
    """Two masses on a line that collide; a spring holds each at its place, forces push."""

    masses: Any
    e: Any
    rest: Any = 0.0
    springs: Any = (0.0, 0.0)
    push: Any = (0.0, 0.0)
    coordinates: ClassVar = {"x": "m", "y": "m"}
    stops: ClassVar = ("bumper",)

    def mass_matrix(self, q):
        return self.masses

    def forces(self, t, q, v, args):
        return tuple(f - k * x for f, k, x in zip(self.push, self.springs, q, strict=True))

    def gaps(self, t, q, args):
        return {"bumper": Stop(q.y - q.x, self.e, self.rest)}


class Guided(AbstractMechanism):
    """A mass falls on a block that friction holds in a vertical guide."""

    masses: Any
    e: Any
    law: Any
    rest: Any = 1e-6
    gravity: Any = 10.0
    coordinates: ClassVar = {"block": "m", "mass": "m"}
    contact_directions: ClassVar = {"guide": {"block": 1}}
    stops: ClassVar = ("top",)

    def mass_matrix(self, q):
        return self.masses

    def forces(self, t, q, v, args):
        return tuple(-m * self.gravity for m in self.masses)

    def contacts(self, t, q, v, args):
        return {"guide": Contact(self.law)}

    def gaps(self, t, q, args):
        return {"top": Stop(q.mass - q.block, self.e, self.rest)}

    def potential_energy(self, q):
        return sum(m * self.gravity * x for m, x in zip(self.masses, q, strict=True))


class Pendulum(AbstractMechanism):
    """1 kg on a rod of 1 m hits a wall; its joint may be dry."""

    wall: Any  # the wall is at x = -wall
    e: Any
    rest: Any = 1e-6
    gravity: Any = 9.81
    coordinates: ClassVar = {"a": "rad"}
    stops: ClassVar = ("wall",)

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"a": -self.gravity * jnp.sin(q.a)}

    def gaps(self, t, q, args):
        return {"wall": Stop(jnp.sin(q.a) + self.wall, self.e, self.rest)}

    def potential_energy(self, q):
        return -self.gravity * jnp.cos(q.a)


class DryPendulum(Pendulum):
    law: Any = None
    contact_directions: ClassVar = {"joint": {"a": 1}}

    def contacts(self, t, q, v, args):
        return {"joint": Contact(self.law)}


class Pushed(AbstractMechanism):
    """1 kg on rough ground, or a belt, between walls, under a force of the time."""

    law: Any
    force: Any
    e: Any
    width: Any = 1.0
    rest: Any = 1e-6
    belt: Any = eqx.field(default=0.0, converter=jnp.asarray)  # no number that is known while tracing
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1}}
    stops: ClassVar = ("left", "right")

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": self.force(t)}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(self.law, surface_speed=self.belt)}

    def gaps(self, t, q, args):
        return {
            "left": Stop(q.x, self.e, self.rest),
            "right": Stop(self.width - q.x, self.e, self.rest),
        }


class Row(AbstractMechanism):
    """Blocks in a row on rough ground that bump into each other, each on a spring and driven."""

    masses: Any
    laws: Any
    e: Any
    rest: Any = 1e-6
    stiffness: Any = 1.0
    drive: Any = 2.0
    blocks: int = eqx.field(static=True, default=3)

    @property
    def coordinates(self):
        return {f"x_{i}": "m" for i in range(self.blocks)}

    @property
    def contact_directions(self):
        return {f"block {i}": {f"x_{i}": 1} for i in range(self.blocks)} if self.laws else {}

    @property
    def stops(self):
        return tuple(f"bumper {i}" for i in range(self.blocks - 1))

    def mass_matrix(self, q):
        return self.masses

    def forces(self, t, q, v, args):
        phases = [0.9 * i for i in range(self.blocks)]
        drives = [self.drive * jnp.sin((1.0 + 0.3 * i) * t + p) for i, p in enumerate(phases)]
        return tuple(f - self.stiffness * x for f, x in zip(drives, q, strict=True))

    def contacts(self, t, q, v, args):
        return [Contact(law) for law in self.laws]

    def gaps(self, t, q, args):
        return [Stop(q[i + 1] - q[i] + 0.2, self.e, self.rest) for i in range(self.blocks - 1)]

    def time_scale(self, args):
        return 0.5


class Box(AbstractMechanism):
    """1 kg that falls into a corner of two planes, no coordinate across a plane."""

    e: Any
    rest: Any = 1e-6
    pull: Any = (-0.3, -1.0)
    coordinates: ClassVar = {"x": "m", "y": "m"}
    stops: ClassVar = ("left plane", "right plane")

    def mass_matrix(self, q):
        return 1.0, 1.0

    def forces(self, t, q, v, args):
        return self.pull

    def gaps(self, t, q, args):
        return {
            "left plane": Stop(q.y + 0.5 * q.x, self.e, self.rest),
            "right plane": Stop(q.y - q.x, self.e, self.rest),
        }

    def potential_energy(self, q):
        return -(self.pull[0] * q.x + self.pull[1] * q.y)


class Wire(AbstractMechanism):
    """A bead of 1 kg over the curve y = x^2: the stop's direction turns with the state."""

    e: Any
    rest: Any = 1e-3
    gravity: Any = 1.0
    coordinates: ClassVar = {"x": "m", "y": "m"}
    stops: ClassVar = ("bowl",)

    def mass_matrix(self, q):
        return 1.0, 1.0

    def forces(self, t, q, v, args):
        return 0.0, -self.gravity

    def gaps(self, t, q, args):
        return {"bowl": Stop(q.y - q.x**2, self.e, self.rest)}

    def potential_energy(self, q):
        return self.gravity * q.y
