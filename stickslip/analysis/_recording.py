"""How an analysis looks at a motion: when, on which sections or in which segments."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from .._types import Given, Named, Numeric, Row
from .._validation import check_count, check_type, one_concrete, one_number, refusal
from ..hybrid import Section
from ..hybrid.arguments import a_time
from ._arguments import times_of
from .observable import Maximum, Minimum, named_observables

Cut = Section | Maximum | Minimum


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
        _set_field(self, "tolerance", float(one_concrete("tolerance", self.tolerance, "positive")))
        check_count("longest", self.longest, 1)


@dataclasses.dataclass(frozen=True)
class Recording:
    """The points of a motion that are recorded: where, when, and how they are judged.

    - `transient`: time dropped at the beginning [s]; `duration`: time recorded after it [s].
    - `section`: a `Section` (direction in words), `Maximum("x")` or `Minimum("x")` of an observable, or
      a mapping from names to several of them, which are recorded in the same run.
    - `observables`: name or sequence of names: a component of the state, `"x[0]"` for one number of an
      array, `"slope of x"`, `"t"`, a method `(t, y, mode, args)` of the system; or a mapping from names
      to those or to functions `(system, t, y, dy, mode, args)`. A component with a period is given
      within half of it on both sides of zero, and a motion that goes round has a period if it comes
      back but for whole turns.
    - `points`: stop after so many points; a motion with fewer is marked.
    - `max_points`: without `points`, room for so many; a motion with more is marked.
    - `period`: when points repeat.
    - `domain`: observables that must not fall below zero, single numbers; a motion of which one does
      ends there.
    - `check`: so many lanes, evenly spaced, are computed again at half the step (`FixedStep`) or a
      32nd of the tolerances, for an error estimate. 0 leaves it out.
    - `t0`: time at the start [s].

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed; sections and
    observables are checked against the system when the recording is used.
    """

    transient: Numeric
    duration: Numeric
    section: Given[Cut | Mapping[str, Cut]]
    observables: Given[str | Sequence[str] | Named]
    points: Given[int | None] = None
    max_points: Given[int] = 256
    period: Given[PeriodTest] = dataclasses.field(default_factory=PeriodTest)
    domain: Given[Sequence[Any]] = ()
    check: Given[int] = 32
    t0: Numeric = 0.0

    def __post_init__(self):
        _set_field(self, "transient", float(one_concrete("transient", self.transient, "not negative")))
        _set_field(self, "duration", float(one_concrete("duration", self.duration, "positive")))
        _set_field(self, "t0", float(a_time("t0", one_concrete("t0", self.t0))))
        check_count("max_points", self.max_points, 1)
        check_count("check", self.check, 0)
        if self.points is not None:
            check_count("points", self.points, 1)
        check_type("period", self.period, PeriodTest, "a PeriodTest")
        named_observables(self.observables)
        whole = isinstance(self.domain, str) or callable(self.domain)
        _set_field(self, "domain", (self.domain,) if whole else self.domain)
        check_type("domain", self.domain, tuple | list, "an observable or a sequence of observables")

    @property
    def size(self) -> int:
        """Points for which there is room."""
        return self.max_points if self.points is None else self.points


@dataclasses.dataclass(frozen=True)
class Samples:
    """The times at which a motion is read; a row of times `t` means `Samples(t)`.

    - `ts`: the times [s], two or more, increasing.
    - `transient`: time dropped before the first of them [s]; the motion starts at its beginning.
    - `max_points`: room for so many crossings of each section.

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    ts: Row
    transient: Numeric = 0.0
    max_points: Given[int] = 256

    def __post_init__(self):
        check_count("max_points", self.max_points, 1)
        _set_field(self, "ts", times_of("ts", self.ts))
        _set_field(self, "transient", float(one_concrete("transient", self.transient, "not negative")))

    @property
    def t0(self) -> float:
        """Time at the start of the motion [s]."""
        return float(self.ts[0]) - float(self.transient)


def samples_of(record: Any) -> Samples:
    """The samples that are meant by a `Samples` or by a row of times."""
    return record if isinstance(record, Samples) else Samples(times_of("record", record))


@dataclasses.dataclass(frozen=True)
class Segments:
    """The part of a motion over which a growth rate is averaged, in segments of one length.

    - `length` [s]: time of a segment; `count`: how many are averaged.
    - `transient`: time dropped at the beginning [s].
    - `warm_up`: so many segments after it, which are not averaged, turn the deviations into the
      directions that grow; by default a tenth of `count`.
    - `blocks`: so many blocks of segments are averaged by themselves, for an error.
    - `t0`: time at the start [s].

    All may be traced but `count`, `warm_up` and `blocks`.
    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    length: Numeric
    count: Given[int]
    transient: Numeric = 0.0
    warm_up: Given[int | None] = None
    blocks: Given[int] = 10
    t0: Numeric = 0.0

    def __post_init__(self):
        one_number("length", self.length, "positive")
        one_number("transient", self.transient, "not negative")
        a_time("t0", self.t0)
        for name, low in (("count", 4), ("blocks", 2)):
            check_count(name, getattr(self, name), low)
        if self.warm_up is not None:
            check_count("warm_up", self.warm_up, 0)
        if self.count < 2 * self.blocks:
            allowed = f"at least 2 blocks = {2 * self.blocks}, with blocks = {self.blocks}"
            raise refusal("count", self.count, allowed)

    @property
    def warm_up_count(self) -> int:
        """Segments of the warm-up."""
        return self.count // 10 if self.warm_up is None else self.warm_up

    @property
    def duration(self) -> Any:
        """Time of all segments, the warm-up included [s]."""
        return self.length * (self.count + self.warm_up_count)


def _set_field(thing: object, name: str, value: Any) -> None:
    object.__setattr__(thing, name, value)
