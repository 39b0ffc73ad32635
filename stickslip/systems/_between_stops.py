"""Linear oscillator between two rigid stops."""

from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip._argument_checks import OBSERVABLE, between, check_arguments, parameters, reals
from stickslip._fastmath import where
from stickslip._types import Numeric
from stickslip._validation import check_above
from stickslip.mechanism import AbstractMechanism, Stop
from stickslip.systems._mechanical import Motion, Number


class OscillatorBetweenStops(AbstractMechanism):
    r"""A driven linear oscillator whose displacement is limited by two rigid stops.

    $$m\ddot x + c\dot x + kx = P\cos\Omega t \quad (a < x < b), \qquad
      \dot x^+ = -e\,\dot x^- \quad (x = a\ \text{or}\ x = b)$$

    - State `Motion`: `x` [m] from the unloaded spring, `v` [m/s].
    - Modes: `"free"`, `"at the lower stop"`, `"at the upper stop"`: pressed against it and at rest.
    - Guards: for each stop the distance to it [m], and while the mass rests there the force on it [N].
    - An impact that would leave no more than `rest_speed` under a force towards the stop ends in
      rest. With `rest_speed=0` and $0 < e < 1$ such impacts accumulate (Zeno), and the simulation
      ends with `RESULTS.chattering`, or with `RESULTS.max_events_reached` when the log is full.
    - Closed form: damped and driven harmonic motion between impacts.

    **Arguments:**

    - `mass` $m$ [kg] and `stiffness` $k$ [N/m], positive; `damping` $c$ [N s/m], not negative.
    - `lower` $a$ and `upper` $b$ [m], $a < b$; any side of the unloaded spring.
    - `restitution` $e$ [-], between 0 and 1; `rest_speed` [m/s], not negative.
    - `force_amplitude` $P$ [N] and `force_frequency` $\Omega$ [rad/s].

    ??? cite "Reference"

        S. W. Shaw, P. J. Holmes, "A periodically forced piecewise linear oscillator", Journal of
        Sound and Vibration 90, 1983; F. Peterka, "Part 1: Theoretical analysis of n-multiple
        (1/n)-impact solutions", Acta Technica ČSAV 19, 1974.
    """

    mass: Float[Array, "..."]
    stiffness: Float[Array, "..."]
    damping: Float[Array, "..."]
    lower: Float[Array, "..."]
    upper: Float[Array, "..."]
    restitution: Float[Array, "..."]
    rest_speed: Float[Array, "..."]
    force_amplitude: Float[Array, "..."]
    force_frequency: Float[Array, "..."]

    parameter_units: ClassVar = {
        "mass": "kg", "stiffness": "N/m", "damping": "N s/m", "lower": "m", "upper": "m",
        "restitution": "1", "rest_speed": "m/s", "force_amplitude": "N",
        "force_frequency": "rad/s",
    }  # fmt: skip

    coordinates: ClassVar = {"x": "m"}
    velocities: ClassVar = {"x": "v"}
    state_class: ClassVar = Motion
    stops: ClassVar = ("lower stop", "upper stop")
    mode_names: ClassVar = ("free", "at the lower stop", "at the upper stop")
    guard_names: ClassVar = (
        "the mass meets or leaves the lower stop",
        "the mass meets or leaves the upper stop",
    )

    @parameters(
        mass="positive", stiffness="positive", damping="not negative", lower="finite", upper="finite",
        rest_speed="not negative", force_amplitude="finite", force_frequency="finite",
        restitution=between(0.0, 1.0),
    )  # fmt: skip
    def __init__(
        self,
        mass: Number,
        stiffness: Number,
        *,
        lower: Number,
        upper: Number,
        restitution: Number,
        damping: Number = 0.0,
        rest_speed: Number = 1e-6,
        force_amplitude: Number = 0.0,
        force_frequency: Number = 1.0,
    ):
        check_above("upper", upper, "lower", lower)

    @check_arguments(t=reals)
    def drive(self, t: Numeric) -> Any:
        """Driving force [N]."""
        return self.force_amplitude * jnp.cos(self.force_frequency * t)

    def time_scale(self, args):
        """That of the driving force, one over its angular frequency [s]."""
        still = self.force_frequency == 0.0
        return where(still, jnp.inf, 1.0 / jnp.abs(where(still, 1.0, self.force_frequency)))

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": self.drive(t) - self.damping * v.x - self.stiffness * q.x}

    def gaps(self, t, q, args):
        return {
            "lower stop": Stop(q.x - self.lower, self.restitution, self.rest_speed),
            "upper stop": Stop(self.upper - q.x, self.restitution, self.rest_speed),
        }

    def potential_energy(self, q):
        return 0.5 * self.stiffness * q.x**2

    @check_arguments(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """`force`: work of the drive; `damping`: its loss [W]. Losses at impacts: the log of events."""
        return {"force": self.drive(t) * y.v, "damping": -self.damping * y.v**2}
