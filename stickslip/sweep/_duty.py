"""What a call of `run_sweep` is made for: its results, only its store, or a share of the work."""

import contextlib
import contextvars
import os
import pathlib
from collections.abc import Iterator
from typing import Any, NoReturn, Protocol, runtime_checkable

from ._store import Store
from .evaluate import Evaluate
from .grid import Block


@runtime_checkable
class Duty(Protocol):
    """What is done with a store, once it is known which sweep it is."""

    mark: str  # of one worker among several; empty for who is alone at the store
    threads: int | None  # that each worker computes with; None for what the caller says

    def do(self, store: Store, evaluate: Evaluate, units: list[Block]) -> Any:
        """Do it; what is returned is handed to who gave the duty."""
        ...

    def goes_on(self, found: Any) -> bool:
        """Whether a store that follows from the results of this one is to be worked on too."""
        ...


class Done(BaseException):
    """Ends the call that described the sweep: what it would do with the results is not wanted."""


_HERE: contextvars.ContextVar[tuple[pathlib.Path, Duty, list[Any]] | None] = contextvars.ContextVar(
    "duty", default=None
)


@contextlib.contextmanager
def on_duty(path: pathlib.Path, duty: Duty) -> Iterator[list[Any]]:
    """Inside, a sweep into the store at `path` is `duty`'s; the list gets what it returns."""
    found: list[Any] = []
    token = _HERE.set((pathlib.Path(os.path.abspath(path)), duty, found))
    try:
        with contextlib.suppress(Done):
            yield found
    finally:
        _HERE.reset(token)


def duty_at(path: pathlib.Path | None) -> Duty | None:
    """The duty that holds for a sweep into this store."""
    here = _HERE.get()
    if here is None or path is None or pathlib.Path(os.path.abspath(path)) != here[0]:
        return None
    return here[1]


def end_duty(found: Any) -> NoReturn:
    """Hand on what was done, and end the call that described the sweep."""
    here = _HERE.get()
    assert here is not None
    here[2].append(found)
    raise Done
