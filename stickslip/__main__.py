"""Command line: `python -m stickslip` lists the names, `NAME` shows one, `--find WORD` looks one up."""

import argparse
import importlib
import shutil
import sys
import textwrap

from ._descriptions import docstring_of, methods_of, signature_of
from ._glossary import terms_with, without_links
from ._public import FOR_BUILDERS, PACKAGES, Public, first_sentence, public, public_names
from ._sources import file_of
from ._version import __version__

# First words of commands about the store of a sweep.
SWEEPS = ("status", "verify")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    given = sys.argv[1:] if arguments is None else arguments
    if given[:1] == ["view"]:
        _import_whole()
        from .view.command import main as view

        return view(given[1:])
    if given[:1] and given[0] in SWEEPS:
        _import_whole()
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
    if options.name is not None:
        pages = _pages(options.name)
        if pages:
            print("\n\n".join(pages))
            return 0
    found = _names()
    if options.name is None:
        print(_listing([entry for entry in found if entry.package not in FOR_BUILDERS]))
        print(f"\nFor packages that are built on these: {', '.join(FOR_BUILDERS)}")
        return 0
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
    names = [e for e in _names() if all(w in f"{e.name} {e.summary}".lower() for w in words)]
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
    return [p for p in PACKAGES if file_of(p) is not None]


def _names() -> list[Public]:
    return [entry for package in _installed_packages() for entry in public_names(package)]


def _pages(name: str) -> list[str]:
    """Pages of what is called so: names, or a package, or methods."""
    names, packages, methods = [], [], []
    for package in _installed_packages():
        short = package.removeprefix("stickslip.")
        if name in (package, short):
            packages.append(_listing(list(public_names(package))))
        for prefix in {"", f"{package}.", f"{short}."}:
            owner, *rest = name.removeprefix(prefix).split(".")
            entry = public(package, owner) if name.startswith(prefix) and len(rest) < 2 else None
            if entry is None:
                continue
            if rest:
                methods += _method_page(entry, *rest)
            else:
                names.append(_page(entry))
    return names or packages or methods


def _page(entry: Public) -> str:
    """Signature and docstring, as `help` has them; of a class the names of its methods too."""
    whole = f"{entry.package}.{entry.name}"
    if not (entry.is_class or entry.is_function):
        _import_whole()
        return f"{whole}\n\n{getattr(importlib.import_module(entry.package), entry.name)!r}"
    text = f"{whole}{signature_of(entry.source)}\n\n{docstring_of(entry.source)}"
    rows = [
        (name if method.is_property else f"{name}()", first_sentence(method.docstring))
        for name, method in methods_of(entry.source).items()
    ]
    return "\n".join([text, "", "Methods and properties:", *_rows(rows)]) if rows else text


def _method_page(entry: Public, name: str) -> list[str]:
    """The page of a method that is asked for as `Class.method`."""
    method = methods_of(entry.source).get(name)
    if method is None:
        return []
    call = "" if method.is_property else signature_of(method.source)
    return [f"{entry.package}.{entry.name}.{name}{call}\n\n{method.docstring}"]


def _listing(entries: list[Public]) -> str:
    lines, package = [], None
    rows = _rows([(f"{e.name}()" if e.is_function else e.name, e.summary) for e in entries])
    for entry, row in zip(entries, rows, strict=True):
        if entry.package != package:
            lines += [""] * (package is not None) + [entry.package]
            package = entry.package
        lines.append(row)
    return "\n".join(lines)


def _rows(rows: list[tuple[str, str]]) -> list[str]:
    """Names in a column, each with a sentence that is cut where the line ends."""
    # A line of the list is cut, not wrapped: one look finds the name.
    width = max(60, shutil.get_terminal_size((104, 24)).columns)
    column = max(len(name) for name, _ in rows) + 2
    lines = (f"  {name:<{column}}{text}" for name, text in rows)
    return [line if len(line) <= width else f"{line[: width - 3]}..." for line in lines]


def _import_whole() -> None:
    """Import all of the package. Where Python has found it for this command it is hardly begun."""
    package = importlib.import_module("stickslip")
    if not hasattr(package, "simulate"):
        importlib.reload(package)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BrokenPipeError:  # the reader, as `head`, has seen enough
        sys.stderr.close()
