"""A public callable with arguments that are right, of which one at a time is replaced."""

import dataclasses
from collections.abc import Callable
from typing import Any


class Reached(Exception):
    """All checks were passed."""


def reached(*_: Any, **__: Any) -> Any:
    """In place of what takes long and lies behind the checks."""
    raise Reached


@dataclasses.dataclass(frozen=True)
class Argument:
    """A value that is right, and the groups of `TAKEN` that are."""

    value: Any
    takes: tuple[str, ...]


def arg(value: Any, *takes: str) -> Argument:
    """An argument of a target."""
    return Argument(value, takes)


@dataclasses.dataclass(frozen=True)
class Target:
    """A public callable and its arguments; `call` takes them by name where it does not itself."""

    of: Any
    arguments: dict[str, Argument]
    call: Callable | None = None

    @property
    def name(self) -> str:
        return self.of.__qualname__

    def __call__(self, changes: dict[str, Any]) -> Any:
        values = {name: argument.value for name, argument in self.arguments.items()} | changes
        return (self.call or self.of)(**values)
