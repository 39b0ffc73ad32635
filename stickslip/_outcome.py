"""Items of enumerations of results that say their names."""

from collections import Counter
from typing import Any, TypeVar

import equinox as eqx
import numpy as np
from jaxtyping import Array

from ._types import Given
from ._validation import is_concrete

Enumeration = TypeVar("Enumeration", bound=type)


class _One(eqx.Enumeration):  # pyright: ignore[reportGeneralTypeIssues]
    one = ""


# The class of items, which equinox keeps to itself.
_Item: Any = type(_One.one)


class Outcome(_Item):
    """An item of an enumeration, or an array of them; `str` gives the name, or how many of each."""

    def __str__(self) -> str:
        if not is_concrete(self._value):
            return f"{self._enumeration.__name__}(traced)"
        names = names_of(self)
        if np.ndim(self._value) == 0:
            return str(names)
        return ", ".join(f"{n:,} {name}" for name, n in tally(names).items())

    def __repr__(self) -> str:
        name = self._enumeration.__name__
        plain = is_concrete(self._value) and np.ndim(self._value) == 0
        return f"{name}.{self}" if plain else f"{name}({str(self).removeprefix(name).strip('()')})"


def names_of(item: Any) -> np.ndarray:
    """Names of an item, or of an array of them, in an array of its shape."""
    enumeration = item._enumeration
    names = np.asarray(list(enumeration._name_to_item))
    return np.asarray(names[np.asarray(item._value)])


def tally(names: np.ndarray) -> dict[str, int]:
    """How many there are of each, those that succeeded first, then the most frequent."""
    found = Counter(np.ravel(names).tolist()).most_common()
    return dict(sorted(found, key=lambda pair: pair[0] != "successful"))


def in_words(enumeration: Enumeration) -> Enumeration:
    """Class decorator: the items of an enumeration are `Outcome`s."""
    named: Any = enumeration
    for name, item in named._name_to_item.items():
        named._name_to_item[name] = Outcome(item._value, named)
    chosen, promoted = named.where.__func__, named.promote.__func__

    def where(cls, pred: Given[bool | Array], a: Outcome, b: Outcome) -> Outcome:
        found = chosen(cls, pred, a, b)
        return found if isinstance(found, Outcome) else Outcome(found._value, cls)

    def promote(cls, item: Given[eqx.Enumeration]) -> Outcome:
        return Outcome(promoted(cls, item)._value, cls)

    named.where, named.promote = classmethod(where), classmethod(promote)
    return enumeration
