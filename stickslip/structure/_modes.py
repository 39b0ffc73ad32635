"""Modes of a system with sliders: that of the system, and for each element which sliders slip."""

import math
from collections.abc import Sequence
from typing import Any

from ..hybrid.names import MadeNames

OPEN = "open"


class SliderModes(MadeNames):
    """Names of all modes, `"stick / 3 of 10 slip forward"`: those of the system, then of the elements.

    Of an element with $n$ sliders the weakest slip first, so that it is in one of $2n + 1$ states, from
    all slip backward to all slip forward; one whose bound varies has one more, `"open"`.
    """

    def __init__(self, system: Sequence[str], counts: tuple[int, ...], varies: tuple[bool, ...]):
        self.system, self.counts, self.varies = system, counts, varies

    @property
    def bases(self) -> tuple[int, ...]:
        """How many states each element has."""
        return tuple(2 * n + 1 + v for n, v in zip(self.counts, self.varies, strict=True))

    @property
    def places(self) -> tuple[int, ...]:
        """The factor of each state in the mode."""
        first = len(self.system)
        return tuple(first * math.prod(self.bases[:j]) for j in range(len(self.counts)))

    def __len__(self) -> int:
        return len(self.system) * math.prod(self.bases)

    def word(self, element: int, state: int) -> str:
        """The name of a state of an element, $-n$ to $n$, and $n + 1$ where it is open."""
        n = self.counts[element]
        if state > n:
            return OPEN
        if state == 0:
            return "stick"
        sense = "slip forward" if state > 0 else "slip backward"
        return sense if n == 1 else f"{abs(state)} of {n} {sense}"

    def name(self, number: int) -> str:
        inner = len(self.system)
        words = [self.system[number % inner]] if inner > 1 else []
        for j, (base, place) in enumerate(zip(self.bases, self.places, strict=True)):
            words.append(self.word(j, number // place % base - self.counts[j]))
        return " / ".join(words)

    def index(self, value: Any, start: int = 0, stop: int | None = None) -> int:
        if isinstance(value, str):
            words = value.split(" / ")
            own = words[len(words) - len(self.counts) :]
            rest, number = " / ".join(words[: len(words) - len(self.counts)]), 0
            if len(self.system) > 1:
                number = self.system.index(rest)
            states = [self._state(j, word) for j, word in enumerate(own)]
            if len(own) == len(self.counts) and None not in states and (rest or len(self.system) == 1):
                digits = zip(states, self.counts, self.places, strict=True)
                return number + sum((s + n) * place for s, n, place in digits if s is not None)
        raise ValueError(f"{value!r} is not the name of a mode")

    def _state(self, element: int, word: str) -> int | None:
        n = self.counts[element]
        every = range(-n, n + 1 + self.varies[element])
        return next((s for s in every if self.word(element, s) == word), None)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SliderModes) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash((SliderModes, len(self.system), self.counts, self.varies))

    def __repr__(self) -> str:
        return f"SliderModes({len(self.system)} modes, {self.counts})"
