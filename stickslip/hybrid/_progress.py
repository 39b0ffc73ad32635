"""A progress line for long runs: how far the slowest lane has come."""

import sys
import time

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp

from .._argument_checks import check_arguments, static_number, text
from .._types import Numeric, Whole
from .status import RUNNING


@check_arguments(name=text(), interval=static_number("not negative"))
class ProgressMeter(eqx.Module):
    """Writes `name: 42 % (t = 21 of 50 s), 3 s left` to stderr, at most every `interval` seconds.

    Off unless given to `Integrator(progress=...)`. Safe under `jit` and `vmap`: it shows the slowest
    lane. It costs a host callback per 128 attempts.

    Errors: `TypeError`, `ValueError` for a name that is not a text, an interval that is negative or no
    number of Python.
    """

    name: str = eqx.field(static=True, default="simulate")
    interval: float = eqx.field(static=True, default=0.5)

    def report(self, t0: Numeric, t: Numeric, t1: Numeric, status: Whole) -> None:
        """Called inside the loop, once per block of attempts."""
        left = jnp.where(status == RUNNING, t1 - t, 0.0)
        slowest = eqxi.unvmap_max(left)
        span = eqxi.unvmap_max(t1 - t0)
        jax.debug.callback(_line, slowest, span, name=self.name, interval=self.interval)


_started: dict[str, tuple[float, float]] = {}  # name -> (start of the run, last line)


def _line(slowest, span, *, name: str, interval: float) -> None:
    now = time.monotonic()
    share = 1.0 - float(slowest) / float(span) if float(span) > 0 else 1.0
    start, last = _started.get(name, (now, 0.0))
    done = share >= 1.0
    if done or now - last >= interval:
        left = (now - start) * (1.0 - share) / share if share > 0 else float("nan")
        end = "\n" if done else ""
        sys.stderr.write(f"\r{name}: {100 * share:3.0f} %, {left:.0f} s left {end}")
        sys.stderr.flush()
        last = now
    if done:
        _started.pop(name, None)
    else:
        _started[name] = (start, last)
