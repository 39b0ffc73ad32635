"""What our packages define, read from their files: to import them all takes three seconds."""

import ast
import functools
import importlib.util
import pathlib
from collections.abc import Iterator
from typing import NamedTuple

ROOTS = ("stickslip", "corexy_jax")

Definition = ast.FunctionDef | ast.ClassDef | ast.Assign | ast.AnnAssign
_Import = ast.ImportFrom | ast.Import


class Source(NamedTuple):
    """The statement that defines a name, and the module in whose file it stands."""

    module: str
    statement: Definition

    @property
    def docstring(self) -> str:
        own = self.statement
        if not isinstance(own, ast.FunctionDef | ast.ClassDef):
            return ""
        return ast.get_docstring(own) or ""

    @property
    def body(self) -> list[ast.stmt]:
        """Statements in a class."""
        return list(_flat(self.statement.body)) if isinstance(self.statement, ast.ClassDef) else []

    @property
    def bases(self) -> list[str]:
        """Names of the classes from which a class inherits, as its file calls them."""
        bases = self.statement.bases if isinstance(self.statement, ast.ClassDef) else []
        return [ast.unparse(b.value if isinstance(b, ast.Subscript) else b) for b in bases]


@functools.cache
def file_of(module: str) -> pathlib.Path | None:
    """The file of a module of ours; None of any other, or if it is not installed."""
    root, *rest = module.split(".")
    spec = importlib.util.find_spec(root) if root in ROOTS else None
    if spec is None or spec.origin is None:
        return None
    folder = pathlib.Path(spec.origin).parent.joinpath(*rest)
    places = folder.with_suffix(".py"), folder / "__init__.py"
    return next((path for path in places if path.is_file()), None)


def docstring_of_module(module: str) -> str:
    return ast.get_docstring(_tree(module)) or ""


def bound_names(module: str) -> list[str]:
    """Names that the file of a module binds, in their order: more than the public ones."""
    return [name for statement in _statements(module) for name in _names(statement)]


def definition(module: str, name: str) -> Source | None:
    """Where what a module calls by a name is defined; None of a module, or if it is not ours."""
    # The last one counts, which is also the one that is not for type checkers.
    found = (one for one in reversed(_statements(module)) if name in _names(one))
    statement = next(found, None)
    if isinstance(statement, ast.ImportFrom):
        names = {alias.asname or alias.name: alias.name for alias in statement.names}
        there = _imported_module(module, statement)
        # What a package imports from itself is a module in it.
        return None if there == module else definition(there, names[name])
    return Source(module, statement) if isinstance(statement, Definition) else None


def value_of(statement: ast.Assign | ast.AnnAssign, name: str) -> ast.expr | None:
    """The expression to which a name is set; of several names in one line its own."""
    value = statement.value
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return value.elts[_names(statement).index(name)]
    return value


@functools.cache
def ancestry(source: Source) -> list[Source]:
    """A class and those of ours that it inherits from, in the order in which Python asks them."""
    above = [definition(source.module, name) for name in source.bases]
    bases = [base for base in above if base is not None and isinstance(base.statement, ast.ClassDef)]
    lines = [*(ancestry(base) for base in bases), bases]
    found = [source]
    while any(lines):
        # The first that is not behind another one in any line: the order C3.
        heads = (line[0] for line in lines if line)
        found.append(next(one for one in heads if not any(one in line[1:] for line in lines)))
        lines = [[one for one in line if one != found[-1]] for line in lines]
    return found


@functools.cache
def _tree(module: str) -> ast.Module:
    path = file_of(module)
    return ast.parse("" if path is None else path.read_text(encoding="utf-8"))


@functools.cache
def _statements(module: str) -> tuple[Definition | _Import, ...]:
    """Statements of a file that bind a name."""
    return tuple(one for one in _flat(_tree(module).body) if isinstance(one, Definition | _Import))


def _flat(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements, in place of an `if` those of both its halves."""
    for statement in body:
        if isinstance(statement, ast.If):
            yield from _flat(statement.body + statement.orelse)
        else:
            yield statement


def _names(statement: Definition | _Import) -> list[str]:
    if isinstance(statement, ast.ImportFrom | ast.Import):
        return [alias.asname or alias.name for alias in statement.names]
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return [statement.name]
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    nodes = (node for target in targets for node in ast.walk(target) if isinstance(node, ast.Name))
    return [node.id for node in nodes if isinstance(node.ctx, ast.Store)]


def _imported_module(module: str, statement: ast.ImportFrom) -> str:
    """The module that is imported from; full stops lead up from the package of this one."""
    path = file_of(module)
    inside = path is not None and path.name == "__init__.py"
    parts = module.split(".") if inside else module.split(".")[:-1]
    above = parts[: len(parts) - statement.level + 1] if statement.level else []
    return ".".join([*above, *([statement.module] if statement.module else [])])
