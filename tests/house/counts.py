"""Counts of the house: `python -m tests.house.counts` prints them, `test_counts.py` holds them.

All are read from the syntax trees of the tracked files, so that they are exact and the same everywhere.
"""

import ast
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from tests.house._repository import ROOT, imported_modules, tracked_files

LAYERS = ("mechanism", "continuation", "hybrid", "identification", "sweep", "analysis")
# One word, and a participle. `_NOUNS` end like one and are none; public methods that return a changed
# copy of their object, or another constructor, are called by `_COPIES`.
_PARTICIPLE = re.compile(
    r"(?<![aeiou])[a-z]+(ed|wn|lt|ght|ung|ken|den|ven|sen)|known|moved|put|set|seen|met|cut|led"
)
_NOUNS = {
    "need",
    "feed",
    "seed",
    "speed",
    "adjoint",
    "event",
    "golden",
    "result",
    "weight",
    "height",
    "right",
}


# Names of numbers that stand for words: of modes and their bits, of a result, of forms of a file.
_CODES = {"(BACKWARD, REST, FORWARD, OPEN)", "BITS", "CANNOT_TELL", "FORMAT", "BEFORE_SHARDS"}
_COPIES = {"constructed", "delayed", "printed", "regularised", "scaled"}


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def trees(package: str) -> dict[Path, ast.Module]:
    """Syntax trees of the Python files of a package, by path."""
    files = [p for p in tracked_files() if p.suffix == ".py" and p.is_relative_to(ROOT / package)]
    return {path: _tree(path) for path in files}


def lines(package: str) -> int:
    """Lines of Python, docstrings and empty lines too."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in trees(package))


def _functions(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def participles(package: str) -> list[str]:
    """Functions whose name is one participle: it does not say of what."""
    return [
        f"{path.relative_to(ROOT)}:{function.lineno} {function.name}"
        for path, tree in trees(package).items()
        for function in _functions(tree)
        if (word := function.name.strip("_")) not in _NOUNS | _COPIES and _PARTICIPLE.fullmatch(word)
    ]


def _is_number(node: ast.AST) -> bool:
    """Whether an expression is made of numbers alone, one at least."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    parts = ast.UnaryOp, ast.BinOp, ast.operator, ast.unaryop, ast.Tuple, ast.expr_context
    names = [n for n in ast.walk(node) if not isinstance(n, (*parts, ast.Constant))]
    return not names and any(map(_is_number, ast.iter_child_nodes(node)))


def numbers(package: str) -> list[str]:
    """Numbers that decide, in a module or in a frozen dataclass of numbers, which is their home.

    Codes and coefficients of methods decide nothing, nor does how values look in texts (`_show.py`),
    what is set on an object of a library, and defaults of a class of which users make the objects.
    """
    found = []
    for path, tree in trees(package).items():
        if path.name in ("status.py", "_loop_state.py", "_dop853.py", "_fastmath.py", "_show.py"):
            continue
        named = path.stem.strip("_") == "accuracy"
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        ready = {ast.unparse(node.value) for node in tree.body if isinstance(node, ast.Assign)}
        homes = [c.body for c in classes if named or (f"{c.name}()" in ready and _is_home(c))]
        for node in [node for body in (tree.body, *homes) for node in body]:
            if isinstance(node, ast.Assign | ast.AnnAssign) and node.value and _is_number(node.value):
                target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
                name = ast.unparse(target)
                if "." not in name and name not in _CODES:
                    found.append(f"{path.relative_to(ROOT)}:{node.lineno} {name}")
    return found


def _is_home(node: ast.ClassDef) -> bool:
    """Whether a class holds nothing but numbers. Defaults of settings are those of arguments."""
    fields = [part for part in node.body if isinstance(part, ast.AnnAssign)]
    frozen = any("dataclass(frozen=True" in ast.unparse(d) for d in node.decorator_list)
    return frozen and all(part.value is not None and _is_number(part.value) for part in fields)


def interpreters(package: str) -> list[str]:
    """Functions that loop over the equations of a program traced by JAX."""
    return [
        f"{path.relative_to(ROOT)}:{function.lineno} {function.name}"
        for path, tree in trees(package).items()
        for function in _functions(tree)
        for node in ast.walk(function)
        if isinstance(node, ast.For | ast.comprehension) and ".eqns" in ast.unparse(node.iter)
    ]


