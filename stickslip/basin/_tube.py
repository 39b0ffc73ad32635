"""The neighbourhood of an attractor in which motions are seen to come nearer to it."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._accuracy import ACCURACY


class Tube(NamedTuple):
    """Pieces of a motion in the space of the states: cubics through their ends and slopes.

    - `start`, `end`: `[piece, size]`; `leaving`, `arriving`: slopes there times the duration of the
      piece. A single state is a piece that ends where it starts.
    - `mode`: `[piece]`, -1 for pieces that fill up the array.
    - `across`: `[size, size]`, takes the shifts out of a difference that change nothing.
    - `scale`, `turn`: `[size]`, the size of each component, and of an angle its period, otherwise
      infinite.
    """

    start: np.ndarray
    end: np.ndarray
    leaving: np.ndarray
    arriving: np.ndarray
    mode: np.ndarray
    across: np.ndarray
    scale: np.ndarray
    turn: np.ndarray


def tube_of(rows: Any, modes: Any, across: Any, scale: Any, turn: Any) -> Tube:
    """A tube about rows `(t, y, dy)` of one motion, one about each row where there are no slopes."""
    t, y, slope = rows
    modes = np.asarray(modes, np.int64)
    if slope is None:
        none = np.zeros_like(y)
        return Tube(y, y, none, none, modes, across, scale, turn)
    span = np.diff(t)[:, None]
    whole = (span[:, 0] > 0.0) & (modes[1:] == modes[:-1])
    leaving, arriving = (slope[:-1] * span)[whole], (slope[1:] * span)[whole]
    return Tube(y[:-1][whole], y[1:][whole], leaving, arriving, modes[:-1][whole], across, scale, turn)


def stack_of(tubes: list[Tube], size: int) -> Tube:
    """Tubes of states of a size with one more axis in front: as many as a power of two and as long as
    one, filled up with some that are nowhere near."""
    pieces = 1 << max(max((len(tube.mode) for tube in tubes), default=1) - 1, 0).bit_length()

    def longer(tube: Tube) -> Tube:
        more = pieces - len(tube.mode)
        rows = {name: np.pad(getattr(tube, name), ((0, more), (0, 0))) for name in Tube._fields[:4]}
        return tube._replace(mode=np.pad(tube.mode, (0, more), constant_values=-1), **rows)

    row, ones = np.zeros((1, size)), np.ones(size)
    none = Tube(row, row, row, row, np.full(1, -1), np.eye(size), ones, np.inf * ones)
    more = (1 << max(len(tubes) - 1, 0).bit_length()) - len(tubes)
    return jax.tree.map(lambda *leaves: np.stack(leaves), *map(longer, [*tubes, *[none] * more]))


def distances(tubes: list[Tube], y: np.ndarray, mode: np.ndarray) -> np.ndarray:
    """How far each state `[lane, size]` is from each tube, in parts of its sizes, `[lane, tube]`;
    infinite in another mode."""
    count, size = len(y), ACCURACY.many
    away = np.zeros((count, len(tubes)))
    mode = np.asarray(mode, np.int64)
    # Tube by tube, in blocks of one size: few programs for all numbers of them.
    for k, tube in enumerate(tubes):
        one = stack_of([tube], y.shape[1])
        for begin in range(0, count, size):
            rows = np.minimum(np.arange(begin, begin + size), count - 1)
            found = _distances(one, y[rows], mode[rows])
            away[begin : begin + size, k] = np.asarray(found)[: count - begin, 0]
    return away


@eqx.filter_jit
def _distances(tubes: Tube, y: Any, mode: Any) -> Any:
    return jax.vmap(lambda *lane: distances_of_one(tubes, *lane))(y, mode)


def distances_of_one(tubes: Tube, y: Any, mode: Any) -> Any:
    """How far one state is from each of several tubes, `[tube]`; see `distances`."""

    def of_one(tube: Tube):
        is_angle = jnp.isfinite(tube.turn)
        turn = jnp.where(is_angle, tube.turn, 1.0)[None, :]

        def scaled(rows):
            return (rows @ tube.across.T) / tube.scale[None, :]

        def apart(place):
            away = y[None, :] - place
            return scaled(away - jnp.where(is_angle[None, :], turn * jnp.round(away / turn), 0.0))

        def towards(part, place, slope):
            """Nearer to the foot of the perpendicular on the cubics, by a step of Gauss and Newton."""
            length = jnp.sum(slope**2, axis=1, keepdims=True)
            move = jnp.sum(apart(place) * slope, axis=1, keepdims=True)
            return jnp.clip(part + move / jnp.where(length > 0.0, length, 1.0), 0.0, 1.0)

        none = jnp.zeros((tube.start.shape[0], 1))
        part = towards(none, tube.start, scaled(tube.end - tube.start))
        for _ in range(2):
            place, slope = _cubic(tube, part)
            part = towards(part, place, scaled(slope))
        away = jnp.linalg.norm(apart(_cubic(tube, part)[0]), axis=1)
        return jnp.min(jnp.where(tube.mode == mode, away, jnp.inf))

    return jax.vmap(of_one)(tubes)


def _cubic(tube: Tube, s: Any) -> tuple[Any, Any]:
    """Hermite's cubic and its slope at a part `s` of each piece."""
    rise = tube.end - tube.start
    a = tube.leaving - rise
    b = rise - tube.arriving
    value = tube.start + s * rise + s * (1.0 - s) * (a * (1.0 - s) + b * s)
    slope = rise + (1.0 - 2.0 * s) * (a * (1.0 - s) + b * s) + s * (1.0 - s) * (b - a)
    return value, slope
