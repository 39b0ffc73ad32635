"""Whether the fused executor can be trusted with this jaxlib: tried once in a subprocess.

The fused executor rests on attributes internal to XLA. A compiler that does not take them may abort
the process, so the trial runs in another one: a stick-slip motion with events, sections and
derivatives, compared in value with the portable executor. The verdict is kept on disk per jaxlib
version and processor. Whatever ends the trial from outside, such as the time-out, gives no verdict.
"""

import contextlib
import functools
import hashlib
import importlib.metadata
import json
import os
import pathlib
import platform
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator

from .. import _version
from ..hybrid.executor import wished_executor
from ._cache import cache_directory
from ._files import read_json
from ._shift import warn_of_wrong_shifts

try:
    import fcntl
except ImportError:  # no advisory locks on this system
    fcntl = None

TIMEOUT = 300  # s; a trial takes about ten seconds
_FROM_OUTSIDE = {-signal.SIGINT, -signal.SIGTERM, -getattr(signal, "SIGKILL", signal.SIGTERM)}


def _jaxlib() -> str:
    return importlib.metadata.version("jaxlib")


def _cache_file() -> pathlib.Path:
    # The 2: verdicts of the first form may be time-outs.
    what = (2, _jaxlib(), platform.machine(), sys.version_info[:2], _version.__version__)
    digest = hashlib.sha256(repr(what).encode()).hexdigest()[:12]
    return cache_directory() / f"fused-{_jaxlib()}-{digest}.json"


def fused_is_trusted() -> bool:
    """Whether the environment says so, or the trial succeeded, now or earlier."""
    wish = wished_executor()
    return _trial_succeeds() if wish == "auto" else wish == "fused"


@functools.cache
def _trial_succeeds() -> bool:
    path, limit = _cache_file(), time.monotonic() + TIMEOUT
    verdict = _read(path)
    if verdict is None:
        with _alone(path, limit):
            # Another process may have come to a verdict while this one waited.
            verdict = _read(path)
            if verdict is None and time.monotonic() < limit:
                verdict = run_trial(limit - time.monotonic())
                if verdict is not None:
                    _write(path, verdict)
                    # After the verdict is kept, so that a warning made an error ends one process only.
                    warn_of_wrong_shifts()
    if verdict is None:
        warnings.warn(
            f"The trial of the fused executor did not end within {TIMEOUT} s or was stopped: this "
            "process uses the portable one, the next tries again; STICKSLIP_EXECUTOR=portable or "
            "=fused does without a trial.",
            RuntimeWarning,
            stacklevel=2,
        )
    return bool(verdict)


def _read(path: pathlib.Path) -> bool | None:
    """The verdict on disk; `None` for whatever is not clearly one."""
    try:
        said = read_json(path)
    except (OSError, ValueError):
        return None
    if not isinstance(said, dict) or said.get("jaxlib") != _jaxlib():
        return None
    trusted = said.get("trusted")
    return trusted if isinstance(trusted, bool) else None


def _write(path: pathlib.Path, verdict: bool) -> None:
    """Keep the verdict, by a rename: nobody reads half of it, and no link is written through."""
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
        with open(handle, "w", encoding="utf-8") as file:
            json.dump({"trusted": verdict, "jaxlib": _jaxlib()}, file)
        os.replace(temporary, path)
    except OSError:
        # A read-only home costs a trial per process, nothing else.
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


@contextlib.contextmanager
def _alone(path: pathlib.Path, limit: float) -> Iterator[None]:
    """Keep other processes from the same trial until this one is through, or `limit` has come."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
            handle = os.open(path.with_suffix(".lock"), flags, 0o600)
            stack.callback(os.close, handle)
            while fcntl is not None:
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    if time.monotonic() >= limit:
                        break
                    time.sleep(0.1)
        yield


def run_trial(timeout: float = TIMEOUT) -> bool | None:
    """Run the trial in a subprocess; any abort, error or disagreement means no.

    `None` if it did not end: by the time-out, a signal from outside, or because it could not start.
    """
    environment = {**os.environ, "JAX_PLATFORMS": "cpu"}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "stickslip.sweep._trial"],
            env=environment, capture_output=True, timeout=timeout, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    if done.returncode in _FROM_OUTSIDE:
        return None
    return done.returncode == 0 and done.stdout.strip().endswith(b"fused agrees")
