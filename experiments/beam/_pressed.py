"""The jointed beam with the bouncing of its mass as a known load: the rest of it is forced."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import JointedBeam


class PressedBeamState(NamedTuple):
    """Mass along the belt, and beam."""

    y: Any  # displacement of the mass along the belt
    vy: Any  # its velocity
    q: Any  # modal coordinates of the beam, shape [modes]
    p: Any  # their velocities, shape [modes]


class PressedBeam(AbstractMechanism):
    r"""`beam` whose mass bounces across the belt by a depth that is given, $x(t)$ in closed form.

    (2.3) does not ask what the mass does along the belt, and its right-hand side is homogeneous in $x$:
    with $\omega_c = \sqrt{(k_2 + k_3)/m}$ and $\omega_n = \sqrt{k_2/m}$ every motion has the period
    $T = \pi/\omega_c + \pi/\omega_n$ and, from its greatest depth $a$ at $t = 0$, as the paper starts,

    $$x = a\cos\omega_c t \quad (|t| \le t_1), \qquad
      x = -a\,\frac{\omega_c}{\omega_n}\sin\omega_n(t - t_1) \quad (t_1 \le t \le T - t_1), \qquad
      t_1 = \frac{\pi}{2\omega_c}.$$

    Of the whole beam each periodic orbit is one of a family, one for each $a$: two of its Floquet
    multipliers are 1, and no method can follow it over a parameter. Here $a$ is kept, and the orbit
    is a single one.

    - `beam`: the jointed beam; `depth`: $a$, positive. Dimensionless, as the beam is.
    """

    beam: JointedBeam
    depth: Float[Array, "..."]

    coordinates: ClassVar = {"y": "1", "q": "1"}
    velocities: ClassVar = {"y": "vy", "q": "p"}
    contact_directions: ClassVar = {"belt": {"y": 1.0}}
    opening: ClassVar = ("belt",)
    state_class: ClassVar = PressedBeamState
    mode_names: ClassVar = JointedBeam.mode_names

    def mass_matrix(self, q):
        return {"y": self.beam.m, "q": self.beam.scales.mass}

    def forces(self, t, q, v, args):
        x = jnp.zeros(())
        found = self.beam.forces(t, _Both(x, q.y, q.q), _Both(x, v.y, v.q), args)
        return {"y": found["y"], "q": found["q"]}

    def contacts(self, t, q, v, args):
        beam = self.beam
        return {"belt": Contact(beam.friction_law, beam.k3 * self.x(t), surface_speed=beam.v)}

    @property
    def guard_scales(self) -> tuple:
        """Those of the beam: its speed, and its force."""
        speed, *_, force = self.beam.guard_scales
        return (*[speed] * (1 + len(self.two_sided_contacts)), force)

    def time_scale(self, args):
        """That of the fastest of what moves."""
        rates = jnp.append(self.beam.frequencies(), self.rates()[0])
        return 1.0 / jnp.max(rates)

    def rates(self) -> tuple[Any, Any]:
        r"""$\omega_c$ and $\omega_n$: angular frequencies of $x$ in contact and without."""
        beam = self.beam
        return jnp.sqrt((beam.k2 + beam.k3) / beam.m), jnp.sqrt(beam.k2 / beam.m)

    def period(self) -> Any:
        """$T$, from one greatest depth to the next."""
        touching, free = self.rates()
        return np.pi / touching + np.pi / free

    def x(self, t: Any) -> Any:
        """Depth of the mass in the belt, negative while it is off it."""
        touching, free = self.rates()
        lift = np.pi / touching
        since = jnp.mod(t + 0.5 * lift, self.period())  # touched down
        inside = jnp.sin(touching * since)
        off = -touching / free * jnp.sin(free * (since - lift))
        return self.depth * jnp.where(since < lift, inside, off)

    def start(self) -> PressedBeamState:
        """State (2.6): the mass moves with the belt at `y = 0`, the beam rests."""
        still = jnp.zeros(self.beam.modes)
        return PressedBeamState(jnp.zeros(()), jnp.asarray(self.beam.v, jnp.float64), still, still)


class _Both(NamedTuple):
    """Coordinates of the beam, or their rates, as it names them."""

    x: Any
    y: Any
    q: Any


def pressed(beam: JointedBeam) -> PressedBeam:
    """`beam` with the bouncing that begins at its own start."""
    return PressedBeam(beam, jnp.asarray(beam.start().x, jnp.float64))
