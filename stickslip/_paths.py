"""Checks of paths that a caller gives."""

import errno
import os
import pathlib
from typing import Any

from ._validation import refusal

DIRECTORY = "the path of a directory"
FILE = "the path of a file"


def the_directory(name: str, path: Any, allowed: str = DIRECTORY) -> pathlib.Path:
    """The path of a directory that is there or could be, `~` expanded.

    `TypeError` or `ValueError` naming the argument if it cannot be a directory.
    """
    if not isinstance(path, str | os.PathLike) or not isinstance(os.fspath(path), str):
        raise refusal(name, path, allowed, TypeError)
    text = os.fspath(path)
    if not text or "\0" in text:
        raise refusal(name, path, allowed)
    try:
        expanded = pathlib.Path(text).expanduser()
    except RuntimeError:
        whose = f"{allowed}; with '~', that of a user who has a home"
        raise refusal(name, text, whose) from None
    try:
        os.lstat(expanded)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            short = f"{allowed} whose names have at most 255 bytes"
            raise refusal(name, text, short) from None
    except ValueError as error:
        raise refusal(name, text, f"{allowed} ({error})") from None
    return expanded


def the_file(name: str, path: Any) -> pathlib.Path:
    """The path of a file that is there or could be, `~` expanded. Errors as of `the_directory`."""
    found = the_directory(name, path, FILE)
    if not found.name or found.is_dir():
        raise refusal(name, path, f"{FILE}, and not of a directory")
    return found
