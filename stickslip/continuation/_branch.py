"""A branch of periodic orbits as data: orbits in order, special points, a labelled Dataset."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import numpy as np

from .._show import counted, html_table, number
from ..analysis.observable import with_parameters
from ..hybrid import AbstractHybridSystem
from ..hybrid.components import components_of
from ._along import Problem
from ._follow import Point
from ._orbit import PeriodicOrbit

if TYPE_CHECKING:
    import xarray as xr


@dataclasses.dataclass(frozen=True)
class Special:
    """A special point while the branch is followed: after which orbit it comes, and why."""

    label: str
    point: Point
    words: str
    index: int

    def at(self, index: int) -> "Special":
        """The same after another orbit."""
        return dataclasses.replace(self, index=index)


class BranchPoint(eqx.Module):
    """A special point of a branch: `label`, `value` of the parameter, `orbit`, and in `words` why.

    `index`: number of the orbit of the branch before it. `slope`: direction of the branch there, the
    rates of the first point, of the period if it is an unknown, and of the parameter. `system`: with
    the parameter at this value.
    """

    label: str
    value: float
    orbit: PeriodicOrbit
    words: str
    index: int
    slope: np.ndarray
    system: AbstractHybridSystem

    def __repr__(self) -> str:
        after = f": {self.words}" if self.words else ""
        return f"{self.label} at {self.value:.10g}{after}"


class Branch(eqx.Module):
    """Periodic orbits over one parameter, in order along the branch.

    - `parameter`: its name; `values`, `[point]`.
    - `orbits`: a `PeriodicOrbit` with a leading axis, `[point]`.
    - `sequences`: the sequence of (guard, mode after) of each orbit, turned to its smallest form.
    - `specials`: `BranchPoint`s, in order along the branch.
    """

    parameter: str
    values: np.ndarray
    orbits: PeriodicOrbit
    sequences: tuple
    specials: tuple[BranchPoint, ...]
    system: AbstractHybridSystem

    def __getitem__(self, label: str) -> tuple[BranchPoint, ...]:
        """All special points with a label."""
        return tuple(s for s in self.specials if s.label == label)

    def __len__(self) -> int:
        return self.values.size

    def __repr__(self) -> str:
        stable = int(np.sum(np.asarray(self.orbits.stable)))
        flagged = int(np.sum(np.asarray(self.orbits.flags) != 0))
        head = (
            f"Branch: {counted(len(self), 'orbit')}, {stable:,} stable; {self.parameter} from "
            f"{number(self.values.min())} to {number(self.values.max())}{self._free()}"
            f"{f'; derivative flags: {flagged:,} of the orbits' * (flagged > 0)}"
        )
        return "\n".join([head, *(f"  {special!r}" for special in self.specials)])

    def _free(self) -> str:
        """Along which components the place of the orbits is that of the first one."""
        words = jax.tree.map(lambda leaf: leaf[0], self.orbits).place.partition(",")[0]
        return f"; {words}" if words else ""

    def _repr_html_(self) -> str:
        head = repr(self).partition("\n")[0]
        rows = [(s.label, f"{s.value:.10g}", s.words) for s in self.specials]
        return html_table(head, ("label", self.parameter, ""), rows)

    def to_dataset(self) -> "xr.Dataset":
        """The branch as an `xarray.Dataset` along `point`, special points along `special`.

        `period` [s], `stable`, `multiplier_real` and `multiplier_imag` along `multiplier`,
        `start_<name>` (the state at the start of each orbit, with its unit), `lowest_<name>`,
        `highest_<name>` and `amplitude_<name>` (half their difference) over the period, `sequence` (a
        number per mode sequence), `mode_sequence` (its modes by name), `num_events` and the derivative
        `flags` of each orbit, the parameter as coordinate;
        `label`, `special_<parameter>`, `special_period`, `special_words` along `special`. A parameter
        with the name of one of these is called `parameter_<name>`.
        """
        import xarray as xr

        orbits = self.orbits
        units = getattr(self.system, "parameter_units", {})
        names = {s: k for k, s in enumerate(dict.fromkeys(self.sequences))}
        unit = {"units": units[self.parameter]} if self.parameter in units else {}
        data: dict[str, Any] = {
            "period": ("point", np.asarray(orbits.period), {"units": "s"}),
            "stable": ("point", np.asarray(orbits.stable)),
            "multiplier_real": (("point", "multiplier"), np.real(orbits.multipliers)),
            "multiplier_imag": (("point", "multiplier"), np.imag(orbits.multipliers)),
            "sequence": ("point", np.array([names[s] for s in self.sequences])),
            "mode_sequence": ("point", np.array([_modes(self.system, s) for s in self.sequences])),
            "num_events": ("point", np.asarray(orbits.events.count)),
            "flags": ("point", np.asarray(orbits.flags)),
            "label": ("special", np.array([s.label for s in self.specials], dtype=str)),
            "special_period": (
                "special", np.array([float(s.orbit.period) for s in self.specials]), {"units": "s"},
            ),
            "special_words": ("special", np.array([s.words for s in self.specials], dtype=str)),
            **labelled_states(orbits, self.system),
        }  # fmt: skip
        name = column_of(self.parameter, data)
        data[f"special_{name}"] = "special", np.array([s.value for s in self.specials], float), unit
        return xr.Dataset(data, coords={name: ("point", self.values, unit)})


def column_of(parameter: str, data: Mapping[str, Any]) -> str:
    """What a parameter is called beside the columns of a dataset, whose names and axes it may have."""
    axes = ("point", "special", "multiplier")
    free = parameter not in data and parameter not in axes and f"special_{parameter}" not in data
    return parameter if free else f"parameter_{parameter}"


def labelled_states(orbits: PeriodicOrbit, system: AbstractHybridSystem) -> dict[str, Any]:
    """Start, least and greatest values, amplitudes of orbits along `point`, with their units."""
    data = {}
    for prefix, tree in (("start", orbits.y0), ("lowest", orbits.lowest), ("highest", orbits.highest)):
        for name, leaf in components_of(tree).items():
            axes = ["point", *(f"{name}_{k}" for k in range(np.ndim(leaf) - 1))]
            label = {"units": system.units[name]} if name in system.units else {}
            data[f"{prefix}_{name}"] = (axes, np.asarray(leaf), label)
    for name in components_of(orbits.lowest):
        axes, low, label = data[f"lowest_{name}"]
        data[f"amplitude_{name}"] = (axes, 0.5 * (data[f"highest_{name}"][1] - low), label)
    return data


def _modes(system: AbstractHybridSystem, sequence: tuple) -> str:
    """Modes of a sequence by name, in the order in which they are entered."""
    # Without events the sequence is the one mode that there is.
    modes = [m[1] if isinstance(m, tuple) else m for m in sequence]
    return ", ".join(str(system.mode_names[mode]) for mode in modes)


def special_of(special: Special, problem: Problem, system: AbstractHybridSystem) -> BranchPoint:
    """A special point as users see it, of their system."""
    point = special.point
    states, scales = np.asarray(point.anchor.size).size, [np.asarray(point.anchor.size)]
    if problem.forcing_period is None:
        scales.append(np.asarray([float(point.anchor.period)]))
    scales.append(np.asarray(problem.unit))
    scale = np.concatenate(scales)
    slope = np.append(point.tangent[:states], point.tangent[states - scale.size :]) * scale
    there = with_parameters(system, {problem.names[0]: np.float64(point.value)})
    return BranchPoint(
        special.label, point.value, point.orbit, special.words, special.index, slope, there
    )


def branch_of(
    parameter: str,
    points: list[Point],
    specials: list[Special],
    system: AbstractHybridSystem,
    problem: Problem,
) -> Branch:
    """The branch of points in order."""
    orbits = jax.tree.map(lambda *leaves: np.stack(leaves), *(p.orbit for p in points))
    return Branch(
        parameter,
        np.array([p.value for p in points]),
        orbits,
        tuple(p.sequence for p in points),
        tuple(special_of(s, problem, system) for s in specials),
        system,
    )
