"""Friction in a plane in the smooth forms: the speed decides how much, the velocity which way."""

from typing import Any

import jax.numpy as jnp

from stickslip._validation import DeclarationError, refusal
from stickslip.friction import Dahl, LuGre
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._abstract_declaration import AbstractDeclaration
from ._instant import Instant


class Planes:
    r"""The contacts of a mechanism at one instant, of which some are one in a plane.

    With the magnitude $F_i(s)$ of a smooth law at the speed $s = |u|$ friction is

    $$\lambda_i = -F_i\,\frac{F_i u_i}{\sqrt{(F_1 u_1)^2 + (F_2 u_2)^2}}$$

    and for bristles, whose laws are linear in the deflection $z$,

    $$\dot z_i = u_i - \sigma_0\frac{s}{g(s)} z_i, \qquad
      \lambda_i = -(\sigma_0 z_i + \sigma_1\dot z_i + \sigma_2 u_i)\,N$$

    `names`, `contacts`, `speeds`: of each contact; in a plane the normal force of the first of the two,
    under its name, and the speed of both together.
    """

    def __init__(self, declaration: AbstractDeclaration, at: Instant):
        self.names = list(declaration.names.contacts)
        self.contacts, self.speeds = list(at.contacts), list(at.speeds)
        self.pairs = [tuple(map(self.names.index, pair)) for pair in declaration.planar.items()]
        self.velocities = tuple(at.speeds)
        for first, second in self.pairs:
            load = self.contacts[first].normal_force
            self.contacts[second] = self.contacts[second]._replace(normal_force=load)
            self.names[second] = self.names[first]
            u, w = self.speeds[first], self.speeds[second]
            self.speeds[first] = self.speeds[second] = jnp.sqrt(u * u + w * w + ENGINE.tiny**2)

    def along_velocities(self, forces: list[Any]) -> list[Any]:
        """Friction along each contact, of the `forces` of the laws at `speeds` [N]."""
        found = list(forces)
        for pair in self.pairs:
            used = [forces[c] * self.velocities[c] for c in pair]
            size = jnp.sqrt(used[0] * used[0] + used[1] * used[1] + ENGINE.tiny**2)
            for c, part in zip(pair, used, strict=True):
                found[c] = -forces[c] * part / size
        return found

    def bristles(self, c: int, law: Any, load: Any, state: tuple) -> tuple[Any, tuple]:
        """Friction along contact `c` by the deflection of its bristles [N], and the rate of that."""
        speed = self.speeds[c]
        force, rate = law.force_from_state(speed, load, state), law.state_rate(speed, state)
        if not any(c in pair for pair in self.pairs):
            return force, tuple(rate)
        if type(law) not in (LuGre, Dahl) or getattr(law, "exponent", 1.0) != 1.0:
            allowed = "LuGre, or Dahl with the exponent 1: others have bristles of one line"
            raise DeclarationError(str(refusal(f"the law of contact {self.names[c]!r}", law, allowed)))
        part, straight = self.velocities[c] / speed, (jnp.zeros_like(speed),)
        own = law.force_from_state(speed, load, straight)
        (grows,), (free,) = rate, law.state_rate(speed, straight)
        return force + (part - 1.0) * own, (grows + (part - 1.0) * free,)
