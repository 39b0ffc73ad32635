"""One line on stderr: progress, rate and time remaining."""

import math
import sys
import time
from typing import Any


def clock(seconds: float) -> str:
    """`65.0` as `1:05`, `4000.0` as `1:06:40`."""
    if not math.isfinite(seconds):
        return "?"
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"


class Progress:
    """Progress of `total` lanes or `things`, `done` of which an earlier run has finished.

    `note`: what there is to say besides, at the end of the line.
    `shown=None` shows it where stderr is a terminal. Elsewhere, if asked for, it writes a line of its
    own each time, at most one in five seconds, so that a log stays readable.
    """

    def __init__(
        self,
        total: int,
        done: int = 0,
        *,
        name: str = "sweep",
        things: str = "lanes",
        shown: bool | None = None,
        stream: Any = None,
    ):
        self.total, self.done, self.name, self.things = total, done, name, things
        self.note = ""
        self.stream = sys.stderr if stream is None else stream
        self.terminal = bool(getattr(self.stream, "isatty", lambda: False)())
        self.shown = self.terminal if shown is None else shown
        self.begin = time.monotonic()
        self.before = done
        self._last = -math.inf
        self._width = 0

    def line(self) -> str:
        """The line as it stands now; the rate is that of this run alone."""
        elapsed = time.monotonic() - self.begin
        rate = (self.done - self.before) / elapsed if elapsed > 0 else 0.0
        left = (self.total - self.done) / rate if rate > 0 else math.inf
        share = f"{self.done:,} of {self.total:,} {self.things} ({self.done / self.total:.0%})"
        text = f"{self.name}: {share}"
        if rate > 0:
            often = f"{rate:,.0f}" if rate >= 10 else f"{rate:.2g}"
            text += f", {often} per s, {clock(elapsed)} gone, {clock(left)} left"
        return text + (f"; {self.note}" if self.note else "")

    def show(self, text: str | None = None) -> None:
        """Write the line, or another `text`, unless one was written a moment ago."""
        now = time.monotonic()
        pause = 0.1 if self.terminal else 5.0
        if not self.shown or (text is None and self.done < self.total and now - self._last < pause):
            return
        self._last = now
        text = self.line() if text is None else f"{self.name}: {text}"
        if self.terminal:
            self.stream.write("\r" + text.ljust(self._width))
            self._width = len(text)
        else:
            self.stream.write(text + "\n")
        self.stream.flush()

    def advance(self, lanes: int) -> None:
        """Count `lanes` more as finished."""
        self.done += lanes
        self.show()

    def close(self) -> None:
        """End the line, so that what follows starts on a new one."""
        if self.shown and self.terminal and self._width:
            self.stream.write("\n")
            self.stream.flush()
            self._width = 0
