"""Files that are written whole or not at all, and read with nothing taken for granted."""

import contextlib
import hashlib
import json
import os
import pathlib
from typing import Any


def write_whole(path: pathlib.Path, content: str | bytes, mark: str = "") -> None:
    """All of `content` at `path`, or what was there before; also after a power cut.

    A symbolic link at `path` is replaced, and what it leads to left alone. Where several processes may
    write the same file, each has a `mark` of its own, so that none renames what another has half
    written.
    """
    data = content.encode() if isinstance(content, str) else content
    temporary = half_written(path, mark)
    temporary.unlink(missing_ok=True)
    try:
        with open(temporary, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        # Above all on a full disk: what is half written would keep it full.
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def half_written(path: pathlib.Path, mark: str = "") -> pathlib.Path:
    """Where `write_whole` keeps what is not yet whole."""
    return path.with_name(f"{path.name}{mark and '.'}{mark}.part")


def read_json(path: pathlib.Path) -> Any:
    """Content of the file; `FileNotFoundError` if it is not there, `ValueError` if it says nothing."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise
    except OSError as error:
        raise ValueError(error.strerror or str(error)) from None
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"not JSON: {error}") from None


def checksum(path: pathlib.Path) -> str | None:
    """SHA-256 of a file; `None` where there is no file that can be read."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


def checksum_of(data: bytes) -> str:
    """SHA-256 of what would be in a file."""
    return hashlib.sha256(data).hexdigest()


def link_above(path: pathlib.Path, top: pathlib.Path) -> pathlib.Path | None:
    """A symbolic link between `top` and `path`, through which a write would leave `top`."""
    for parent in path.parents:
        if parent == top:
            return None
        if parent.is_symlink():
            return parent
    return None
