"""How a branch is followed, and how an orbit is shot: the settings that all verbs share."""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx

from .._types import Given
from .._validation import check_callable, check_count, check_flag, check_type, one_concrete, refusal
from ..hybrid import AdaptiveStep, Integrator
from ._accuracy import ACCURACY

# Labels of events that are the toolkit's own.
LABELS = ("LP", "PD", "NS", "BP", "HB", "FL", "GR", "SQ", "UZ", "EP")


class Follow(eqx.Module):
    """How a branch is followed: by `continue_orbit`, `continue_equilibrium` and `continue_point` alike.

    - `step`: first and longest step, in parts of the bounds' distance and of the motion's size (of the
      extent of the branch for equilibria).
    - `max_points`: on each of the two halves of the branch.
    - `both`: follow to both sides of the start; otherwise to larger values of the (last) parameter.
    - `values`: of the parameter at which a point `UZ` is wanted; over two parameters a tuple for each.
    - `tests`: real functions by label, whose zeros are located as special points of that label. They
      are called as `test(orbit)`: with a `PeriodicOrbit`, or an `Equilibrium`.

    >>> Follow(step=0.02, tests={"half": lambda orbit: orbit.highest.x - 0.5}).max_points
    200

    **Errors** `ValueError`/`TypeError` naming the argument.
    """

    step: float = 0.01
    max_points: int = 200
    both: bool = True
    values: tuple = ()
    tests: Mapping[str, Callable[[Any], Any]] = eqx.field(default_factory=dict)

    def __check_init__(self):
        one_concrete("step", self.step, "positive")
        check_count("max_points", self.max_points, 1)
        check_flag("both", self.both)
        allowed = "a tuple of numbers, or over two parameters a tuple of numbers for each"
        if not isinstance(self.values, tuple):
            raise refusal("values", self.values, allowed, TypeError)
        for i, row in enumerate(self.values):
            for value in row if isinstance(row, tuple) else (row,):
                one_concrete(f"values[{i}]", value)
        if not isinstance(self.tests, Mapping):
            raise refusal("tests", self.tests, "a mapping from labels to functions", TypeError)
        for label, function in self.tests.items():
            if not isinstance(label, str) or label in LABELS:
                raise refusal("tests", label, f"labels that are not taken: not {', '.join(LABELS)}")
            check_callable(f"tests[{label!r}]", function, "f(orbit)", 0)

    def values_by_parameter(self, count: int) -> tuple:
        """Values that are asked for, a tuple for each of so many parameters."""
        return (self.values,) if count == 1 else (self.values or ((),) * count)


class Shooting(eqx.Module):
    """How a periodic orbit is shot: in all verbs that look for one.

    - `segments`: the period in so many pieces, whose starts are unknowns too (multiple shooting): for
      long or very unstable orbits. The knots may fall into sticks.
    - `integrator`: as for `simulate`; by default `AdaptiveStep(1e-12)`, for `orbit_guess` 1e-10.
    - `max_events`: room for the events of one period.

    **Errors** `ValueError`/`TypeError` naming the argument.
    """

    segments: int = 1
    integrator: Given[Integrator | None] = None
    max_events: int = 256

    def __check_init__(self):
        check_count("segments", self.segments, 1)
        check_count("max_events", self.max_events, 1)
        if self.integrator is not None:
            check_type("integrator", self.integrator, Integrator, "an Integrator or None")

    def integrator_or(self, tolerance: float = ACCURACY.integration) -> Integrator:
        """The integrator, or one of this tolerance where none is given."""
        # Derivatives of a period are needed to more digits than a run of `simulate` has by default.
        if self.integrator is not None:
            return self.integrator
        return Integrator(step=AdaptiveStep(tolerance))


FOLLOW, SHOOTING = Follow(), Shooting()
