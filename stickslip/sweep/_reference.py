"""Functions by reference: module and name, found again by another process, with parameters in JSON."""

import importlib
import json
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any

from .._validation import refusal

_TOP = "a function at the top level of a module that other processes can import"
_DO = "write it into a module as `def sweep(store, **parameters): return run_sweep(..., store=store)`"


def reference_to(function: Callable[..., Any], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Module, name and parameters; `ValueError` for a function that no other process would find."""
    module = getattr(function, "__module__", None)
    name = getattr(function, "__qualname__", None)
    if not isinstance(module, str) or not isinstance(name, str):
        raise refusal("function", function, f"{_TOP}, not an object that is called; {_DO}")
    where = f"{module}:{name}"
    if "<lambda>" in name:
        raise refusal("function", where, f"{_TOP}, not a lambda; {_DO}")
    if "<locals>" in name:
        raise refusal("function", where, f"{_TOP}, not one that a function defines; {_DO}")
    if module == "__main__":
        raise refusal("function", where, f"{_TOP}, not of the script that is run; {_DO}")
    if _found(where) is not function:
        raise refusal("function", where, f"{_TOP}, but what is found there is something else; {_DO}")
    return {"function": where, "parameters": _plain(parameters)}


def function_of(reference: Any, argument: str = "function") -> Callable[..., Any]:
    """The function of a reference; `ValueError` if there is none."""
    here = os.getcwd()
    if here not in sys.path:  # as `python -m` does
        sys.path.insert(0, here)
    module, _, name = str(reference).partition(":")
    if not module or not all(part.isidentifier() for part in (*module.split("."), *name.split("."))):
        raise refusal(argument, reference, "a module and a function in it, as study:sweep")
    try:
        found = _found(f"{module}:{name}")
    except Exception as error:  # whatever a module of the user does when it is imported
        text = " ".join(str(error).split())[:200]
        but = f"not found ({type(error).__name__}: {text})"
        allowed = "a module and a function in it, as study:sweep, that can be imported here"
        raise refusal(argument, reference, allowed, but=but) from error
    if not callable(found):
        raise refusal(argument, reference, "a module and a function in it, as study:sweep")
    return found


def _found(where: str) -> Any:
    module, _, name = where.partition(":")
    found: Any = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return found


def _plain(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters, if JSON says all of them."""
    for key, value in parameters.items():
        try:
            same = json.loads(json.dumps(value, allow_nan=False)) == value
        except (TypeError, ValueError, RecursionError):
            same = False
        if not same:
            allowed = "a number, a text, True, False, None, or lists and mappings from texts of them"
            raise refusal(f"parameters[{key!r}]", value, allowed, TypeError)
    return dict(parameters)
