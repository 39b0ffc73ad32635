"""Command line: `python -m stickslip` lists the names, `NAME` shows one, `--find WORD` looks one up."""

import argparse
import importlib.util
import inspect
import shutil
import sys
import textwrap
from typing import Any

from ._glossary import terms_with, without_links
from ._public import FOR_BUILDERS, PACKAGES, Public, first_sentence, names_in, public_names
from ._version import __version__

# First words of commands about the store of a sweep.
SWEEPS = ("status", "verify")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    given = sys.argv[1:] if arguments is None else arguments
    if given[:1] == ["view"]:
        # Only now: it reads files, for which much is imported.
        from .view.command import main as view

        return view(given[1:])
    if given[:1] and given[0] in SWEEPS:
        from .sweep.command import main as sweeps

        return sweeps(given)
    parser = argparse.ArgumentParser(
        prog="python -m stickslip",
        description="List the public names of stickslip and corexy_jax, or show one of them.",
        epilog="`view STORE_OR_FILE` shows a diagram; `status` and `verify` are for "
        "stores of sweeps; each with --help says how.",
    )
    what = "a public name, as `simulate`, `friction.Stribeck` or `Problem.fit`, or a package"
    parser.add_argument("name", nargs="?", help=what)
    parser.add_argument(
        "--find",
        metavar="WORD",
        help="a word of the field, such as `damper` or `limit cycle`: where it is",
    )
    parser.add_argument("--version", action="version", version=f"stickslip {__version__}")
    options = parser.parse_args(given)
    if options.find is not None:
        return _find(options.find)
    packages = _installed_packages()
    if options.name is not None:
        # To import them all takes two seconds; their files tell in which of them a name can be.
        words = set(options.name.split("."))
        packages = [p for p in packages if words & {p.split(".")[-1], *names_in(p)}] or packages
    found = [entry for package in packages for entry in public_names(package)]
    if options.name is None:
        print(_listing([entry for entry in found if entry.package not in FOR_BUILDERS]))
        print(f"\nFor packages that are built on these: {', '.join(FOR_BUILDERS)}")
        return 0
    chosen = [entry for entry in found if options.name in _spellings(entry)]
    if chosen:
        print("\n\n".join(_page(entry) for entry in chosen))
        return 0
    inside = [entry for entry in found if _is_package(options.name, entry.package)]
    if inside:
        print(_listing(inside))
        return 0
    methods = [page for entry in found for page in _method_pages(entry, options.name)]
    if methods:
        print("\n\n".join(methods))
        return 0
    found = [entry for package in _installed_packages() for entry in public_names(package)]
    word = options.name.split(".")[-1].lower()
    near = sorted({f"{e.package}.{e.name}" for e in found if word in e.name.lower()})
    hint = f" Names like it: {', '.join(near[:8])}." if near else ""
    print(f"name = {options.name!r}: it must be a public name or a package.{hint}", file=sys.stderr)
    return 2


def _find(text: str) -> int:
    """Print the entries of the glossary, then the public names, that have every word of `text`."""
    if not text.strip():
        print(f"--find {text!r}: it must be a word of the field.", file=sys.stderr)
        return 2
    terms = terms_with(text)
    words = text.lower().split()
    entries = [e for package in _installed_packages() for e in public_names(package)]
    names = [e for e in entries if all(w in f"{e.name} {e.summary}".lower() for w in words)]
    blocks = [_entry(term.words, term.meaning, without_links(term.here)) for term in terms]
    if names:
        blocks.append("\n".join(_rows([(f"{e.package}.{e.name}", e.summary) for e in names])))
    if not blocks:
        other = "one of them alone" if len(words) > 1 else "its beginning, or another word for it"
        print(f"--find {text!r}: no such word here. Try {other}.", file=sys.stderr)
        return 2
    print("\n\n".join(blocks))
    return 0


def _entry(words: str, *texts: str) -> str:
    lines = [textwrap.fill(text, 100, initial_indent="  ", subsequent_indent="  ") for text in texts]
    return "\n".join([words, *lines])


def _installed_packages() -> list[str]:
    """The packages that are there; `corexy_jax` may be left out of an installation."""
    return [p for p in PACKAGES if importlib.util.find_spec(p.split(".")[0]) is not None]


def _spellings(entry: Public) -> tuple[str, ...]:
    short = f"{entry.package}.{entry.name}".removeprefix("stickslip.")
    return entry.name, short, f"{entry.package}.{entry.name}"


def _is_package(name: str, package: str) -> bool:
    return name in (package, package.removeprefix("stickslip."))


def _listing(entries: list[Public]) -> str:
    lines, package = [], None
    rows = _rows([(_with_brackets(e.name, e.thing), e.summary) for e in entries])
    for entry, row in zip(entries, rows, strict=True):
        if entry.package != package:
            lines += [""] * (package is not None) + [entry.package]
            package = entry.package
        lines.append(row)
    return "\n".join(lines)


def _page(entry: Public) -> str:
    """Signature and docstring, as `help` has them; of a class the names of its methods too."""
    what = inspect.getdoc(entry.thing) if callable(entry.thing) else repr(entry.thing)
    text = f"{entry.package}.{entry.name}{_signature(entry.thing)}\n\n{what}"
    methods = _methods(entry.thing)
    if not methods:
        return text
    rows = [(_with_brackets(name, m), first_sentence(inspect.getdoc(m))) for name, m in methods.items()]
    return "\n".join([text, "", "Methods and properties:", *_rows(rows)])


def _with_brackets(name: str, thing: Any) -> str:
    """The name, with brackets if it is that of a function or a method."""
    return f"{name}()" if callable(thing) and not inspect.isclass(thing) else name


def _rows(rows: list[tuple[str, str]]) -> list[str]:
    """Names in a column, each with a sentence that is cut where the line ends."""
    # A line of the list is cut, not wrapped: one look finds the name.
    width = max(60, shutil.get_terminal_size((104, 24)).columns)
    column = max(len(name) for name, _ in rows) + 2
    lines = (f"  {name:<{column}}{text}" for name, text in rows)
    return [line if len(line) <= width else f"{line[: width - 3]}..." for line in lines]


def _signature(thing: Any) -> str:
    try:
        found = inspect.signature(thing).parameters.values()
        # Types are long; what is allowed stands below.
        return str(inspect.Signature([p.replace(annotation=p.empty) for p in found]))
    except (TypeError, ValueError):
        return ""


def _methods(thing: Any) -> dict[str, Any]:
    """Public methods and properties of a class with a docstring of their own or a base's of ours."""
    if not inspect.isclass(thing):
        return {}
    found = {}
    for base in reversed(thing.__mro__):
        if base.__module__.split(".")[0] not in {p.split(".")[0] for p in PACKAGES}:
            continue
        for name in vars(base):
            value = getattr(thing, name, None)
            shown = callable(value) or isinstance(value, property)
            if not name.startswith("_") and shown and inspect.getdoc(value):
                found[name] = value
    return found


def _method_pages(entry: Public, name: str) -> list[str]:
    """The page of a method that is asked for as `Class.method`."""
    whole, _, method = name.rpartition(".")
    found = _methods(entry.thing).get(method) if whole in _spellings(entry) else None
    if found is None:
        return []
    head = f"{entry.package}.{entry.name}.{method}{_signature(found)}"
    return [f"{head}\n\n{inspect.getdoc(found)}"]


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BrokenPipeError:  # the reader, as `head`, has seen enough
        sys.stderr.close()
