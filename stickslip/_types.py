"""Types of arguments that a function checks itself.

`Given[T]` is `T` to readers and to static checkers. When it runs it admits everything: the check of
types at call time, which the tests switch on, would otherwise come before the function's own, whose
error names the argument, its value and what is allowed.

>>> Given[int | None]
stickslip._types.Given[int | None]
>>> isinstance("seven", Given[int])
True
"""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

import numpy as np
from jax import Array

T = TypeVar("T")

if TYPE_CHECKING:
    Given = Annotated[T, "checked by the function that takes it"]
    # None unless it was asked for: who asked for it need not say so again to a type checker.
    MaybeNone: TypeAlias = Any

    def overridable(read: Callable[[Any], T]) -> T: ...

else:
    MaybeNone = None
    overridable = property  # in whose place a subclass may have an attribute of the class

    class _Unread(type):
        """Class of types that every value is an instance of."""

        def __instancecheck__(cls, value: Any) -> bool:
            return True

        def __repr__(cls) -> str:
            return f"{cls.__module__}.{cls.__qualname__}"

    class Given(metaclass=_Unread):
        """`Given[T]`: a `T`, checked by the function that takes it."""

        allowed: Any = Any

        def __class_getitem__(cls, allowed: Any) -> type:
            shown = allowed.__qualname__ if isinstance(allowed, type) else str(allowed)
            named = {
                "allowed": allowed, "__module__": __name__, "__qualname__": f"Given[{shown}]",
                "__doc__": f"{shown}, checked by the function that takes it.",
            }  # fmt: skip
            return _Unread("Given", (), named)


# A real number or an array of them, traced or not.
Numeric: TypeAlias = Given[float | int | np.floating | np.integer | np.ndarray | Array]
Row: TypeAlias = Given[Sequence[float] | Array | np.ndarray]  # a row of real numbers
Rows: TypeAlias = Given[Sequence[Row] | np.ndarray]  # rows of real numbers
Whole: TypeAlias = Given[int | np.integer | Array | np.ndarray]  # an integer, traced or not
Mode: TypeAlias = Given[str | int | np.integer | Array | np.ndarray]  # of a mode: its name or number
Path: TypeAlias = Given[str | os.PathLike[str]]
Named: TypeAlias = Given[Mapping[str, Any]]  # values of any type by name
NamedNumbers: TypeAlias = Given[Mapping[str, float | np.ndarray | Array]]
NamedRows: TypeAlias = Given[Mapping[str, Sequence[Any] | Array | np.ndarray]]
