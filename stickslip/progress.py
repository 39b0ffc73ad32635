"""How far a long call has come: one line on stderr, in a terminal, in a notebook and in a log.

A call of a few seconds says nothing. `STICKSLIP_PROGRESS=off` in the environment silences all of them.
"""

import contextlib
import dataclasses
import math
import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import jax.monitoring

from ._blas import one_thread

WORDS = ("on", "off")
# Events of JAX: each of them ends a part of compiling, the last one all of it.
_NAMES = ("jaxpr_trace", "jaxpr_to_mlir_module", "backend_compile")
_PARTS = tuple(f"/jax/core/compile/{name}_duration" for name in _NAMES)


@dataclasses.dataclass(frozen=True)
class Pace:
    """When a line is written, all in s but the last."""

    patience: float = 3.0
    """Nothing is said of a call that ends before."""
    look: float = 1.0
    """Between looks at a call that says nothing itself, as while it compiles."""
    terminal: float = 0.1
    """Between lines in a terminal, where each takes the place of the one before."""
    notebook: float = 1.0
    """The same in a notebook, which keeps them all."""
    log: float = 5.0
    """The same elsewhere, each on a line of its own."""
    nothing_new: float = 60.0
    """The same, of a call that only says that it still runs."""
    program: float = 0.5
    """What takes less to compile is a single operation, not the program that is waited for."""
    share: float = 0.05
    """Of the time gone, by which the pauses grow but in a terminal: a day makes no endless log."""


class _Here(threading.local):
    """Meters of this thread that have begun and not ended, the outermost first, and their pace."""

    def __init__(self):
        self.pace = Pace()
        self.meters: list[Progress] = []


_here = _Here()
_hears: list[bool] = []


def clock(seconds: int | float) -> str:
    """`65.0` as `1:05`, `4000.0` as `1:06:40`."""
    if not math.isfinite(seconds):
        return "?"
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"


def wished_progress() -> bool:
    """`STICKSLIP_PROGRESS`, by default `"on"`; `ValueError` for another word."""
    given = os.environ.get("STICKSLIP_PROGRESS", "")
    wish = given.strip().lower() or "on"
    if wish not in WORDS:
        allowed = ", ".join(map(repr, WORDS))
        raise ValueError(f"STICKSLIP_PROGRESS = {given!r}: it must be one of {allowed}.")
    return wish == "on"


