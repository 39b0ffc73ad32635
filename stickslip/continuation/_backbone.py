"""`backbone`: phase resonance over the level of the force; frequency and damping over amplitude."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree
from scipy.optimize import brentq

from .._show import amount, number
from .._types import Given, Row
from .._validation import check_known, check_type, one_row, refusal
from ..analysis.observable import Observable, RateOf, as_observable, shape_of, with_parameters
from ..hybrid import AbstractHybridSystem
from ..hybrid.arguments import the_system
from ..hybrid.components import numbers_of
from ..hybrid.tree import with_float_arrays
from ..progress import showing, tell
from ._accuracy import ACCURACY
from ._arguments import value_of
from ._forced_response import ForcedResponse, start_and_observables
from ._forcing import FORCING, Forcing, check_forcing
from ._frequency_response import Solver
from ._options import SHOOTING, Shooting

POWER, ENERGY = "power of the force", "energy"


class Backbone(eqx.Module):
    r"""Phase resonance over the level of the force, `[level]`.

    - `level`: name of the parameter; `values` of it.
    - `frequency`: where the observable lags the force by 90 degrees [rad/s]; NaN where none was found.
    - `dissipation` $D$: work of the force in a period [J], all of which is dissipated.
    - `energy` $E_{max}$: the greatest energy in the period [J].
    - `responses`: the `ForcedResponse` of each level.
    """

    level: str
    values: np.ndarray
    frequency: np.ndarray
    dissipation: np.ndarray
    energy: np.ndarray
    responses: ForcedResponse

    @property
    def amplitude(self) -> Any:
        """Amplitude of the observable."""
        return next(iter(self.responses.amplitude.values()))

    @property
    def damping(self) -> np.ndarray:
        r"""Ratio $\zeta = D/(4\pi E_{max})$; of a linear oscillator $c/(2\sqrt{km})$."""
        return self.dissipation / (4.0 * np.pi * self.energy)

    def __repr__(self) -> str:
        rows = zip(self.values, self.frequency, self.amplitude, self.damping, strict=True)
        table = [
            f"  {self.level} {number(v)}: {number(w)} rad/s, amplitude {number(a)}, damping {number(z)}"
            for v, w, a, z in rows
        ]
        return "\n".join([f"Backbone: {amount(self.values.size, 'level')}", *table])


@dataclasses.dataclass(frozen=True)
class PowerOf:
    """Power of a force on an observable."""

    force: Observable
    value: Observable

    def __call__(self, system, t, y, dy, mode, args):
        rate = RateOf(self.value)(system, t, y, dy, mode, args)
        return self.force(system, t, y, dy, mode, args) * rate


@dataclasses.dataclass(frozen=True)
class EnergyOf:
    """Energy that a mechanical system says."""

    def __call__(self, system, t, y, dy, mode, args):
        return system.energy(y)


@showing("backbone")
def backbone(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    level: Given[str],
    values: Row,
    forcing: Given[Forcing] = FORCING,
    *,
    observable: Given[str | Callable | None] = None,
    energy: Given[str | Callable | None] = None,
    shooting: Given[Shooting] = SHOOTING,
    args: PyTree = None,
) -> Backbone:
    r"""Frequency and damping of a resonance over the level of the force, by phase resonance.

    At each level the frequency is looked for at which the first harmonic of the observable lags that of
    the force by 90 degrees: there the force gives the energy that damping and friction take, and the
    motion is nearly that of the system without both. The damping ratio is
    $\zeta = D/(4\pi E_{max})$, with the work $D$ of the force in a period.

    **Arguments**

    - `system`: its frequency, the parameter `forcing.frequency`, is the first guess, near resonance;
      `y0`, `args`: as for `forced_response`.
    - `level`: name of the parameter that is the level of the force; `values` of it, in whose order the
      resonance is followed.
    - `forcing`: a `Forcing` with a `force` [N].
    - `observable`: the displacement on which the force acts; the first component by default.
    - `energy`: as an observable [J], whose greatest value over the period is $E_{max}$; by default
      `system.energy(y)`, kinetic and potential.
    - `shooting`: a `Shooting`.

    **Returns** a `Backbone`. Where friction holds everything, or no frequency is found, it is NaN.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation.
    """
    the_system(system)
    check_type("shooting", shooting, Shooting, "a Shooting")
    value_of(system, level, "level")
    row = np.asarray(check_known("values", one_row("values", values)), float)
    system, args = with_float_arrays((system, args))
    check_forcing(forcing, system)
    if forcing.force is None:
        raise refusal("forcing.force", None, "given: its work is what is dissipated")
    start = value_of(system, forcing.frequency, "forcing.frequency")
    if not (observable is None or isinstance(observable, str) or callable(observable)):
        allowed = "the name of an observable, or a function f(system, t, y, dy, mode, args)"
        raise refusal("observable", observable, allowed, TypeError)
    name = observable if isinstance(observable, str) else "observable"
    named = numbers_of(y0)[0] if observable is None else {name: observable}
    y0, mode0, found = start_and_observables(
        system, y0, None, args, forcing, named
    )  # the observable, and the force
    if energy is None and not callable(getattr(system, "energy", None)):
        raise refusal("energy", None, "given for a system that has no method energy(y)")
    of = EnergyOf() if energy is None else as_observable("energy", energy, system, y0)[0]
    shape_of("energy", energy, of, system, y0, mode0, args, single=True)
    (first, value), force = found
    named = ((first, value), (POWER, PowerOf(force[1], value)), (ENERGY, of), force)
    solver = Solver(system, args, shooting.integrator_or(), forcing, named, shooting.max_events)
    levels: list[tuple[float, ForcedResponse]] = []
    for value in row:
        at = dataclasses.replace(solver, system=with_parameters(system, {level: jnp.asarray(value)}))
        near = [found for resonance, found in levels if np.isfinite(resonance)][-1:]
        begin = at.beside(start, near[0]) if near else None
        if begin is None or not bool(begin.successful):
            begin = at(start, y0, mode0, 0.0, ACCURACY.tries)
        resonance, found = _resonance(at, begin, first, start)
        start = resonance if np.isfinite(resonance) else start
        levels.append((resonance, found))
        tell(f"{level} = {value:.6g}")
    frequency = np.array([resonance for resonance, _ in levels])
    every: Any = jax.tree.map(lambda *leaves: np.stack(leaves), *(found for _, found in levels))
    lost = ~np.isfinite(frequency)
    period = 2.0 * np.pi / every.frequency
    work, most = every.mean[POWER] * period, every.highest[ENERGY]

    def of_observable(values: dict[str, Any]) -> dict[str, Any]:
        row = values[first]
        return {first: np.where(lost.reshape(-1, *(1,) * (row.ndim - 1)), np.nan, row)}

    tables = every.mean, every.lowest, every.highest, every.harmonics
    kept = eqx.tree_at(
        lambda r: (r.mean, r.lowest, r.highest, r.harmonics), every, tuple(map(of_observable, tables))
    )  # fmt: skip
    return Backbone(
        level, row, frequency, np.where(lost, np.nan, work), np.where(lost, np.nan, most), kept
    )


def _resonance(
    solver: Solver, near: ForcedResponse, name: str, start: float
) -> tuple[float, ForcedResponse]:
    """Frequency at which an observable lags the force by 90 degrees, and the response there.

    The zero of the cotangent of the lag, which of a linear oscillator is nearly straight over the
    frequency, by secants and then by Brent's method.
    """
    known: dict[float, ForcedResponse] = {}

    def cotangent(at: float) -> float:
        # Solved again from elsewhere it would differ by rounding, and so might the sign at the zero.
        if at not in known:
            beside = sorted(known, key=lambda other: abs(other - at))[: ACCURACY.few]
            found = solver.nearest(at, [known[other] for other in beside] or [near])
            if not bool(found.successful):
                raise ArithmeticError(at)
            known[at] = found
        first = complex(known[at].harmonics[name][0])
        return first.real / first.imag

    try:
        one, two = start, start * (1.0 + ACCURACY.little)
        values = [cotangent(one), cotangent(two)]
        for _ in range(ACCURACY.tries):
            if values[0] * values[1] <= 0.0:
                break
            # Beyond the zero of the secant, so that it lies between both.
            step = -ACCURACY.longer * values[1] * (two - one) / (values[1] - values[0])
            step = float(np.clip(step, -ACCURACY.swerves * two, ACCURACY.swerves * two))
            one, two = two, two + step
            values = [values[1], cotangent(two)]
        tolerances: Any = {"xtol": 1e-300, "rtol": 1e-14}
        at: Any = brentq(cotangent, one, two, **tolerances)
        cotangent(at)
    except (ArithmeticError, ValueError):
        return np.nan, near
    lags = complex(known[at].harmonics[name][0]).imag < 0.0
    return (float(at), known[at]) if lags else (np.nan, near)
