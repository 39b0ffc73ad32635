"""Ball on rigid ground."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip._fastmath import where
from stickslip._looks_at import OBSERVABLE, looks_at, reals, state
from stickslip._validation import as_parameter, check_between, check_nonnegative, check_positive
from stickslip.hybrid._system import NO_MODE
from stickslip.systems._mechanical import AbstractMechanicalSystem, Motion, Number


class BouncingBall(AbstractMechanicalSystem):
    r"""A ball that falls, bounces with Newton's law of restitution and in the end lies still.

    $$\ddot x = -g \quad (x > 0), \qquad \dot x^+ = -e\,\dot x^- \quad (x = 0)$$

    - State `Motion`: height `x` [m], `v` [m/s], up positive.
    - Modes: `"flight"`, `"rest"`.
    - One guard, the height in flight [m]. An impact that would leave no more than `rest_speed` leaves
      none: rest.
    - Closed form: impacts at $t_n = t_1 + 2v_1 e\,(1 - e^{n-1})/(g(1-e))$ with the speed
      $v_n = e^{n-1}v_1$. For $e < 1$ they accumulate in finite time (Zeno). With `rest_speed=0` the
      simulation ends there with `RESULTS.chattering`, or before, when the log of events is full,
      with `RESULTS.max_events_reached`.

    **Arguments:**

    - `mass` $m$ [kg] and `gravity` $g$ [m/s²], positive.
    - `restitution` $e$ [-], between 0 and 1.
    - `rest_speed` [m/s], not negative.

    ??? cite "Reference"

        B. Brogliato, *Nonsmooth Mechanics*, 3rd ed., Springer, 2016, section 1.3.
    """

    mass: Float[Array, "..."]
    gravity: Float[Array, "..."]
    restitution: Float[Array, "..."]
    rest_speed: Float[Array, "..."]

    mode_names: ClassVar = ("flight", "rest")
    guard_names: ClassVar = ("the ball meets the ground",)
    units: ClassVar = {"x": "m", "v": "m/s"}

    def __init__(self, mass: Number, gravity: Number, restitution: Number, rest_speed: Number = 1e-3):
        self.mass = as_parameter(check_positive("mass", mass))
        self.gravity = as_parameter(check_positive("gravity", gravity))
        self.restitution = as_parameter(check_between("restitution", restitution, 0.0, 1.0))
        self.rest_speed = as_parameter(check_nonnegative("rest_speed", rest_speed))

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=where(mode == 1, 0.0, -self.gravity))

    def guards(self, t, y, mode, args):
        return (where(mode == 1, 1.0, y.x),)

    def transition(self, t, y, mode, guard, args):
        rebound = -self.restitution * y.v
        rests = rebound <= self.rest_speed
        # On the ground whatever the parameters: the height has no derivative left at an impact.
        return Motion(x=jnp.zeros_like(y.x), v=where(rests, 0.0, rebound)), where(rests, 1, 0)

    @looks_at(t=reals, y=state)
    def initial_mode(self, t, y, args):
        lies = (y.x == 0.0) & (y.v == 0.0)
        return where(y.x < 0.0, NO_MODE, where(lies, 1, 0))

    @looks_at(y=state)
    def energy(self, y):
        """Kinetic energy and energy of height [J]."""
        return self.mass * (0.5 * y.v**2 + self.gravity * y.x)

    @looks_at(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """None: the ball loses energy at impacts only, see the log of events."""
        return {}
