"""Modes of several contacts: two bits each, and names made when they are asked for."""

import itertools
from collections.abc import Sequence
from typing import Any, overload

import jax.numpy as jnp

from stickslip._fastmath import where

BACKWARD, REST, FORWARD, OPEN = 0, 1, 2, 3
WORDS = ("slip backward", "stick", "slip forward", "open")
BITS = 2  # of each contact, the first contact the lowest
MOST_IN_32, MOST = 15, 31  # contacts whose mode is an integer of 32, and of 64 bits


class ModeNames(Sequence):
    """Names of all modes, `"stick / slip forward"`: $4^m$ for m contacts, made when asked for.

    Modes in which a contact that does not open is open have names too, and are never taken.
    """

    def __init__(self, contacts: int):
        self.contacts = contacts

    def __len__(self) -> int:
        return 4**self.contacts if self.contacts else 1

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
        if not self.contacts:
            return "motion"
        return " / ".join(WORDS[(number >> BITS * c) & 3] for c in range(self.contacts))

    def index(self, value: Any, start: int = 0, stop: int | None = None) -> int:
        if isinstance(value, str):
            words = value.split(" / ") if self.contacts else []
            if value == "motion" and not self.contacts:
                return 0
            if len(words) == self.contacts and set(words) <= set(WORDS):
                return sum(WORDS.index(word) << BITS * c for c, word in enumerate(words))
        raise ValueError(f"{value!r} is not the name of a mode")

    def __contains__(self, value: object) -> bool:
        try:
            self.index(value)
        except ValueError:
            return False
        return True

    def __iter__(self):
        if not self.contacts:
            return iter(("motion",))
        names = itertools.product(WORDS, repeat=self.contacts)
        return (" / ".join(reversed(name)) for name in names)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ModeNames) and other.contacts == self.contacts

    def __hash__(self) -> int:
        return hash((ModeNames, self.contacts))

    def __repr__(self) -> str:
        return f"ModeNames({self.contacts})"


def _word(contacts: int) -> Any:
    """Integers of as many bits as the mode of so many contacts needs."""
    return jnp.int64 if contacts > MOST_IN_32 else jnp.int32


def states_of(mode: Any, contacts: int) -> list[Any]:
    """-1, 0 or 1 for each contact, the sense of its slip, and 2 where it is open; from the mode."""
    word = _word(contacts)
    mode = jnp.asarray(mode, word)
    if contacts == 1:
        return [mode.astype(jnp.float64) - 1.0]
    return [((mode >> word(BITS * c)) & word(3)).astype(jnp.float64) - 1.0 for c in range(contacts)]


def mode_of(states: Sequence[Any]) -> Any:
    """The mode of such states."""
    mode, word = None, _word(len(states))
    for c, s in enumerate(states):
        part = (jnp.asarray(s) + 1.0).astype(word) * word(4**c)
        mode = part if mode is None else mode + part
    return jnp.zeros((), jnp.int32) if mode is None else mode


def sense_of(state: Any) -> Any:
    """-1 where the contact slips backward, else 1."""
    return where(state < 0.0, -1.0, 1.0)
