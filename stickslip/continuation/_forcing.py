"""How a system is forced: which parameter is the frequency, what acts, how many harmonics are told."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from .._one_function import first_alike
from .._types import Given
from .._validation import check_callable, check_count, check_text, check_type, one_number
from ..analysis.observable import CALL, check_parameter
from ..hybrid import AbstractHybridSystem


class Forcing(eqx.Module):
    r"""How a system is forced periodically.

    - `frequency`: name of the parameter that is the angular frequency $\omega$ [rad/s], `a__b` for `b`
      inside `a`.
    - `force`: the force [N] as an observable: the name of a method `(t, y, mode, args)` of the system,
      or a function `(system, t, y, dy, mode, args)`. Phases are those against its first harmonic; None:
      against $\cos\omega t$.
    - `period(system)` [s]: of the forcing; None: $2\pi/\omega$. The orbits that are followed have it.
    - `harmonics`: how many of them are told, from the first one on.

    >>> Forcing("drive__frequency", harmonics=3).harmonics
    3

    **Errors** `ValueError`/`TypeError` naming the argument.
    """

    frequency: str = eqx.field(static=True, default="frequency")
    force: Given[str | Callable | None] = eqx.field(static=True, default=None, converter=first_alike)
    period: Given[Callable[[Any], Any] | None] = eqx.field(
        static=True, default=None, converter=first_alike
    )
    harmonics: int = eqx.field(static=True, default=5)

    def __check_init__(self):
        check_text("frequency", self.frequency, "the name of a parameter")
        if isinstance(self.force, str):
            check_text("force", self.force, "the name of an observable")
        elif self.force is not None:
            check_callable("force", self.force, CALL, *range(6))
        if self.period is not None:
            check_callable("period", self.period, "period(system)", 0)
        check_count("harmonics", self.harmonics, 1)

    @property
    def rule(self) -> "PeriodRule":
        """The period [s] as a function of the system."""
        return PeriodRule(self.frequency, self.period)


@dataclasses.dataclass(frozen=True)
class PeriodRule:
    """Period of the forcing of a system; a value, so that equal ones have one program."""

    name: str
    rule: Callable | None

    def __call__(self, system: Any) -> Any:
        if self.rule is not None:
            return self.rule(system)
        return 2.0 * jnp.pi / parameter_of(system, self.name)


def parameter_of(system: Any, name: str) -> Any:
    """Value of the parameter of this name, `a__b` for `b` inside `a`."""
    for part in name.split("__"):
        system = getattr(system, part)
    return system


def check_forcing(forcing: Any, system: AbstractHybridSystem) -> None:
    """Raise unless it is a Forcing whose parameter the system has."""
    check_type("forcing", forcing, Forcing, "a Forcing")
    check_parameter(system, forcing.frequency, "forcing.frequency")
    one_number("forcing.period(system)", forcing.rule(system), "positive")


FORCING = Forcing()
