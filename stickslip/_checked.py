"""Modules whose arguments are checked before equinox sees them."""

import dataclasses
from typing import TYPE_CHECKING, Any, dataclass_transform

import equinox as eqx

from ._validation import leaves_of


# Type checkers forget what they know of equinox's own metaclass, whose base they cannot follow here.
@dataclass_transform(field_specifiers=(dataclasses.field, eqx.field))
class CheckedModule(type(eqx.Module)):  # pyright: ignore[reportGeneralTypeIssues]
    """Metaclass of modules that users make, and that have no `__init__` of their own.

    Equinox flattens what such a module is given before it calls anything of ours. A list that holds
    itself ends there in an internal error, after which Python has lost count of its recursion; so it is
    refused here by name.
    """

    if not TYPE_CHECKING:  # type checkers look at the fields, not at what this returns

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:
            names = [field.name for field in dataclasses.fields(cls) if field.init]
            for name, value in (*zip(names, args, strict=False), *kwargs.items()):
                leaves_of(name, value)
            return super().__call__(*args, **kwargs)
