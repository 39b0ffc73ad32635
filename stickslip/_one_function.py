"""One function for all that are written alike: a lambda of a loop, a cell of a notebook run again."""

import types
import weakref
from collections.abc import Callable
from typing import Any

from ._types import Given

_first: weakref.WeakValueDictionary[Any, types.FunctionType] = weakref.WeakValueDictionary()


def first_alike(function: Given[Callable | str | None]) -> Any:
    """The first function met that has the same code and reads the same globals; others as they are.

    Programs are kept by the functions that they were traced from. Where a function has a closure,
    defaults or attributes, what it computes may change without the other: it is left alone.

    >>> same = [first_alike(lambda x: x + 1) for _ in range(2)]
    >>> same[0] is same[1]
    True
    """
    if not isinstance(function, types.FunctionType):
        return function
    if function.__closure__ or function.__defaults__ or function.__kwdefaults__ or vars(function):
        return function
    return _first.setdefault((function.__code__, id(function.__globals__)), function)
