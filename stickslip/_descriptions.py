"""Docstrings, signatures and methods of what our packages define, read from the sources."""

import ast
from typing import Any, NamedTuple

from ._sources import Source, ancestry, definition, value_of

# The last is that of `stickslip.mechanism`, for what a subclass may say in its own way.
_PROPERTIES = {"property", "cached_property", "overridable"}
# Ends of the names of bases that are not ours and have an `__init__`: exceptions, enumerations.
_FOREIGN = ("Error", "Exception", "Enumeration", "RESULTS")
_NO_FIELDS = {"ClassVar", "AbstractVar", "AbstractClassVar"}


class Method(NamedTuple):
    """A public method or property of a class, with its own docstring or the one that it inherits."""

    source: Source
    docstring: str

    @property
    def is_property(self) -> bool:
        return bool(_PROPERTIES & _decorators(self.source))


def docstring_of(source: Source) -> str:
    """Docstring of a function or a class, which may inherit it; empty of a value."""
    own = source.statement
    lineage = ancestry(source) if isinstance(own, ast.ClassDef) else [source]
    return next(filter(None, (one.docstring for one in lineage)), "")


def methods_of(source: Source) -> dict[str, Method]:
    """Public methods and properties with a docstring of a class, those of its bases first."""
    found: dict[str, Method] = {}
    # The nearest definition is the last that comes.
    for one in reversed(ancestry(source)):
        for statement in one.body:
            name, value = _set_by(statement)
            if isinstance(statement, ast.FunctionDef) and not statement.name.startswith("_"):
                before = found.get(statement.name)
                doc = ast.get_docstring(statement) or (before.docstring if before else None)
                if doc is not None:
                    found[statement.name] = Method(Source(one.module, statement), doc)
            elif value is not None:
                found.pop(name, None)
    return found


def signature_of(source: Source, *, bound: bool = False) -> str:
    """Arguments and defaults without the types, which are long: what is allowed stands in docstrings.

    Of a class those of its `__init__`, or else its fields, as dataclasses, modules of Equinox and named
    tuples have them. `bound`: of a method as it is called, without its object.
    """
    own = source.statement
    if isinstance(own, ast.FunctionDef):
        first = "classmethod" in _decorators(source)
        first |= bound and "staticmethod" not in _decorators(source)
        return _arguments(own.args, source.module, first)
    lineage = ancestry(source)
    for one in lineage:
        for statement in one.body:
            if isinstance(statement, ast.FunctionDef) and statement.name == "__init__":
                return _arguments(statement.args, one.module, 1)
    bases = [base for one in lineage for base in one.bases]
    if any(base.endswith(_FOREIGN) for base in bases):
        return ""
    if not bases and not any("dataclass" in _decorators(one) for one in lineage):
        return "()"
    return _fields(lineage)


def _arguments(given: ast.arguments, module: str, first: int) -> str:
    """Arguments from a first one on, with brackets."""

    def name(one: ast.arg | None) -> Any:
        return one and ast.arg(one.arg)

    def names(those: list[ast.arg]) -> list[Any]:
        return [name(one) for one in those]

    def defaults(those: list[Any]) -> list[Any]:
        return [_default(one, module) for one in those]

    only, places = given.posonlyargs, given.args
    bare = ast.arguments(
        names(only[first:]), names(places[0 if only else first :]),
        name(given.vararg), names(given.kwonlyargs), defaults(given.kw_defaults),
        name(given.kwarg), defaults(given.defaults),
    )  # fmt: skip
    return f"({ast.unparse(bare)})"


def _fields(lineage: list[Source]) -> str:
    """Those of the bases come first, and keep their places where they are declared again."""
    places: dict[str, Any] = {}
    keywords: dict[str, Any] = {}
    for one in reversed(lineage):
        kind = places
        for statement in one.body:
            if not isinstance(statement, ast.AnnAssign) or not isinstance(statement.target, ast.Name):
                continue
            annotation = ast.unparse(statement.annotation).split("[")[0].split(".")[-1]
            name, value = statement.target.id, statement.value
            options = _options(value)
            if annotation == "KW_ONLY":
                kind = keywords
            elif "init" in options and ast.unparse(options["init"]) == "False":
                kind.pop(name, None)
            elif annotation not in _NO_FIELDS:
                kind[name] = _default(options.get("default"), one.module)
    defaults = [value for value in places.values() if value is not None]
    bare = ast.arguments(
        [], [ast.arg(name) for name in places], None,
        [ast.arg(name) for name in keywords], list(keywords.values()), None, defaults,
    )  # fmt: skip
    return f"({ast.unparse(bare)})"


def _options(value: ast.expr | None) -> dict[str | None, ast.expr]:
    """Options of a field: those of a call of `field`, or the default alone."""
    if not (isinstance(value, ast.Call) and ast.unparse(value.func).split(".")[-1] == "field"):
        return {} if value is None else {"default": value}
    options = {keyword.arg: keyword.value for keyword in value.keywords}
    factory = options.get("default_factory")
    if factory is not None:
        made = factory.body if isinstance(factory, ast.Lambda) else ast.Call(factory, [], [])
        options["default"] = made
    return options


def _default(value: ast.expr | None, module: str) -> ast.expr | None:
    """A default as it is written; of a constant of ours what it is set to."""
    source = definition(module, value.id) if isinstance(value, ast.Name) else None
    if isinstance(value, ast.Name) and source is not None and isinstance(source.statement, ast.Assign):
        return value_of(source.statement, value.id)
    return value


def _set_by(statement: ast.stmt) -> tuple[str, ast.expr | None]:
    """Name and value of what the body of a class sets."""
    if isinstance(statement, ast.Assign):
        return ast.unparse(statement.targets[0]), statement.value
    if isinstance(statement, ast.AnnAssign):
        return ast.unparse(statement.target), statement.value
    return "", None


def _decorators(source: Source) -> set[str]:
    own = source.statement
    assert isinstance(own, ast.FunctionDef | ast.ClassDef)
    # Without their arguments and the modules in which they are.
    return {ast.unparse(one).split("(")[0].split(".")[-1] for one in own.decorator_list}
