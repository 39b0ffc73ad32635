"""Names that the packages export, in one place: for the command line, the site and the tests."""

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

from ._descriptions import docstring_of
from ._sources import Source, bound_names, definition, value_of

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
    source: Source
    summary: str

    @property
    def is_class(self) -> bool:
        return isinstance(self.source.statement, ast.ClassDef)

    @property
    def is_function(self) -> bool:
        return isinstance(self.source.statement, ast.FunctionDef)


def public(package: str, name: str) -> Public | None:
    """A public class, function or value of ours in `package`.

    A name that the root package exports too is not one: it is listed there.
    """
    root = package.split(".")[0]
    source = None if name.startswith("_") else definition(package, name)
    if source is None or source.module.split(".")[0] != root:
        return None
    if package != root and definition(root, name) == source:
        return None
    statement = source.statement
    if not isinstance(statement, ast.Assign | ast.AnnAssign):
        return Public(package, name, source, first_sentence(docstring_of(source)))
    value = value_of(statement, name)
    text = "" if value is None else ast.unparse(value)
    return Public(package, name, source, text if len(text) <= 60 else f"{text[:57]}...")


def public_names(package: str) -> Iterator[Public]:
    """All of them, in alphabetical order."""
    for name in sorted(set(bound_names(package)), key=str.lower):
        entry = public(package, name)
        if entry is not None:
            yield entry


def first_sentence(text: str | None) -> str:
    """The first paragraph of a docstring up to its first full stop, on one line."""
    paragraph = " ".join((text or "").split("\n\n")[0].split())
    return _END.split(paragraph, maxsplit=1)[0].rstrip(",:")
