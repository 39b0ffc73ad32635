"""Ball on rigid ground."""

from typing import ClassVar

from jaxtyping import Array, Float

from stickslip._argument_checks import between, parameters
from stickslip.mechanism import AbstractMechanism, Stop
from stickslip.systems._mechanical import Motion, Number


class BouncingBall(AbstractMechanism):
    r"""A ball that falls, bounces with Newton's law of restitution and in the end lies still.

    $$\ddot x = -g \quad (x > 0), \qquad \dot x^+ = -e\,\dot x^- \quad (x = 0)$$

    - State `Motion`: height `x` [m], `v` [m/s], up positive.
    - Modes: `"flight"`, `"rest"`.
    - One guard, the height in flight [m], at rest the weight [N]. An impact that would leave no more
      than `rest_speed` leaves none: rest.
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

    parameter_units: ClassVar = {
        "mass": "kg", "gravity": "m/s2", "restitution": "1", "rest_speed": "m/s",
    }  # fmt: skip

    coordinates: ClassVar = {"x": "m"}
    velocities: ClassVar = {"x": "v"}
    state_class: ClassVar = Motion
    stops: ClassVar = ("ground",)
    mode_names: ClassVar = ("flight", "rest")
    guard_names: ClassVar = ("the ball meets the ground",)

    @parameters(
        mass="positive", gravity="positive", rest_speed="not negative", restitution=between(0.0, 1.0),
    )  # fmt: skip
    def __init__(self, mass: Number, gravity: Number, restitution: Number, rest_speed: Number = 1e-3):
        pass

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": -self.mass * self.gravity}

    def gaps(self, t, q, args):
        return {"ground": Stop(q.x, self.restitution, self.rest_speed)}

    def potential_energy(self, q):
        return self.mass * self.gravity * q.x
