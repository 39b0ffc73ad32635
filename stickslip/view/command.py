"""`python -m stickslip view`."""

import argparse
import importlib.util
import pathlib
import sys
from typing import Any

import xarray as xr

from .._paths import the_directory
from .._validation import check_count, refusal
from ..sweep import open_dataset
from ._diagram import Diagram
from ._map import Map, has_map
from ._module import import_functions

ALLOWED = "a netCDF file or the store of a sweep"
ABSENT = "The viewer draws with bokeh, which is not installed: pip install 'bokeh>=3.7'"


def main(arguments: list[str]) -> int:
    """Run the command; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m stickslip view",
        description="Show an orbit diagram, or a map of basins in the browser; a click shows a motion.",
        epilog="The page is on this machine only. With --html it is a file of its own, under 5 MB.",
    )
    parser.add_argument("path", metavar="STORE_OR_FILE", help="a netCDF file, or a sweep's store")
    parser.add_argument("--x", metavar="NAME", help="the parameter drawn across (default: the longest)")
    parser.add_argument(
        "--observable",
        metavar="NAME",
        help="the observable drawn over it, or the code of a map (default: the first)",
    )
    parser.add_argument(
        "--with", dest="module", metavar="MODULE",
        help="a module of yours: orbit(**point) is asked at a click, diagram(**ranges) for a region",
    )  # fmt: skip
    parser.add_argument("--html", metavar="FILE", help="write the page to this file; no server")
    parser.add_argument(
        "--port", type=int, default=0, metavar="N", help="of the server (default: any that is free)"
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    options = parser.parse_args(arguments)
    if importlib.util.find_spec("bokeh") is None:
        print(ABSENT, file=sys.stderr)
        return 2
    try:
        check_count("port", options.port, 0, 65535)
        target = None if options.html is None else _target(options.html)
        shown = _content(options)
        module = options.module
        functions = None if module is None else import_functions(module, shown.parameters)
    except (ValueError, TypeError) as error:
        print(error, file=sys.stderr)
        return 2
    if target is not None and isinstance(shown, Diagram):
        from ._file import write_file

        try:
            size = write_file(shown, functions, target)
        except ValueError as error:
            print(error, file=sys.stderr)
            return 2
        print(f"{target}: {size / 1e6:.2f} MB")
        return 0
    from ._live import Live
    from ._map_page import MapPage
    from ._server import serve

    def page(document: Any) -> Live | MapPage:
        return (
            MapPage(shown, functions, document)
            if isinstance(shown, Map)
            else Live(shown, functions, document)
        )

    try:
        serve(shown.title, page, port=options.port, browser=not options.no_browser)
    except OSError as error:
        print(f"port = {options.port}: it must be one that is free ({error}).", file=sys.stderr)
        return 2
    return 0


def _content(options: argparse.Namespace) -> Diagram | Map:
    """The content of the file."""
    dataset = open_stored(options.path)
    if has_map(dataset) and options.x is None:
        if options.html is not None:
            raise refusal("html", options.html, "absent for a map, which needs the server")
        return Map(dataset, options.path, options.observable)
    return Diagram(dataset, options.path, x=options.x, observable=options.observable)


def _target(text: str) -> pathlib.Path:
    path = pathlib.Path(text).expanduser()
    if path.suffix.lower() not in (".html", ".htm"):
        raise refusal("html", text, "the path of a file whose name ends in .html")
    if path.is_dir() or not path.parent.is_dir():
        raise refusal("html", text, "the path of a file in a directory that is there")
    return path


def open_stored(path: str) -> xr.Dataset:
    """The dataset stored at `path`. Errors: `ValueError` naming the path."""
    place: pathlib.Path = the_directory("path", path, f"the path of {ALLOWED}")
    if place.is_dir():
        return open_dataset(place)
    if not place.is_file():
        raise refusal("path", path, f"{ALLOWED} that is there")
    try:
        # Times are numbers like any other.
        return xr.open_dataset(place, decode_times=False)
    except Exception as error:  # whatever the readers meet in files of another kind
        text = " ".join(str(error).split())[:80]
        raise refusal(
            "path", path, ALLOWED, but=f"unreadable ({type(error).__name__}: {text})"
        ) from error
