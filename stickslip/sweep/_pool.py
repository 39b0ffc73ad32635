"""Several workers on one host: new Python processes that run the command line."""

import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

from ._children import family
from ._files import read_json
from ._layout import Files
from ._records import recorded
from .progress import Progress

_LOOK = 0.2  # s


def run_processes(
    path: pathlib.Path,
    processes: int,
    seconds: float | None,
    wait: bool,
    expiry: float,
    progress: bool | None,
) -> dict[str, int]:
    """Run workers until all have ended; an interruption is handed on to them."""
    command = [sys.executable, "-m", "stickslip", "work", str(path), "--quiet", f"--expiry={expiry}"]
    command += [] if wait else ["--no-wait"]
    command += [] if seconds is None else [f"--until={seconds}s"]
    # What this process can import, they can.
    inherited = os.pathsep.join(os.path.abspath(place) for place in sys.path)
    environment = {**os.environ, "PYTHONPATH": inherited}
    before, total = _count(path)
    meter = Progress(total, min(before, total), name="work", things="units", shown=progress)
    with contextlib.ExitStack() as stack:
        said = [stack.enter_context(tempfile.TemporaryFile()) for _ in range(processes)]
        running = [
            # In a group of their own: Ctrl-C reaches them once, by way of this process.
            subprocess.Popen(
                command, env=environment, stdout=subprocess.DEVNULL, stderr=file, process_group=0
            )
            for file in said
        ]
        try:
            while any(process.poll() is None for process in running):
                time.sleep(_LOOK)
                there, meter.total = _count(path)  # which grows where a sweep is refined
                meter.advance(min(there, meter.total) - meter.done)
        except BaseException:
            for process in running:
                with contextlib.suppress(OSError):
                    process.send_signal(signal.SIGINT)
            raise
        finally:
            for process in running:
                process.wait()
            meter.close()
        failed = [i for i, process in enumerate(running) if process.returncode != 0]
        there, total = _count(path)
        left = total - there
        if failed:
            said[failed[0]].seek(0)
            lines = said[failed[0]].read().decode("utf-8", "replace").strip().splitlines()
            last = lines[-1] if lines else f"exit status {running[failed[0]].returncode}"
            raise RuntimeError(
                f"{len(failed)} of {processes} workers of store {str(path)!r} failed, the first one "
                f"with: {last}. What is finished is kept; {left} of {total} units are left."
            )
    return {"computed": there - before, "left": max(left, 0)}


def _count(path: pathlib.Path) -> tuple[int, int]:
    """How many units of a sweep have a record, and how many there are so far."""
    there = total = 0
    for store in family(path):
        with contextlib.suppress(FileNotFoundError):
            total += Files(read_json(store / "manifest.json")).total
            there += len(recorded(store))
    return there, total
