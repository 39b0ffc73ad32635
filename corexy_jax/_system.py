"""The machine as a hybrid system: the law of all contacts at once."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from stickslip.checks import Given, Numeric, Whole, as_parameter, check_finite, check_type, one_number
from stickslip.fastmath import where
from stickslip.systems import AbstractMechanicalSystem

from ._contact_motion import ContactMotion, contact_motion, onset, onset_signs
from ._contacts import (
    BELT_1,
    BELT_2,
    CONTACT_NAMES,
    MOTOR_1,
    MOTOR_2,
    NUM_CONTACTS,
    Line,
    U,
    W,
    X,
    Y,
    closure,
    kinetic_friction,
    kinetic_limits,
    line_masses,
    project,
    sliding_speeds,
    static_limits,
)
from ._modes import MODE_NAMES, mode_dmn, mode_number, mode_signs
from ._motors import motor_torque
from ._parameters import CoreXYParameters
from ._resolve_signs import resolve_signs
from ._rows import Row, any_through, each, row, with_place
from ._voltage import AbstractVoltage

GIVES_WAY, NEXT_PIECE = NUM_CONTACTS, NUM_CONTACTS + 1
AT_REST = 1e-12  # sliding speeds below it are rounding of the given state [m/s]


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


class CoreXY(AbstractMechanicalSystem):
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

    Source: Eqs. (1)-(71), errata A1-A12 corrected; Gauss' principle as in `stickslip.contact`.
    """

    parameters: CoreXYParameters
    voltage: AbstractVoltage

    mode_names: ClassVar = MODE_NAMES
    guard_names: ClassVar = (
        *(f"{name} stops" for name in CONTACT_NAMES),
        "resting contacts give way",
        "input jumps",
    )
    units: ClassVar = STATE_UNITS

    def __init__(self, parameters: Given[CoreXYParameters], voltage: Given[AbstractVoltage]):
        self.parameters = check_type("parameters", parameters, CoreXYParameters, "CoreXYParameters")
        self.voltage = check_type("voltage", voltage, AbstractVoltage, "an AbstractVoltage")

    @property
    def guard_scales(self):  # pyright: ignore[reportIncompatibleVariableOverride]
        """1 m/s, all friction of a line, 1 s."""
        return (1.0,) * (NUM_CONTACTS + 2)

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

        **Raises** `ValueError`, `TypeError` for what is not finite.
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

    def velocities(self, y: CoreXYState) -> Line:
        """The four line velocities [m/s]."""
        r = self.parameters.r
        return Line(y.vx, y.vy, r * y.omega_1, r * y.omega_2)

    def torques(self, t: Numeric, y: CoreXYState) -> tuple[Any, Any]:
        """Motor torques [N m], Eq. (3)."""
        p = self.parameters
        v1, v2 = self.voltage.volts(t, y.piece)
        return motor_torque(p, v1, y.omega_1), motor_torque(p, v2, y.omega_2)

    def line_drive(self, t: Numeric, y: CoreXYState) -> tuple[Any, Any]:
        """Forces of the motors on the belt line [N]."""
        one, two = self.torques(t, y)
        return one / self.parameters.r, two / self.parameters.r

    def motion(self, t: Numeric, y: CoreXYState, signs: Row) -> ContactMotion:
        """Acceleration and reaction with the contacts resting and sliding as in `signs`."""
        p = self.parameters
        rest = each(lambda s: s == 0.0, row(signs))
        return contact_motion(line_masses(p), self.line_drive(t, y), kinetic_friction(p, signs), rest)

    def next_mode(self, t: Numeric, y: CoreXYState, signs: Row, started: Row) -> Any:
        """Mode an instant later, by the law of all contacts; see `resolve_signs`."""
        p = self.parameters
        limits = static_limits(p), kinetic_limits(p)
        drive = self.line_drive(t, y)
        return mode_number(resolve_signs(line_masses(p), drive, *limits, signs, started))

    def time_scale(self, args):
        """That of the voltage."""
        return self.voltage.time_scale()

    def vector_field(self, t, y, mode, args):
        p = self.parameters
        a = Line(*self.motion(t, y, mode_signs(mode)).acceleration)
        return CoreXYState(
            x=y.vx,
            y=y.vy,
            vx=a.x,
            vy=a.y,
            theta_1=y.omega_1,
            theta_2=y.omega_2,
            omega_1=a.one / p.r,
            omega_2=a.two / p.r,
            piece=jnp.zeros_like(y.piece),
        )

    def guards(self, t, y, mode, args):
        signs = mode_signs(mode)
        rest = each(lambda s: s == 0.0, signs)
        # The carriage on one of its lines has one speed; so has a motor that rolls, or that stands or
        # whose virtual pulley stands.
        speeds = each(
            lambda s, tied, speed: where((s == 0.0) | tied, 1.0, s * speed),
            signs, any_through(NOT_ALONE, rest), row(sliding_speeds(self.velocities(y))),
        )  # fmt: skip
        reaction = self.motion(t, y, signs).reaction
        share = onset(static_limits(self.parameters), rest, reaction).share
        left = jnp.ones_like(t)
        if self.voltage.has_breaks:
            left = self.voltage.piece_end(y.piece) - t
        return (*speeds, 1.0 - jnp.minimum(share, 1e6), left)

    def transition(self, t, y, mode, guard, args):
        p, old = self.parameters, mode_signs(mode)
        rest = each(lambda s: s == 0.0, old)
        stopped = closure(with_place(rest, guard))
        after_stop = each(lambda rest, s: where(rest, 0.0, s), stopped, old)
        reaction = jax.lax.stop_gradient(self.motion(t, y, old).reaction)
        after_start = onset_signs(old, onset(static_limits(p), rest, reaction))
        gave_way = guard == GIVES_WAY
        signs = each(lambda a, b: where(gave_way, a, b), after_start, after_stop)
        started = each(lambda old, new: gave_way & (old == 0.0) & (new != 0.0), old, signs)
        on_plane = project(self.velocities(y), tuple(stopped))
        moved = guard < NUM_CONTACTS
        y = y._replace(
            vx=where(moved, on_plane.x, y.vx),
            vy=where(moved, on_plane.y, y.vy),
            omega_1=where(moved, on_plane.one / p.r, y.omega_1),
            omega_2=where(moved, on_plane.two / p.r, y.omega_2),
            piece=y.piece + where(guard == NEXT_PIECE, 1.0, 0.0),
        )
        return y, self.next_mode(t, y, signs, started)

    def initial_mode(self, t, y, args):
        speeds = row(sliding_speeds(self.velocities(y)))
        rest = closure(each(lambda v: jnp.abs(v) <= AT_REST, speeds))
        signs = each(lambda r, v: where(r, 0.0, jnp.sign(v)), rest, speeds)
        return self.next_mode(t, y, signs, each(jnp.zeros_like, rest))

    def energy(self, y):
        """Kinetic energy [J]."""
        masses, q = line_masses(self.parameters), self.velocities(y)
        return 0.5 * sum(m * v * v for m, v in zip(masses, q, strict=True))

    def powers(self, t, y, mode, args):
        """`motor_1`, `motor_2`: work of the motors; `friction_...`: loss at each contact [W]."""
        one, two = self.torques(t, y)
        friction = kinetic_friction(self.parameters, mode_signs(mode))
        speeds = sliding_speeds(self.velocities(y))
        losses = {
            f"friction_{name}": f * v for name, f, v in zip(LOSS_NAMES, friction, speeds, strict=True)
        }
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
        signs, speeds = mode_signs(mode), sliding_speeds(self.velocities(y))
        return {
            "slip_1": signs[BELT_1] * speeds[BELT_1],
            "slip_2": signs[BELT_2] * speeds[BELT_2],
        }


# [contact, others]: at rest, one of them takes the contact's speed from the list of guards.
NOT_ALONE = np.zeros((NUM_CONTACTS, NUM_CONTACTS))
NOT_ALONE[[[U], [W]], [X, Y, U, W]] = NOT_ALONE[Y, [U, W]] = 1.0
for _motor, _belt, _turn in ((MOTOR_1, BELT_1, U), (MOTOR_2, BELT_2, W)):
    NOT_ALONE[_motor, _belt] = NOT_ALONE[_belt, [_motor, _turn]] = 1.0

LOSS_NAMES = ("x", "y", "u", "w", "motor_1", "motor_2", "belt_1", "belt_2")
