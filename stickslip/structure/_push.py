"""A system under one force more: what sliders need of the system that they act on."""

import functools
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import jax

System = TypeVar("System")


def under_push(system: System, push: Callable) -> System:
    """`system` with `push(t, q, v, args)` added to its `forces`, and in all else as it is."""
    made = object.__new__(_with_push(type(system)))
    for name, value in {**vars(system), "push_of_sliders": push}.items():
        object.__setattr__(made, name, value)
    return made


@functools.lru_cache(maxsize=256)
def _with_push(kind: Any) -> type:
    def forces(self, t, q, v, args):
        given = kind.forces(self, t, q, v, args)
        return _sum(given, self.push_of_sliders(t, q, v, args), v)

    # Its code is that of the class: edits of that are noticed.
    body = {"forces": forces, "__annotations__": {"push_of_sliders": Any}, "push_of_sliders": None}
    return type(kind)(kind.__name__, (kind,), {**body, "__module__": kind.__module__})


def _sum(given: Any, push: Any, v: Any) -> Any:
    """Forces in one of the forms that a system may return them in, and a push in the form of `v`."""
    if isinstance(push, jax.Array):
        return given + push
    if isinstance(given, Mapping):
        return {**given, **{name: given.get(name, 0.0) + p for name, p in push._asdict().items()}}
    row = list(given) if isinstance(given, tuple | list) or getattr(given, "ndim", 0) else [given]
    return [f + p for f, p in zip(row, push, strict=True)] if len(row) == len(push) else given
