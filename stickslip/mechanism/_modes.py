"""Modes: two bits a contact, one a stop, and names made when they are asked for."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from stickslip._fastmath import where
from stickslip.hybrid.names import MadeNames

BACKWARD, REST, FORWARD, OPEN = 0, 1, 2, 3
WORDS = ("slip backward", "stick", "slip forward", "open")
STOP_WORDS = ("open", "closed")
BITS = 2  # of each contact, the first contact the lowest; each stop has one, above all contacts
# Contacts whose mode is an integer of 32, and of 64 bits, one of which is its sign.
MOST_IN_32, MOST = 31 // BITS, 63 // BITS


class ModeNames(MadeNames):
    """Names of all modes, `"stick / slip forward"`: $4^m 2^s$ for m contacts and s stops.

    They are made when asked for. Modes in which a contact that does not open is open have names too,
    and are never taken.
    """

    def __init__(self, contacts: int, stops: int = 0):
        self.contacts, self.stops = contacts, stops

    def __len__(self) -> int:
        return 4**self.contacts * 2**self.stops

    def name(self, number: int) -> str:
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

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ModeNames) and hash(self) == hash(other)

    def __hash__(self) -> int:
        return hash((ModeNames, self.contacts, self.stops))

    def __repr__(self) -> str:
        return f"ModeNames({self.contacts}, {self.stops})"


def _word(contacts: int, stops: int) -> Any:
    """Integers of as many bits as the mode of so many contacts and stops needs."""
    return jnp.int64 if BITS * contacts + stops > BITS * MOST_IN_32 else jnp.int32


def states_of(mode: Any, contacts: int, stops: int = 0) -> list[Any]:
    """-1, 0 or 1 for each contact, the sense of its slip, and 2 where it is open; from the mode.

    Then 0 for each stop that is closed, and 2 where it is open.
    """
    word = _word(contacts, stops)
    mode = jnp.asarray(mode, word)
    if (contacts, stops) == (1, 0):
        return [mode.astype(jnp.float64) - 1.0]
    found = [((mode >> word(BITS * c)) & word(3)).astype(jnp.float64) - 1.0 for c in range(contacts)]
    for k in range(stops):
        closed = (mode >> word(BITS * contacts + k)) & word(1)
        found.append(where(closed == 1, 0.0, 2.0))
    return found


def mode_of(states: Sequence[Any], stops: int = 0) -> Any:
    """The mode of such states; the last `stops` of them are those of stops."""
    contacts = len(states) - stops
    mode, word = None, _word(contacts, stops)
    for c, s in enumerate(states):
        if c < contacts:
            part = (jnp.asarray(s) + 1.0).astype(word) * word(4**c)
        else:
            part = where(s == 0.0, word(4**contacts * 2 ** (c - contacts)), word(0))
        mode = part if mode is None else mode + part
    return jnp.zeros((), jnp.int32) if mode is None else mode


def sense_of(state: Any) -> Any:
    """-1 where the contact slips backward, else 1."""
    return where(state < 0.0, -1.0, 1.0)
