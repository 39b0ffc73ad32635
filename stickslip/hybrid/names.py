"""Names that are made when they are asked for, where there may be more of them than memory holds."""

import abc
from collections.abc import Sequence
from typing import Any, overload


class MadeNames(Sequence):
    """A sequence of names; a subclass has a length, the name of a number, the number of a name."""

    @abc.abstractmethod
    def name(self, number: int) -> str:
        """Of a number that is within the length."""

    @abc.abstractmethod
    def index(self, value: Any, start: int = 0, stop: int | None = None) -> int:
        """Of a name. Raises `ValueError` for one that is none."""

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        number = int(index)
        number += len(self) if number < 0 else 0
        if not 0 <= number < len(self):
            raise IndexError(f"mode {index} of {len(self)}")
        return self.name(number)

    def __contains__(self, value: object) -> bool:
        try:
            self.index(value)
        except ValueError:
            return False
        return True
