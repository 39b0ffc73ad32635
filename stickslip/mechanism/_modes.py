"""Modes: two bits a contact, one a stop, and names made when they are asked for."""

from collections.abc import Sequence
from typing import Any, overload

import jax.numpy as jnp

from stickslip._fastmath import where

BACKWARD, REST, FORWARD, OPEN = 0, 1, 2, 3
WORDS = ("slip backward", "stick", "slip forward", "open")
STOP_WORDS = ("open", "closed")
BITS = 2  # of each contact, the first contact the lowest; each stop has one, above all contacts
MOST_IN_32 = 15  # contacts whose mode is a 32-bit integer, as the engine keeps it


class ModeNames(Sequence):
    """Names of all modes, `"stick / slip forward"`: $4^m 2^s$ for m contacts and s stops.

    They are made when asked for. Modes in which a contact that does not open is open have names too,
    and are never taken.
    """

    def __init__(self, contacts: int, stops: int = 0):
        self.contacts, self.stops = contacts, stops

    def __len__(self) -> int:
        return 4**self.contacts * 2**self.stops

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index):
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        number = int(index)
        number += len(self) if number < 0 else 0
        if not 0 <= number < len(self):
            raise IndexError(f"mode {index} of {len(self)}")
        words = [WORDS[(number >> BITS * c) & 3] for c in range(self.contacts)]
        number >>= BITS * self.contacts
        words += [STOP_WORDS[(number >> k) & 1] for k in range(self.stops)]
        return " / ".join(words) or "motion"

    def index(self, value: Any, start: int = 0, stop: int | None = None) -> int:
        if isinstance(value, str):
            all_words = [WORDS] * self.contacts + [STOP_WORDS] * self.stops or [("motion",)]
            words = value.split(" / ")
            if len(words) == len(all_words) and all(map(tuple.__contains__, all_words, words)):
                number, place = 0, 1
                for known, word in zip(all_words, words, strict=True):
                    number += known.index(word) * place
                    place *= len(known)
                return number
        raise ValueError(f"{value!r} is not the name of a mode")

    def __contains__(self, value: object) -> bool:
        try:
            self.index(value)
        except ValueError:
            return False
        return True

    def __iter__(self):
        return (self[i] for i in range(len(self)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ModeNames) and hash(self) == hash(other)

    def __hash__(self) -> int:
        return hash((ModeNames, self.contacts, self.stops))

    def __repr__(self) -> str:
        return f"ModeNames({self.contacts}, {self.stops})"


def states_of(mode: Any, contacts: int, stops: int = 0) -> list[Any]:
    """-1, 0 or 1 for each contact, the sense of its slip, and 2 where it is open; from the mode.

    Then 0 for each stop that is closed, and 2 where it is open.
    """
    mode = jnp.asarray(mode, jnp.int32)
    if (contacts, stops) == (1, 0):
        return [mode.astype(jnp.float64) - 1.0]
    found = [
        ((mode >> jnp.int32(BITS * c)) & jnp.int32(3)).astype(jnp.float64) - 1.0
        for c in range(contacts)
    ]
    for k in range(stops):
        closed = (mode >> jnp.int32(BITS * contacts + k)) & jnp.int32(1)
        found.append(where(closed == 1, 0.0, 2.0))
    return found


def mode_of(states: Sequence[Any], contacts: int) -> Any:
    """The mode of such states."""
    mode, place = None, 1
    for c, s in enumerate(states):
        if c < contacts:
            part, count = (jnp.asarray(s) + 1.0).astype(jnp.int32), 4
        else:
            part, count = where(s == 0.0, jnp.int32(1), jnp.int32(0)), 2
        mode = part * jnp.int32(place) if mode is None else mode + part * jnp.int32(place)
        place *= count
    return jnp.zeros((), jnp.int32) if mode is None else mode


def sense_of(state: Any) -> Any:
    """-1 where the contact slips backward, else 1."""
    return where(state < 0.0, -1.0, 1.0)
