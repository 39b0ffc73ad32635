"""Compiled programs kept on disk, so that the next process starts where this one has got to."""

import contextlib
import hashlib
import importlib.metadata
import os
import pathlib
import platform

import jax
from jax.experimental.compilation_cache import compilation_cache

from ._paths import the_directory
from ._types import Path
from ._validation import one_static

_SUFFIX = "-cache"


def enable_compilation_cache(
    directory: Path | None = None, *, max_bytes: float = 4e9
) -> pathlib.Path | None:
    """Keep compiled programs on disk from now on: a program is compiled once, not once per process.

    JAX's own persistent cache, with thresholds that fit this package. Several processes may share the
    directory. Programs are distinguished by all that goes into them, by the version of jaxlib and by
    the processor. A damaged entry is compiled anew, with a warning of JAX. An intact one is run as
    it is, so the directory must be one that only you can write to; a new one is made so.

    **Arguments**

    - `directory`: by default `$STICKSLIP_CACHE`, or `stickslip` in `$XDG_CACHE_HOME` or `~/.cache`.
    - `max_bytes`: at this call, programs that were not used for longest are deleted until the rest is
      smaller.

    **Returns** the folder in which the programs lie; `None`, and nothing is kept, if it cannot be made.
    **Raises** `TypeError` for a folder that is not a path, `ValueError` for a size that is not
    positive.
    """
    one_static("max_bytes", max_bytes, "positive")
    if directory is None:
        root = _default_directory().expanduser()
    else:
        root = the_directory("directory", directory, "the path of a directory, or None")
    folder = root.resolve() / "compiled" / _here()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return None
    _shrink(folder.parent, max_bytes)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_enable_compilation_cache", True)
    # All are kept. A first fit is a few long programs and some two hundred of milliseconds: a figure of
    # the machine that took 35 s with the long ones kept takes 30 s with all of them.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    # JAX would keep to the cache, or to none, that it found at its first compilation.
    compilation_cache.reset_cache()
    return folder


def _default_directory() -> pathlib.Path:
    given = os.environ.get("STICKSLIP_CACHE")
    if given:
        return pathlib.Path(given)
    return pathlib.Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "stickslip"


def _here() -> str:
    """Name for this jaxlib on this kind of processor: a program made for another one may not run."""
    jaxlib = importlib.metadata.version("jaxlib")
    what = platform.machine() + _processor()
    return f"{jaxlib}-{hashlib.sha256(what.encode()).hexdigest()[:12]}"


def _processor() -> str:
    """The instructions of the processor where the system lists them, else its name."""
    with contextlib.suppress(OSError):
        for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith(("flags", "Features")):
                return " ".join(sorted(line.partition(":")[2].split()))
    return platform.processor()


def _shrink(folder: pathlib.Path, most: float) -> None:
    """Delete the entries used least recently until no more than `most` bytes are left.

    JAX's own limit needs a package more, locks the directory for every entry, and fails where a file
    of its bookkeeping is missing. Here a file that another process deletes meanwhile is a file less.
    """
    found = []
    for path in folder.glob(f"*/*{_SUFFIX}"):
        with contextlib.suppress(OSError):
            about = path.stat()
            found.append((max(about.st_atime, about.st_mtime), about.st_size, path))
    left = sum(size for _, size, _ in found)
    for _, size, path in sorted(found):
        if left <= most:
            break
        with contextlib.suppress(OSError):
            path.unlink()
        left -= size
