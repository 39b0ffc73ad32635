"""How a diagram looks at a motion: what is recorded, and when points repeat."""

import dataclasses

from .._types import Given, Numeric
from .._validation import check_count, one_concrete
from ..hybrid.arguments import a_time


@dataclasses.dataclass(frozen=True)
class Recording:
    """The part of a motion that is recorded.

    - `transient`: time dropped at the beginning [s]; `duration`: time recorded after it [s].
    - `points`: stop after so many points; a motion with fewer is marked.
    - `max_points`: without `points`, room for so many; a motion with more is marked.
    - `t0`: time at the start [s].

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    transient: Numeric
    duration: Numeric
    points: Given[int | None] = None
    max_points: Given[int] = 256
    t0: Numeric = 0.0

    def __post_init__(self):
        _set(self, "transient", float(one_concrete("transient", self.transient, "not negative")))
        _set(self, "duration", float(one_concrete("duration", self.duration, "positive")))
        _set(self, "t0", float(a_time("t0", one_concrete("t0", self.t0))))
        check_count("max_points", self.max_points, 1)
        if self.points is not None:
            check_count("points", self.points, 1)

    @property
    def size(self) -> int:
        """Points for which there is room."""
        return self.max_points if self.points is None else self.points


@dataclasses.dataclass(frozen=True)
class PeriodTest:
    """When the points of a motion count as repeating.

    - `tolerance`: by how much of its range along the motion an observable may differ.
    - `longest`: largest number of points after which they may repeat.

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    tolerance: Numeric = 1e-4
    longest: Given[int] = 16

    def __post_init__(self):
        _set(self, "tolerance", float(one_concrete("tolerance", self.tolerance, "positive")))
        check_count("longest", self.longest, 1)


def _set(thing: object, name: str, value: float) -> None:
    object.__setattr__(thing, name, value)
