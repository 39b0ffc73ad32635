"""`frequency_response`: forced periodic motions over the frequency, through folds, with harmonics."""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree
from numpy.polynomial import Chebyshev
from scipy.optimize import minimize_scalar

from .._show import amount, number
from .._types import Given, Named, Row
from .._validation import check_in, check_increasing, check_known, check_type, one_row, refusal
from ..analysis.observable import with_parameters
from ..hybrid import AbstractHybridSystem, current_executor
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import the_system
from ..hybrid.tree import with_float_arrays
from ..progress import showing
from ._accuracy import ACCURACY
from ._arguments import follow_of
from ._branch import Branch, BranchPoint
from ._continue import continue_orbit
from ._forced_response import FORCE, ForcedResponse, response_program, start_and_observables
from ._forcing import FORCING, Forcing, check_forcing
from ._guess import OrbitGuess
from ._options import SHOOTING, Follow, Shooting
from ._orbit import PeriodicOrbit

if TYPE_CHECKING:
    import xarray as xr

WIDE = Follow(step=0.02, max_points=1000, both=False)


class Part(NamedTuple):
    """Neighbouring points of a response whose motions have the same events: from `first` to `last`,
    values of the frequency, with so many `num_events` a period. In `words`: the modes that are entered,
    or the one in which the motion stays, and whether it is one of a family."""

    first: float
    last: float
    num_events: int
    words: str


class Solver(eqx.Module):
    """Finds the response at a frequency from one that is near to it."""

    system: AbstractHybridSystem
    args: PyTree
    integrator: Any
    forcing: Forcing = eqx.field(static=True)
    observables: Any = eqx.field(static=True)
    max_events: int = eqx.field(static=True)

    def __call__(self, value: float, y0: PyTree, mode0: Any, t0: Any, periods: int) -> ForcedResponse:
        """The response where the frequency has a value, from a start."""
        there = with_parameters(self.system, {self.forcing.frequency: jnp.asarray(value, jnp.float64)})
        found = response_program(
            there, self.args, self.integrator, current_executor(), y0, jnp.asarray(mode0),
            jnp.asarray(t0, jnp.float64), periods, forcing=self.forcing, observables=self.observables,
            max_events=self.max_events,
        )  # fmt: skip
        return jax.tree.map(np.asarray, found)

    def beside(self, value: float, near: ForcedResponse | PeriodicOrbit) -> ForcedResponse:
        """The response from another one, at the same phase of the force."""
        there = with_parameters(self.system, {self.forcing.frequency: jnp.asarray(value, jnp.float64)})
        period = near.period if isinstance(near, PeriodicOrbit) else 2.0 * np.pi / near.frequency
        t0 = float(near.t0) / float(period) * float(self.forcing.rule(there))
        return self(value, near.y0, near.mode0, t0, -1)

    def nearest(self, value: float, near: Sequence[ForcedResponse | PeriodicOrbit]) -> ForcedResponse:
        """The response from the first of these that leads to one."""
        found = self.beside(value, near[0])
        for other in near[1:]:
            if not bool(found.successful):
                found = self.beside(value, other)
        return found