class Progress:
    """A line about a call, from `with Progress("profile"):` to its end.

    With a `total` it counts `things`, `done` of which an earlier run has finished, and says how much
    time is left; without it says whether it compiles or runs. `note`: what there is to say besides.
    Within another one it has no line of its own: the outermost writes, what counts goes before.

    `shown=None` shows it from the third second on, `True` at once, `False` never.
    """

    def __init__(
        self,
        name: str,
        total: int | float | None = None,
        done: int | float = 0,
        *,
        things: str = "lanes",
        shown: bool | None = None,
        pause: int | float | None = None,
        stream: Any = None,
    ):
        self.name, self.total, self.done, self.things = name, total, done, things
        self.note = ""
        self.stream = sys.stderr if stream is None else stream
        self.terminal = bool(getattr(self.stream, "isatty", lambda: False)())
        self.rewrites = self.terminal or type(self.stream).__module__.startswith("ipykernel")
        self.is_on = shown is not False and self.stream is not None and wished_progress()
        self.pace = _here.pace
        self.patience = 0.0 if shown else self.pace.patience
        self.pause = pause
        self.begin = self.since = time.monotonic()
        self.compiles_since = self.begin  # infinite from where it runs
        self.made_in = 0.0
        self.before = done
        self._all: list[Progress] = [self]
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._last, self._width = -math.inf, 0
        self._stage: Any = None  # of what the last line was about
        self._counted = False  # whether a meter within this one has had a line

    def __enter__(self) -> "Progress":
        self._all = _here.meters
        self._all.append(self)
        if self.is_on and self._all[0] is self:
            if not _hears:
                _hears.append(True)
                jax.monitoring.register_event_duration_secs_listener(_hear)
            # Begun by the call itself: a notebook shows what a thread writes below the cell it is from.
            threading.Thread(target=self._look, daemon=True).start()
        return self

    def __exit__(self, error: Any, *_: Any) -> None:
        outermost = self._all[0] is self
        self._all.remove(self)
        self._all = [self]
        self._ended.set()
        if outermost:
            self.close(error is None)

    def _look(self) -> None:
        wait = min(self.patience or self.pace.look, self.pace.patience)
        while not self._ended.wait(wait):
            self.show()
            wait = self.pace.look

    def line(self) -> str:
        """The line as it stands now; the rate is that of this run alone, without compiling."""
        now = time.monotonic()
        gone = f"{clock(now - self._all[0].begin)} gone"
        if self.total is None:
            return f"{self.name}: {self.note or 'running'}, {gone}"
        elapsed = now - self.since
        rate = (self.done - self.before) / elapsed if elapsed > 0 else 0.0
        left = (self.total - self.done) / rate if rate > 0 else math.inf
        share = f"{_number(self.done)} of {_number(self.total)} {self.things}"
        text = f"{self.name}: {share} ({self.done / self.total:.0%})"
        if rate > 0:
            often = f"{rate:,.0f}" if rate >= 10 else f"{rate:.2g}"
            text += f", {often} per s, {gone}, {clock(left)} left"
        return text + (f"; {self.note}" if self.note else "")

    def show(self) -> None:
        """Write the line, unless the call is young or one was written a moment ago."""
        first = self._all[0]
        if first is not self:
            first.show()
            return
        if not self.is_on:
            return
        with self._lock:
            now = time.monotonic()
            told = next((meter for meter in tuple(self._all) if meter.total is not None), self)
            compiles = now - self.compiles_since > self.pace.look
            stage = (id(told), compiles, told.total is not None and told.done >= told.total)
            if self._counted and told is self:
                return  # the last line stays that of the count
            new = not compiles and (told.total is not None or told.note)
            calm = stage == self._stage and now - self._last < self._least_pause(new)
            if self._ended.is_set() or now - self.begin < self.patience or calm:
                return
            self._last, self._stage = now, stage
            self._counted |= told is not self
            compiling = f"{told.name}: compiling ..., {clock(now - self.begin)} gone"
            self._write(compiling if compiles else told.line())

    def _least_pause(self, new: Any) -> float:
        if self.pause is not None:
            return self.pause
        if self.terminal:
            return self.pace.terminal
        least = self.pace.notebook if self.rewrites else self.pace.log if new else self.pace.nothing_new
        return max(least, self.pace.share * (time.monotonic() - self.begin))

    def _write(self, text: str) -> None:
        if self.terminal:
            text = text[: shutil.get_terminal_size().columns - 1]
        # A reader that is gone, as of a pipe, must not end what is computed.
        with contextlib.suppress(OSError, ValueError):
            self.stream.write("\r" + text.ljust(self._width) if self.rewrites else text + "\n")
            self.stream.flush()
        self._width = len(text)

    def advance(self, count: int | float) -> None:
        """Count `count` more as finished."""
        self.done += count
        self._all[0].compiles_since = math.inf
        self.show()

    def close(self, complete: bool = True) -> None:
        """End the line, if there is one, so that what follows starts on a new one."""
        with self._lock:
            if self._stage is None:
                return
            if complete and self.total is None and not self._counted:
                said = f"{self.note}, " if self.note else ""
                self._write(f"{self.name}: {said}done in {clock(time.monotonic() - self.begin)}")
            elif complete and self.total is not None and self.rewrites:
                self._write(self.line())
            if self.rewrites:
                with contextlib.suppress(OSError, ValueError):
                    self.stream.write("\n")
                    self.stream.flush()
            self._stage, self._width = None, 0


def _number(value: int | float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:.4g}"


@contextlib.contextmanager
def showing(name: str) -> Iterator[Progress]:
    """`with showing("profile"):` or `@showing("profile")`: a meter without a total.

    NumPy's part of such a call has one thread of BLAS, as the programs that it runs.
    """
    with Progress(name) as meter, one_thread:
        yield meter


def tell(note: str) -> None:
    """Say something besides of the call that is on its way here, if one shows its progress."""
    ready()
    if _here.meters:
        _here.meters[-1].note = note
        _here.meters[-1].show()


def ready() -> None:
    """Say that nothing is left to compile, so that the call runs from here on."""
    if _here.meters:
        _here.meters[0].compiles_since = math.inf


def is_showing() -> bool:
    """Whether a call on its way in this thread has a meter."""
    return bool(_here.meters)


def begin_first_call() -> None:
    """Begin a meter of a call that compiles, unless it is a part of one that has a meter."""
    if not _here.meters:
        Progress("stickslip").__enter__()


def end_first_call() -> None:
    """End the meter that `begin_first_call` began, if it did."""
    if _here.meters:
        _here.meters[0].__exit__(*sys.exc_info())


def _hear(event: str, duration_secs: float, **_: Any) -> None:
    """A part of compiling has ended in this thread."""
    if not _here.meters or event not in _PARTS:
        return
    now, first = time.monotonic(), _here.meters[0]
    # A program is traced, lowered and compiled, one after the other.
    so_far = 0.0 if event == _PARTS[0] else first.made_in
    first.made_in = so_far + duration_secs
    if first.made_in < first.pace.program:
        return
    if event != _PARTS[-1]:
        first.compiles_since = min(first.compiles_since, now)
        return
    first.compiles_since = math.inf
    for meter in _here.meters:
        if meter.done == meter.before:
            meter.since = now
