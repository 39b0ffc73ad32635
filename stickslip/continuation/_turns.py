"""Whole turns of angles: how often each goes round in a period, and what is left of a difference."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._validation import MOST, check_mapping, refusal, whole_number
from ..hybrid import AbstractHybridSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.components import components_of, period_of
from ._accuracy import ACCURACY

# Of an angle that a shift moves along with others: by so many turns it may have gone on beside it.
BESIDE = sorted(range(-6, 7), key=lambda turns: (abs(turns), -turns))


def turns_of(system: AbstractHybridSystem, y: PyTree) -> np.ndarray:
    """Period of each number of the flat state that is an angle, infinite for the others."""
    parts = []
    for name, leaf in components_of(y).items():
        turn = period_of(system, name)
        parts.append(np.full(int(np.size(leaf)), np.inf if turn is None else turn))
    return np.concatenate(parts)


def given_turns(
    system: AbstractHybridSystem, y: PyTree, turns: Mapping[str, Any] | None
) -> Float[Array, " size"]:
    """Turns that a guess says, by name; NaN for those it does not say, 0 for what is not an angle."""
    turns = check_mapping("guess.turns", turns, "a mapping from names of angles to whole numbers")
    angles = [name for name in components_of(y) if period_of(system, name) is not None]
    for name, count in turns.items():
        if name not in angles:
            raise refusal(
                "guess.turns", name, f"names with a period: {', '.join(angles) or 'there are none'}"
            )
        whole_number(f"guess.turns[{name!r}]", count, -MOST, MOST)
    parts = []
    for name, leaf in components_of(y).items():
        count = turns.get(name, np.nan) if name in angles else 0
        parts.append(jnp.broadcast_to(jnp.asarray(count, jnp.float64), (int(np.size(leaf)),)))
    return jnp.concatenate(parts)


def whole_turns(
    away: Float[Array, "..."], neutral: Float[Array, "size size"], turn: np.ndarray
) -> Float[Array, "..."]:
    """How often angles go round between states that differ by this, but for shifts that change nothing.

    `neutral`: projection on these, in the units of the state. An angle that they move is taken to zero
    by them first: by how much of a turn it has gone on is of no account. Where they move others by
    parts of its turn, as in a coupling by $2\\phi_1 - 3\\phi_2$, whole turns of it matter to these.
    """
    angles, is_angle = np.flatnonzero(np.isfinite(turn)), np.isfinite(turn)
    period, row = np.where(is_angle, turn, 1.0), (1,) * (away.ndim - 1) + turn.shape
    left, rest = neutral, away / period.reshape(row)
    for i in angles:
        new = left[i, i] > ACCURACY.short
        column = jnp.where(new, left[:, i] / jnp.where(new, left[i, i], 1.0), 0.0)
        left = left - column[:, None] * left[i][None, :]
        column = (column * period[i] / period).reshape(row)
        tried = np.asarray(BESIDE if angles.size > 1 else BESIDE[:1], float)
        beyond = rest[None, ..., i] - tried.reshape(-1, *row[:-1])
        rests = rest[None] - beyond[..., None] * column[None]
        # Angles that no other shift moves say which.
        held = is_angle & (jnp.diagonal(left) <= ACCURACY.short)
        off = jnp.sum(
            jnp.square(rests - jnp.round(rests)) @ jnp.diag(held.astype(rests.dtype)), axis=-1
        )
        # Of counts that leave the same the first is taken.
        best = jnp.argmax(off <= jnp.min(off, axis=0, keepdims=True) + ENGINE.same, axis=0)
        rest = jnp.take_along_axis(rests, best[None, ..., None], axis=0)[0]
    return jnp.where(is_angle.reshape(row) & jnp.isfinite(rest), jnp.round(rest), 0.0)


def without(
    away: Float[Array, "..."], turns: Float[Array, "..."], neutral: Array, turn: np.ndarray
) -> Float[Array, "..."]:
    """Differences of states without so many turns and without shifts that change nothing."""
    period = np.where(np.isfinite(turn), turn, 0.0).reshape((1,) * (away.ndim - 1) + turn.shape)
    left = away - turns * period
    return left - left @ neutral.T


def apart(
    away: Float[Array, "..."], neutral: Float[Array, "size size"], turn: np.ndarray
) -> Float[Array, "..."]:
    """Differences of states without whole turns of angles and without shifts that change nothing."""
    return without(away, whole_turns(away, neutral, turn), neutral, turn)