class FrequencyResponse(eqx.Module):
    """Forced periodic motions over the frequency, in order along the branch.

    - `frequency`: values of the parameter, `[point]`; several points may have the same.
    - `responses`: a `ForcedResponse` with a leading axis, `[point]`: `amplitude`, `phase`, `harmonics`,
      `stable`, ..., of each observable by name.
    - `branch`: the `Branch` of `continue_orbit`, with all orbits and the special points: folds `LP`,
      borders `GR` where an event appears or vanishes, where and why it ends (`EP`).
    """

    frequency: np.ndarray
    responses: ForcedResponse
    branch: Branch
    sequences: tuple
    solver: Solver

    @property
    def observables(self) -> tuple[str, ...]:
        """Their names, in the order in which they were asked for."""
        return tuple(name for name, _ in self.solver.observables if name != FORCE)

    @property
    def amplitude(self) -> dict[str, Any]:
        """Half of the difference between greatest and least value, of each observable, `[point]`."""
        return self.responses.amplitude

    @property
    def stable(self) -> np.ndarray:
        """Whether each motion is stable, but along its family."""
        # One by one: an operation on all of them is compiled for each number of points.
        rows = (jax.tree.map(lambda leaf, i=i: leaf[i], self.responses) for i in range(len(self)))
        return np.array([bool(row.stable) for row in rows])

    @property
    def specials(self) -> tuple[BranchPoint, ...]:
        """Special points of the branch."""
        return self.branch.specials

    @property
    def parts(self) -> tuple[Part, ...]:
        """Neighbouring points with the same events, in order; where all the time all stick is one."""
        names = self.branch.system.mode_names
        starts = [
            0,
            *(i for i in range(1, len(self.sequences)) if self._differs(i)),
            len(self.sequences),
        ]
        parts = []
        for first, end in itertools.pairwise(starts):
            events = [m[1] if isinstance(m, tuple) else m for m in self.sequences[first]]
            words = ", ".join(str(names[mode]) for mode in events)
            free = int(self.responses.num_conserved[first])
            words += f"; one of a family: {free} conserved, as in the start" * (free > 0)
            values = float(self.frequency[first]), float(self.frequency[end - 1])
            parts.append(Part(*values, int(self.responses.num_events[first]), words))
        return tuple(parts)

    def _differs(self, i: int) -> bool:
        conserved = self.responses.num_conserved
        return self.sequences[i] != self.sequences[i - 1] or bool(conserved[i] != conserved[i - 1])

    def peak(self, observable: Given[str | None] = None) -> tuple[float, ForcedResponse]:
        """Frequency of the greatest amplitude of an observable, by default of the first one, and the
        response there; found between the points, to rounding. At a fold or a bound, the point."""
        name = self.observables[0] if observable is None else observable
        check_in("observable", name, self.observables)
        heights = np.nan_to_num(self.amplitude[name])
        top = int(np.argmax(heights))
        best = jax.tree.map(lambda leaf: leaf[top], self.responses)
        value = float(self.frequency[top])
        if top in (0, heights.size - 1):
            return value, best
        low, high = sorted(float(self.frequency[i]) for i in (top - 1, top + 1))
        if not low < value < high:
            return value, best

        beside = [jax.tree.map(lambda leaf, i=i: leaf[i], self.responses) for i in (top - 1, top + 1)]

        def found(at: float) -> ForcedResponse:
            return self.solver.nearest(at, [best, *beside])

        def height(at: Any) -> float:
            return float(np.nan_to_num(found(float(at)).amplitude[name]))

        rough: Any = minimize_scalar(
            lambda at: -height(at), bounds=(low, high), method="bounded",
            options={"xatol": ENGINE.same * (high - low)},
        )  # fmt: skip
        at = float(rough.x)
        # The top of a smooth curve is known to the root of rounding; the zero of its slope better.
        for part in (ACCURACY.swerves, ACCURACY.swerves**2):
            reach = min(at - low, high - at, part * (high - low))
            nodes = at + reach * np.cos(np.pi * (np.arange(9) + 0.5) / 9)
            heights = [height(node) for node in nodes]
            curve = Chebyshev.fit(nodes, heights, 6, domain=(at - reach, at + reach))
            zeros = [z.real for z in curve.deriv().roots() if abs(z.imag) < ENGINE.same * reach]
            polished = min(zeros, key=lambda z: abs(z - at), default=at)
            if height(polished) >= max(*heights, height(at)) * (1.0 - ENGINE.slack):
                at = float(polished)
        return at, found(at)

    def __len__(self) -> int:
        return self.frequency.size

    def __repr__(self) -> str:
        name = self.observables[0]
        top = int(np.argmax(np.nan_to_num(self.amplitude[name])))
        lines = [
            f"FrequencyResponse: {amount(len(self), 'motion')}, {int(np.sum(self.stable)):,} stable; "
            f"{self.solver.forcing.frequency} from {number(np.min(self.frequency))} to "
            f"{number(np.max(self.frequency))}, amplitude of {name} up to "
            f"{number(self.amplitude[name][top])} at {number(self.frequency[top])}"
        ]
        lines += [
            f"  {number(p.first)} to {number(p.last)}: {amount(p.num_events, 'event')}, {p.words}"
            for p in self.parts
        ]
        return "\n".join([*lines, *(f"  {special!r}" for special in self.specials)])

    def to_dataset(self) -> "xr.Dataset":
        """An `xarray.Dataset` along `point`: for each observable `<name>_amplitude`, `<name>_mean`,
        `<name>_lowest`, `<name>_highest`, `<name>_real` and `<name>_imag` of its harmonics along
        `harmonic`; `stable`, `num_events`, `num_conserved`, `flags`, `successful`; the frequency as
        coordinate.
        """
        import xarray as xr

        r = self.responses
        data: dict[str, Any] = {
            key: ("point", np.asarray(value)) for key, value in (
                ("stable", r.stable), ("num_events", r.num_events), ("num_conserved", r.num_conserved),
                ("flags", r.flags), ("successful", r.successful),
            )
        }  # fmt: skip
        for name, row in r.harmonics.items():
            for key, values in (
                ("amplitude", r.amplitude), ("mean", r.mean), ("lowest", r.lowest),
                ("highest", r.highest),
            ):  # fmt: skip
                data[f"{name}_{key}"] = "point", np.asarray(values[name])
            for key, part in (("real", np.real(row)), ("imag", np.imag(row))):
                data[f"{name}_{key}"] = ("point", "harmonic"), np.asarray(part)
        coordinates = {
            self.solver.forcing.frequency: ("point", self.frequency, {"units": "rad/s"}),
            "harmonic": np.arange(1, self.solver.forcing.harmonics + 1),
        }
        return xr.Dataset(data, coords=coordinates)


