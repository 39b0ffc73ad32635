"""Whether the fused executor can be trusted with this jaxlib: tried once in a subprocess.

The fused executor rests on attributes internal to XLA. A compiler that does not take them may abort
the process, so the trial runs in another one: a stick-slip motion with events, sections and
derivatives, compared in value with the portable executor. The verdict is kept on disk per jaxlib
version and processor.
"""

import functools
import hashlib
import importlib.metadata
import json
import os
import pathlib
import platform
import subprocess
import sys

from .. import _version

TIMEOUT = 300  # s; a trial takes about ten seconds


def _jaxlib() -> str:
    return importlib.metadata.version("jaxlib")


def _cache_file() -> pathlib.Path:
    root = os.environ.get("STICKSLIP_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "stickslip"
    )
    what = (_jaxlib(), platform.machine(), sys.version_info[:2], _version.__version__)
    digest = hashlib.sha256(repr(what).encode()).hexdigest()[:12]
    return pathlib.Path(root) / f"fused-{_jaxlib()}-{digest}.json"


@functools.cache
def fused_is_trusted() -> bool:
    """Whether the trial succeeded, now or earlier; `STICKSLIP_EXECUTOR=portable` forbids it."""
    if os.environ.get("STICKSLIP_EXECUTOR") == "portable":
        return False
    path = _cache_file()
    try:
        return bool(json.loads(path.read_text())["trusted"])
    except (OSError, ValueError, KeyError, TypeError):
        pass
    verdict = run_trial()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"trusted": verdict, "jaxlib": _jaxlib()}))
    except OSError:
        pass  # a read-only home costs a trial per process, nothing else
    return verdict


def run_trial() -> bool:
    """Run the trial in a subprocess; any abort, error, disagreement or time-out means no."""
    environment = {**os.environ, "JAX_PLATFORMS": "cpu"}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "stickslip.sweep._trial"],
            env=environment, capture_output=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and done.stdout.strip().endswith(b"fused agrees")
