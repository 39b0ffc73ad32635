"""Declarations that hold whatever the `args` are: these are not known before a run brings them.

A declaration may have a default for the time when there are none, and then looks as if it had another
structure than in the run. So it is asked twice: without `args`, and with some that nobody may look at.
"""

from collections.abc import Callable, Mapping
from typing import Any


class Looked(BaseException):
    """A declaration looks at its `args`. No `Exception`, since a default may be what follows on one."""


class Sealed:
    """`args` of which nothing is known: `Looked` is raised by every use, and noted if it is caught."""

    __slots__ = ("looked",)

    def __init__(self):
        object.__setattr__(self, "looked", [])

    def _look(self, *args: Any, **named: Any) -> Any:
        object.__getattribute__(self, "looked").append(True)
        raise Looked

    __getattribute__ = __setattr__ = __delattr__ = __dir__ = __call__ = _look
    __getitem__ = __setitem__ = __delitem__ = __contains__ = __iter__ = __len__ = __reversed__ = _look
    __bool__ = __int__ = __float__ = __complex__ = __index__ = __hash__ = _look
    __str__ = __repr__ = __format__ = __bytes__ = _look
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _look
    __neg__ = __pos__ = __abs__ = __invert__ = __round__ = __trunc__ = __floor__ = __ceil__ = _look
    __add__ = __sub__ = __mul__ = __truediv__ = __floordiv__ = __mod__ = __divmod__ = _look
    __pow__ = __matmul__ = __lshift__ = __rshift__ = __and__ = __or__ = __xor__ = _look
    __radd__ = __rsub__ = __rmul__ = __rtruediv__ = __rfloordiv__ = __rmod__ = __rdivmod__ = _look
    __rpow__ = __rmatmul__ = __rlshift__ = __rrshift__ = __rand__ = __ror__ = __rxor__ = _look
    __enter__ = __exit__ = __next__ = _look


# As one, it takes part in `match` by keys.
Mapping.register(Sealed)  # pyright: ignore[reportAttributeAccessIssue]


def with_any_args(analysis: Callable[[Any], set]) -> set:
    """Results of `analysis(args)` that hold both without `args` and with unknown ones.

    Nothing if it looks at them or fails: what fails here takes `args` of some kind, or raises an error
    where the run brings its own."""
    sealed, found = Sealed(), []
    for args in (None, sealed):
        try:
            found.append(analysis(args))
        except (Exception, Looked):
            return set()
        if not found[-1] or object.__getattribute__(sealed, "looked"):
            return set()
    return set.intersection(*found)
