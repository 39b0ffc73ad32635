"""What a feedforward is: pieces of constant acceleration, and the voltages that make them."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip.checks import Numeric, check_arguments, is_concrete, reals

from ._leg import Leg, Piece
from ._parameters import CoreXYParameters
from ._voltage import Ramps

ROWS = 32  # tables are filled up to a multiple of it, so that plans share compiled programs
CUT = 1e-7  # part of a leg's greatest speed at which its voltage goes off
PAUSE = 1e-4  # part of a leg's time for which it stays off


class Feedforward(eqx.Module):
    """What `feedforward` found.

    - `parameters`, `points` [m] as given. `voltage`: a `Ramps`, 0 V from `end` [s] on.
    - `times` [s], where each piece of constant acceleration begins, and the end; for each piece
      `position` [m] and `velocity` [m/s] at its begin, `acceleration` [m/s²], `[piece, 2]`, and
      `belt_force` [N], what each belt carries, `[piece, 2]`.
    - `leg_times` [s]: when each of the `points` is reached.
    """

    parameters: CoreXYParameters
    points: Float[Array, "point 2"]
    voltage: Ramps
    times: Float[Array, " time"]
    position: Float[Array, "piece 2"]
    velocity: Float[Array, "piece 2"]
    acceleration: Float[Array, "piece 2"]
    belt_force: Float[Array, "piece 2"]
    leg_times: Float[Array, " point"]

    def __repr__(self) -> str:
        if not is_concrete(self):
            return f"Feedforward(traced, of {self.points.shape[0]} points)"
        count = self.acceleration.shape[0]
        pieces = f"{count:,} {'piece' if count == 1 else 'pieces'} of constant acceleration"
        return f"Feedforward: {self.points.shape[0]:,} points in {float(self.end):.6g} s, {pieces}"

    @property
    def end(self) -> Float[Array, ""]:
        """Time [s] at which the last point is reached."""
        return self.times[-1]

    @check_arguments(t=reals)
    def at(self, t: Numeric) -> Float[Array, "*times 2"]:
        """Planned position [m] at `t` [s]; that of the last point after the end."""
        t = jnp.clip(jnp.asarray(t, jnp.float64), 0.0, self.end)
        piece = jnp.clip(jnp.searchsorted(self.times, t, side="right") - 1, 0, self.times.size - 2)
        since = (t - self.times[piece])[..., None]
        return self.position[piece] + since * (
            self.velocity[piece] + 0.5 * since * self.acceleration[piece]
        )


def joined(p: CoreXYParameters, points: np.ndarray, legs: list[tuple[Leg, list[Piece]]]) -> Feedforward:
    """All legs after each other, each begun at rest."""
    t, times, places, velocities, accelerations, forces = 0.0, [0.0], [], [], [], []
    table, reached = [], [0.0]
    for (leg, pieces), start in zip(legs, points, strict=False):
        way = 0.0
        for piece in pieces:
            d = leg.direction
            volts = leg.voltage(piece.a, piece.hold, piece.speed)
            table.append((t, *volts, *(leg.emf * piece.a)))
            places.append(start + way * d)
            velocities.append(piece.speed * d)
            accelerations.append(piece.a * d)
            forces.append(leg.belt_forces(piece.a, piece.hold))
            way += piece.speed * piece.duration + 0.5 * piece.a * piece.duration**2
            t += piece.duration
            times.append(t)
        # The voltage is off a moment before the stop, so that the contacts come to rest one by one and
        # not all within rounding, and for a moment after it, so that they do.
        table.append((t - CUT * max(p.speed for p in pieces) / abs(pieces[-1].a), 0.0, 0.0, 0.0, 0.0))
        reached.append(t)
        places.append(start + way * leg.direction)
        velocities.append(np.zeros(2))
        accelerations.append(np.zeros(2))
        forces.append(np.zeros(2))
        t += PAUSE * (t - reached[-2])
        times.append(t)
    more = -(-len(table) // ROWS) * ROWS - len(table)
    table += [(t + float(i), 0.0, 0.0, 0.0, 0.0) for i in range(more)]
    voltage = Ramps(*(jnp.asarray(column) for column in np.array(table).T))
    rows = (times, places, velocities, accelerations, forces, reached)
    return Feedforward(p, jnp.asarray(points), voltage, *(jnp.asarray(np.array(a)) for a in rows))
