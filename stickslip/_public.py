"""Names that the packages export, in one place: for the command line, the site and the tests."""

import ast
import importlib
import importlib.util
import inspect
import pathlib
import re
from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

# A full stop before a capital ends a sentence, but not that of "Eqs. (1)" or "e.g. a block".
_END = re.compile(r"(?<=\.)(?<!Eqs\.)(?<!Eq\.)(?<!e\.g\.) (?=[A-Z`$])")

PACKAGES = (
    "stickslip",
    "stickslip.friction",
    "stickslip.contact",
    "stickslip.mechanism",
    "stickslip.structure",
    "stickslip.control",
    "stickslip.systems",
    "stickslip.derived",
    "stickslip.sweep",
    "stickslip.analysis",
    "stickslip.continuation",
    "stickslip.basin",
    "stickslip.identification",
    "stickslip.estimation",
    "stickslip.plot",
    "stickslip.checks",
    "stickslip.fastmath",
    "stickslip.show",
    "corexy_jax",
    "corexy_jax.elastic",
)
# Of those that packages built on this one need, and no user: shown when they are asked for.
FOR_BUILDERS = ("stickslip.checks", "stickslip.fastmath", "stickslip.show")


class Public(NamedTuple):
    """A public name: where a user finds it, and the first sentence of what it says of itself."""

    package: str
    name: str
    thing: Any
    summary: str


def names_in(package: str) -> set[str]:
    """Names that the file of a package binds, read without importing it: more than the public ones."""
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        return set()
    tree = ast.parse(pathlib.Path(found.origin).read_text(encoding="utf-8"))
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom | ast.Import):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


def public_names(package: str) -> Iterator[Public]:
    """Public classes, functions and values of ours in `package`, in alphabetical order.

    A name that the root package exports too is listed there.
    """
    module = importlib.import_module(package)
    root = importlib.import_module(package.split(".")[0])
    for name in sorted(getattr(module, "__all__", None) or vars(module), key=str.lower):
        thing = getattr(module, name)
        if name.startswith("_") or name == "TYPE_CHECKING" or isinstance(thing, ModuleType):
            continue
        if module is not root and vars(root).get(name) is thing:
            continue
        where = getattr(thing, "__module__", None) or ""
        described = inspect.isclass(thing) or inspect.isroutine(thing)
        if described and where.split(".")[0] != package.split(".")[0]:
            continue
        summary = first_sentence(inspect.getdoc(thing)) if described else _of_value(thing)
        yield Public(package, name, thing, summary)


def first_sentence(text: str | None) -> str:
    """The first paragraph of a docstring up to its first full stop, on one line."""
    paragraph = " ".join((text or "").split("\n\n")[0].split())
    return _END.split(paragraph, maxsplit=1)[0].rstrip(",:")


def _of_value(thing: Any) -> str:
    if callable(thing):
        return first_sentence(inspect.getdoc(type(thing)))
    text = repr(thing).replace("\n", " ")
    return text if len(text) <= 60 else f"{text[:57]}..."
