"""Command line: `python -m stickslip` lists what there is, `NAME` shows one; more are commands."""

import argparse
import importlib.util
import inspect
import shutil
import sys

from ._public import PACKAGES, Public, public_names
from ._version import __version__

# What begins a command about the store of a sweep.
SWEEPS = ("plan", "work", "status", "verify")
# A line of the list is cut, not wrapped: one look finds the name.
NARROWEST = 60


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    given = sys.argv[1:] if arguments is None else arguments
    if given[:1] == ["view"]:
        # Only now: it reads files, for which much is imported.
        from .view._command import main as view

        return view(given[1:])
    if given[:1] and given[0] in SWEEPS:
        from .sweep._command import main as sweeps

        return sweeps(given)
    parser = argparse.ArgumentParser(
        prog="python -m stickslip",
        description="List the public names of stickslip and corexy_jax, or show one of them.",
        epilog="`view STORE_OR_FILE` shows a diagram; `plan`, `work`, `status` and `verify` are for "
        "stores of sweeps; each with --help says how.",
    )
    parser.add_argument(
        "name", nargs="?", help="a public name, as `simulate` or `friction.Stribeck`, or a package"
    )
    parser.add_argument("--version", action="version", version=f"stickslip {__version__}")
    options = parser.parse_args(given)
    found = [entry for package in _installed() for entry in public_names(package)]
    if options.name is None:
        print(_listing(found))
        return 0
    chosen = [entry for entry in found if options.name in _spellings(entry)]
    if chosen:
        print("\n\n".join(_page(entry) for entry in chosen))
        return 0
    inside = [entry for entry in found if _is_package(options.name, entry.package)]
    if inside:
        print(_listing(inside))
        return 0
    word = options.name.split(".")[-1].lower()
    near = sorted({f"{e.package}.{e.name}" for e in found if word in e.name.lower()})
    hint = f" Names like it: {', '.join(near[:8])}." if near else ""
    print(f"name = {options.name!r}: it must be a public name or a package.{hint}", file=sys.stderr)
    return 2


def _installed() -> list[str]:
    """The packages that are there; `corexy_jax` may be left out of an installation."""
    return [p for p in PACKAGES if importlib.util.find_spec(p.split(".")[0]) is not None]


def _spellings(entry: Public) -> tuple[str, ...]:
    short = f"{entry.package}.{entry.name}".removeprefix("stickslip.")
    return entry.name, short, f"{entry.package}.{entry.name}"


def _is_package(name: str, package: str) -> bool:
    return name in (package, package.removeprefix("stickslip."))


def _listing(entries: list[Public]) -> str:
    width = max(NARROWEST, shutil.get_terminal_size((104, 24)).columns)
    column = max(len(entry.name) for entry in entries) + 2
    lines, package = [], None
    for entry in entries:
        if entry.package != package:
            lines += [""] * (package is not None) + [entry.package]
            package = entry.package
        text = f"  {entry.name:<{column}}{entry.summary}"
        lines.append(text if len(text) <= width else f"{text[: width - 3]}...")
    return "\n".join(lines)


def _page(entry: Public) -> str:
    """Signature and docstring, as `help` has them, without its methods."""
    try:
        found = inspect.signature(entry.thing).parameters.values()
        # Types are long; what is allowed stands below.
        signature = str(inspect.Signature([p.replace(annotation=p.empty) for p in found]))
    except (TypeError, ValueError):
        signature = ""
    what = inspect.getdoc(entry.thing) if callable(entry.thing) else repr(entry.thing)
    return f"{entry.package}.{entry.name}{signature}\n\n{what}"


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BrokenPipeError:  # the reader, as `head`, has seen enough
        sys.stderr.close()
