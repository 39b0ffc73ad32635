"""How long motions are followed, and how far."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import numpy as np

from .._types import Given
from .._validation import check_mapping, one_concrete, refusal
from ._accuracy import ACCURACY


def _pairs(given: Given[Mapping[str, tuple[float, float]]]) -> dict[str, Any]:
    return check_mapping("limits", given)


class Settle(eqx.Module):
    """How long motions are followed, and how far.

    - `duration` [s], positive: what is not settled after it is called so. Of a motion whose slowest
      multiplier or eigenvalue is known some ten times its time to halve, and four of its periods.
    - `forcing_period` [s]: of a system that depends on the time.
    - `limits`: name of a component to its least and greatest value, `{"x": (-10.0, 10.0)}`: a motion
      beyond them, at one of 32 times of the duration or where its run fails, has left.

    **Errors** `ValueError`/`TypeError` naming the argument.
    """

    duration: float
    forcing_period: Given[float | None] = None
    limits: Mapping[str, tuple[float, float]] = eqx.field(converter=_pairs, default_factory=dict)

    def __check_init__(self):
        one_concrete("duration", self.duration, "positive")
        if self.forcing_period is not None:
            one_concrete("forcing_period", self.forcing_period, "positive")
            if self.forcing_period > self.duration:
                allowed = f"at most the duration, {self.duration} s"
                raise refusal("forcing_period", self.forcing_period, allowed)
        check_limits("limits", self.limits)

    @property
    def times(self) -> np.ndarray:
        """Times [s] after which motions are judged: whole periods of the forcing where there is one."""
        number = np.arange(1, ACCURACY.rounds + 1)
        if self.forcing_period is None:
            return self.duration * number / ACCURACY.rounds
        most = int(self.duration / self.forcing_period * (1.0 + 1e-9))
        return self.forcing_period * np.unique(np.ceil(most * number / ACCURACY.rounds))


def check_limits(argument: str, given: Mapping[str, tuple[float, float]]) -> None:
    """Raise for a mapping to anything but pairs of numbers, the lower one first."""
    for name, pair in given.items():
        try:
            low, high = (one_concrete(f"{argument}[{name!r}]", value) for value in pair)
        except (TypeError, ValueError):
            raise refusal(f"{argument}[{name!r}]", pair, "two numbers, the lower one first") from None
        if not low < high:
            raise refusal(f"{argument}[{name!r}]", pair, "two numbers, the lower one first")
