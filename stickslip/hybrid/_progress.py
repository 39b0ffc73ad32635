"""A progress line for long runs: how far the slowest lane has come."""

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp

from .._argument_checks import check_arguments, static_number, text
from .._types import Numeric, Whole
from ..progress import Progress
from .status import RUNNING


@check_arguments(name=text(), interval=static_number("not negative"))
class ProgressMeter(eqx.Module):
    """Writes `name: 21 of 50 s (42%), 7 per s, 0:03 gone, 0:04 left` to stderr, every `interval` [s].

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


_meters: dict[str, Progress] = {}


def _line(slowest, span, *, name: str, interval: float) -> None:
    done = float(span) - float(slowest)
    if name not in _meters:
        _meters[name] = Progress(name, float(span), things="s", shown=True, pause=interval)
        _meters[name].compiles_since = float("inf")
    _meters[name].advance(done - _meters[name].done)
    if not slowest > 0.0:
        _meters.pop(name).close()