def arguments(package: str) -> dict[str, int]:
    """How many arguments each public function and method has, the most first.

    Public is a name without an underscore that a user can import: the `__init__` of its package names
    it, or its page has no underscore. `**options` count as one. Constructors are counted apart, by
    `fields`: those of a machine are the parameters of a paper, each with a unit, and no object would
    group them that the paper does not have.
    """
    return _sizes(package, lambda path, name: _is_exported(path, name) and not name.startswith("_"))


def inner_arguments(package: str) -> dict[str, int]:
    """The same for functions that pages of one package share, which no user sees."""
    return _sizes(package, lambda path, name: not _is_exported(path, name) and name[0] != "_")


def fields(package: str) -> dict[str, int]:
    """How many arguments each constructor that is written out has, the most first."""
    return _sizes(package, lambda path, name: name == "__init__")


def _sizes(package: str, counts_in: Callable[[Path, str], bool]) -> dict[str, int]:
    found = {}
    for path, tree in trees(package).items():
        for node in tree.body:
            methods = (
                node.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_") else []
            )
            for function in [node, *methods]:
                if isinstance(function, ast.FunctionDef) and counts_in(path, function.name):
                    a = function.args
                    names = [x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.kwarg) if x]
                    own = [name for name in names if name not in ("self", "cls")]
                    where = f"{path.relative_to(ROOT)}:{function.lineno} {function.name}"
                    found[where] = len(own)
    return dict(sorted(found.items(), key=lambda item: -item[1]))


@cache
def _is_exported(path: Path, name: str) -> bool:
    """Whether a user can import a function of this name from this page, or a class that has it."""
    if not path.stem.startswith("_"):
        return True
    owners = {
        node.name
        for node in _tree(path).body
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
        and name in (node.name, *(getattr(inner, "name", "") for inner in node.body))
    }
    door = _tree(path.parent / "__init__.py")
    exported = {
        alias.name
        for node in ast.walk(door)
        if isinstance(node, ast.ImportFrom) and node.module == path.stem
        for alias in node.names
    }
    return not exported.isdisjoint(owners)


def import_graph(package: str) -> dict[str, set[str]]:
    """Which module of a package imports which other one of it, for types alone or late too."""
    graph: dict[str, set[str]] = {}
    for path in trees(package):
        own = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        text = path.read_text(encoding="utf-8")
        parent = own.rsplit(".", 1)[0]
        graph[own] = {
            name for _, name in imported_modules(text, parent) if name.startswith(f"{parent}.")
        }
    return {module: {name for name in used if name in graph} for module, used in graph.items()}


def circles(package: str) -> list[set[str]]:
    """Groups of modules that import each other, directly or through others."""
    graph = import_graph(package)

    def reached(module: str) -> set[str]:
        found: set[str] = set()
        ahead = list(graph[module])
        while ahead:
            if (name := ahead.pop()) not in found:
                found.add(name)
                ahead.extend(graph[name])
        return found

    beyond = {module: reached(module) for module in graph}
    groups = [{m for m in beyond[module] if module in beyond[m]} for module in graph]
    return [group for k, group in enumerate(groups) if group and group not in groups[:k]]


def main() -> None:
    """Print every count."""
    (most, many), (field, of_fields), (inner, of_inner) = (
        next(iter(found("stickslip").items())) for found in (arguments, fields, inner_arguments)
    )
    rows = {
        "lines of Python in stickslip": lines("stickslip"),
        **{f"  in stickslip/{name}": lines(f"stickslip/{name}") for name in LAYERS},
        "lines of Python in tests": lines("tests"),
        "numbers at module level in stickslip": len(numbers("stickslip")),
        "interpreters of jaxprs": len(set(interpreters("stickslip"))),
        "functions named by a participle": len(participles("stickslip")),
        "most arguments of a public function": f"{many} ({most})",
        "public functions of more than 9": sum(n > 9 for n in arguments("stickslip").values()),
        "most arguments of a constructor": f"{of_fields} ({field})",
        "most arguments of an inner function": f"{of_inner} ({inner})",
        **{f"circles in stickslip/{name}": len(circles(f"stickslip/{name}")) for name in LAYERS},
    }
    for name, value in rows.items():
        print(f"{name:<45}{value}")


if __name__ == "__main__":
    main()
