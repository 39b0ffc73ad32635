"""The machine, declared: its masses, the forces of its motors, and its eight dry contacts."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
from jaxtyping import PyTree

from stickslip.checks import Given, Numeric, Whole, as_parameter, check_finite, check_type, one_number
from stickslip.fastmath import where
from stickslip.mechanism import AbstractMechanism, Contact

from ._contact_motion import contact_motion
from ._contacts import (
    BELT_1,
    BELT_2,
    CONTACT_NAMES,
    DIRECTIONS,
    NUM_CONTACTS,
    Line,
    X,
    Y,
    contact_loads,
    friction_laws,
    kinetic_limits,
    line_masses,
    sliding_speeds,
)
from ._modes import MODE_NAMES, mode_dmn, mode_number, mode_signs
from ._motors import motor_torque
from ._parameters import CoreXYParameters
from ._voltage import VOLTAGES, AbstractVoltage

NEXT_PIECE = NUM_CONTACTS + 1  # number of the guard
LOSS_NAMES = ("x", "y", "u", "w", "motor_1", "motor_2", "belt_1", "belt_2")


class CoreXYState(NamedTuple):
    """Position `x`, `y` [m] and velocity `vx`, `vy` [m/s] of the collar, angles `theta_1`, `theta_2`
    [rad] and speeds `omega_1`, `omega_2` [rad/s] of the motor pulleys, number `piece` of the piece of
    the input."""

    x: Any
    y: Any
    vx: Any
    vy: Any
    theta_1: Any
    theta_2: Any
    omega_1: Any
    omega_2: Any
    piece: Any


STATE_UNITS = {
    "x": "m",
    "y": "m",
    "vx": "m/s",
    "vy": "m/s",
    "theta_1": "rad",
    "theta_2": "rad",
    "omega_1": "rad/s",
    "omega_2": "rad/s",
    "piece": "1",
}


class Place(NamedTuple):
    """The coordinates: position `x`, `y`, lengths `one`, `two` of belt line over the motor pulleys [m],
    and the number `piece` of the piece of the input."""

    x: Any
    y: Any
    one: Any
    two: Any
    piece: Any


class CoreXY(AbstractMechanism):
    r"""CoreXY mechanism with slipping motor pulleys; all eight dry contacts at once.

    With $q = (\dot x, \dot y, r\omega_1, r\omega_2)$ and the contacts of `CONTACT_NAMES`,

    $$\dot q = \arg\min_a \; \tfrac12 a^T M a - a^T F
      + \sum_{c\ \text{at rest}} R_c\,|n_c\cdot a|, \qquad R_c = \max(\mu_s, \mu_k) N_c,$$

    $F$ being motor torques and kinetic friction of the sliding contacts. Within a mode this is
    Eq. (35): motor $i$ rolls while belt $i$ does not slide, so the four dynamic models DMN1-4 are
    read off.

    - State `CoreXYState`. Modes: the 369 ways in which the contacts can rest and slide together, named
      like `"RS 0+++++0-"`: dynamic model, then the sense of every contact.
    - Guards: the sliding speed of every contact, in its sense [m/s]; the part of the friction left to
      the resting contacts along the line on which they would give way; the time to the end of the
      piece of the input [s].
    - A contact that stops is at rest and stays so if the law of all contacts lets it (erratum A12);
      what starts is under kinetic friction at once, which may start others at the same instant.
    - Two contacts that always slide together are one guard, so that they do not count as coincident.

    **Arguments:** `parameters`, a `CoreXYParameters`; `voltage`, an `AbstractVoltage`.
    **Raises** `TypeError` for anything else.

    Source: Eqs. (1)-(71), errata A1-A12 corrected; Gauss' principle as in `stickslip.mechanism`.
    """

    parameters: CoreXYParameters
    voltage: AbstractVoltage

    coordinates: ClassVar = {"x": "m", "y": "m", "one": "m", "two": "m"}
    first_order: ClassVar = {"piece": "1"}
    contact_directions: ClassVar = DIRECTIONS
    mode_names: ClassVar = MODE_NAMES
    guard_names: ClassVar = (
        *(f"{name} stops" for name in CONTACT_NAMES),
        "resting contacts give way",
        "input jumps",
    )
    units: ClassVar = STATE_UNITS

    def __init__(self, parameters: Given[CoreXYParameters], voltage: Given[AbstractVoltage]):
        self.parameters = check_type("parameters", parameters, CoreXYParameters, "CoreXYParameters")
        self.voltage = check_type("voltage", voltage, AbstractVoltage, VOLTAGES)

    # -- the declaration

    def mass_matrix(self, q):
        return list(line_masses(self.parameters))

    def forces(self, t, q, v, args):
        p = self.parameters
        volts, turn = self.voltage.volts(t, q.piece), 1.0 / p.r
        one, two = (motor_torque(p, u, s * turn) for u, s in zip(volts, (v.one, v.two), strict=True))
        return {"one": one * turn, "two": two * turn}

    def contacts(self, t, q, v, args):
        parts = zip(
            CONTACT_NAMES, friction_laws(self.parameters), contact_loads(self.parameters), strict=True
        )
        return {name: Contact(law, load) for name, law, load in parts}

    def rates(self, t, q, v, args):
        return {"piece": 0.0}

    def time_scale(self, args):
        """That of the voltage."""
        return self.voltage.time_scale()

    # -- the state in angles, the modes by their numbers, the motion in closed form

    def state(
        self,
        x: Numeric = 0.0,
        y: Numeric = 0.0,
        vx: Numeric = 0.0,
        vy: Numeric = 0.0,
        theta_1: Numeric = 0.0,
        theta_2: Numeric = 0.0,
        omega_1: Numeric | None = None,
        omega_2: Numeric | None = None,
        t: Numeric = 0.0,
    ) -> CoreXYState:
        """State at time `t` [s], components as in `CoreXYState`; a motor without a speed rolls.

        **Raises** `ValueError`, `TypeError` for values that are not finite.
        """
        given = {"x": x, "y": y, "vx": vx, "vy": vy, "theta_1": theta_1, "theta_2": theta_2}
        numbers = [as_parameter(check_finite(name, value)) for name, value in given.items()]
        vx, vy = numbers[2], numbers[3]
        r = self.parameters.r
        one, two = (vx + vy) / r, (vx - vy) / r
        if omega_1 is not None:
            one = as_parameter(check_finite("omega_1", omega_1))
        if omega_2 is not None:
            two = as_parameter(check_finite("omega_2", omega_2))
        piece = self.voltage.piece_of(as_parameter(one_number("t", t)))
        return CoreXYState._make((*numbers, one, two, piece))

    def to_coordinates(self, y: CoreXYState) -> tuple[Place, Line]:
        r = self.parameters.r
        place = Place(y.x, y.y, r * y.theta_1, r * y.theta_2, y.piece)
        return place, self.line_velocities(y)

    def from_coordinates(self, q: PyTree, v: PyTree) -> CoreXYState:
        (x, y, one, two, piece), (vx, vy, v_one, v_two) = q, v
        turn = 1.0 / self.parameters.r
        angles = one * turn, two * turn, v_one * turn, v_two * turn
        return CoreXYState(x, y, vx, vy, *angles, piece)

    def line_velocities(self, y: CoreXYState) -> Line:
        """The four line velocities [m/s]."""
        r = self.parameters.r
        return Line(y.vx, y.vy, r * y.omega_1, r * y.omega_2)

    def states(self, mode: Whole) -> Any:
        """Sense of every contact: -1, 0 (at rest) or 1."""
        return mode_signs(mode)

    def mode_of(self, states: PyTree) -> Any:
        """The mode with these senses; -1 if the geometry does not admit them."""
        return mode_number(states)

    def motion_together(self, group, mass, force, rest):
        return contact_motion(Line(*(mass.diagonal or ())), force, rest)

    # -- the input

    @property
    def guard_scales(self):
        """1 m/s, all friction of a line, 1 s."""
        return (1.0,) * (NUM_CONTACTS + 2)

    def guards(self, t, y, mode, args):
        left = self.voltage.piece_end(y.piece) - t if self.voltage.has_breaks else jnp.ones_like(t)
        return (*super().guards(t, y, mode, args), left)

    def transition(self, t, y, mode, guard, args):
        y = y._replace(piece=y.piece + where(guard == NEXT_PIECE, 1.0, 0.0))
        return super().transition(t, y, mode, guard, args)

    # -- what is read off

    def torques(self, t: Numeric, y: CoreXYState) -> tuple[Any, Any]:
        """Motor torques [N m], Eq. (3)."""
        p = self.parameters
        v1, v2 = self.voltage.volts(t, y.piece)
        return motor_torque(p, v1, y.omega_1), motor_torque(p, v2, y.omega_2)

    def line_drive(self, t: Numeric, y: CoreXYState) -> tuple[Any, Any]:
        """Forces of the motors on the belt line [N]."""
        one, two = self.torques(t, y)
        return one / self.parameters.r, two / self.parameters.r

    def powers(self, t, y, mode, args):
        """`motor_1`, `motor_2`: work of the motors; `friction_...`: loss at each contact [W]."""
        one, two = self.torques(t, y)
        limits, speeds = kinetic_limits(self.parameters), sliding_speeds(self.line_velocities(y))
        parts = zip(LOSS_NAMES, mode_signs(mode), limits, speeds, strict=True)
        losses = {f"friction_{name}": -s * limit * v for name, s, limit, v in parts}
        return {"motor_1": one * y.omega_1, "motor_2": two * y.omega_2, **losses}

    def dmn(self, mode: Whole) -> Any:
        """Dynamic model number of a mode: 1 RR, 2 SR, 3 RS, 4 SS."""
        return mode_dmn(mode)

    def carriage_rests(self, mode: Whole) -> Any:
        """Whether neither x nor y moves in a mode."""
        signs = mode_signs(mode)
        return (signs[X] == 0.0) & (signs[Y] == 0.0)

    def slips(self, t: Numeric, y: CoreXYState, mode: Whole, args: PyTree):
        """`slip_1`, `slip_2`: rates of the slip distances of the belts [m/s]."""
        signs, speeds = mode_signs(mode), sliding_speeds(self.line_velocities(y))
        return {
            "slip_1": signs[BELT_1] * speeds[BELT_1],
            "slip_2": signs[BELT_2] * speeds[BELT_2],
        }