@showing("frequency_response")
def frequency_response(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    frequencies: Given[tuple[float, float]] | Row,
    forcing: Given[Forcing] = FORCING,
    *,
    observables: Given[str | Sequence[str] | Named | None] = None,
    follow: Given[Follow] = WIDE,
    shooting: Given[Shooting] = SHOOTING,
    args: PyTree = None,
) -> FrequencyResponse:
    r"""Response of a system to a periodic force over its frequency, through folds, events included.

    The response at the lowest frequency is that of `forced_response`, from the state `y0`; from there
    `continue_orbit` follows it to the highest one. Amplitudes are those of the motion itself, not of
    one harmonic, and harmonics are integrals over the motion: nothing is truncated or smoothed.

    While sliders stick all the time their places are free within limits, and the motion is one of a
    family. It is then the one whose sliders are where they were at the lowest frequency, which is
    where `y0` has them if they can stick there: with `y0 = 0` the response from the virgin state. Where
    they have slipped, they are where that left them. `parts` names these ranges.

    **Arguments**

    - `system`, `args`: as for `simulate`; `y0`: a state, most often at rest, at time 0.
    - `frequencies`: the lowest and the highest one, values of the parameter `forcing.frequency`; the
      points are then those of the branch. Of an increasing row of more than two the points are at these
      values, as many at each as the branch has there.
    - `forcing`: a `Forcing`: the parameter that is the frequency, the force, how many harmonics.
    - `observables`, `shooting`: as for `forced_response`.
    - `follow`: a `Follow` with the step along the branch; `both` is of no account.

    **Returns** a `FrequencyResponse`. Parts of the response that no branch joins with its beginning
    (isolas) are not found. Where the branch ends before the highest frequency its last `EP` says why.
    Several curves, over force, preload or friction, are several calls, which compile nothing anew;
    thousands of them at given frequencies are `map_lanes` of `forced_response`.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation; after it where there is
    no periodic response at the lowest frequency, or friction holds everything at rest there.
    """
    the_system(system)
    check_type("shooting", shooting, Shooting, "a Shooting")
    row = np.asarray(
        check_known("frequencies", one_row("frequencies", frequencies, "positive", 2)), float
    )
    check_increasing("frequencies", row)
    follow = dataclasses.replace(follow_of(follow, ((row[0], row[-1]),)), both=False)
    system, args = with_float_arrays((system, args))
    check_forcing(forcing, system)
    system = with_parameters(system, {forcing.frequency: jnp.asarray(row[0])})
    y0, mode0, found = start_and_observables(system, y0, None, args, forcing, observables)
    integrator = shooting.integrator_or()
    solver = Solver(system, args, integrator, forcing, found, shooting.max_events)
    first = solver(row[0], y0, mode0, 0.0, ACCURACY.tries)
    _check_first(first, row[0])
    period = 2.0 * np.pi / float(first.frequency)
    guess = OrbitGuess(first.y0, period, int(first.mode0), float(first.t0))
    branch = continue_orbit(
        system, guess, forcing.frequency, (row[0], row[-1]), forcing_period=forcing.rule, follow=follow,
        shooting=shooting, args=args,
    )  # fmt: skip
    values, sequences, responses = _along(solver, branch, row)
    stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *responses)
    return FrequencyResponse(np.asarray(values), stacked, branch, tuple(sequences), solver)


def _check_first(first: ForcedResponse, value: float) -> None:
    if not bool(first.successful):
        allowed = f"such that the motion at the first one becomes periodic: it is {first.result}"
        raise refusal("frequencies", value, allowed)
    if bool(first.at_rest):
        allowed = "such that something moves at the first one: friction holds everything at rest"
        raise refusal("frequencies", value, allowed)


def _along(
    solver: Solver, branch: Branch, row: np.ndarray
) -> tuple[list[float], list[tuple], list[ForcedResponse]]:
    """Values, sequences of modes and responses along a branch: at its points, or at those of a row."""

    orbits = [jax.tree.map(lambda leaf, i=i: leaf[i], branch.orbits) for i in range(len(branch))]
    values, sequences = [float(value) for value in branch.values], list(branch.sequences)
    if row.size == 2:
        found = [solver.beside(*both) for both in zip(values, orbits, strict=True)]
        return values, sequences, found
    for end, bound in ((0, row[0]), (-1, row[-1])):
        if abs(values[end] - bound) <= ENGINE.same * (row[-1] - row[0]):
            values[end] = float(bound)
    # Folds are ends of the pieces that are searched for values of the row.
    for special in reversed(branch["LP"]):
        for known, new in ((values, special.value), (orbits, special.orbit)):
            known.insert(special.index + 1, new)
        sequences.insert(special.index + 1, sequences[special.index])
    at: list[tuple[float, tuple, ForcedResponse]] = []
    for i in range(len(values) - 1):
        low, high = values[i], values[i + 1]
        last = i == len(values) - 2
        inside = [w for w in row if low <= w < high or high < w <= low or (last and w == high)]
        for w in sorted(inside, reverse=high < low):
            near, far = (i, i + 1) if abs(w - low) <= abs(w - high) else (i + 1, i)
            found = solver.nearest(w, [orbits[near], orbits[far]])
            # Between motions with different events it has those of either.
            same = int(found.num_events) == int(orbits[near].events.count)
            at.append((float(w), sequences[near if same else far], found))
    return [a[0] for a in at], [a[1] for a in at], [a[2] for a in at]
