"""A branch as data: solutions in order, special points, a labelled Dataset."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import equinox as eqx
import jax
import numpy as np

from .._show import amount, html_table, number
from ..analysis.observable import with_parameters
from ..hybrid import AbstractHybridSystem
from ._equilibrium import Equilibrium
from ._family import AbstractFamily, Event
from ._orbit import PeriodicOrbit
from ._walk import Half

if TYPE_CHECKING:
    import xarray as xr

    Found: TypeAlias = Any  # who follows orbits need not say again that they are none but orbits
else:
    Found = PeriodicOrbit | Equilibrium


class BranchPoint(eqx.Module):
    """A special point of a branch: `label`, `values` of the parameters, and in `words` why or what.

    - `orbit`: a `PeriodicOrbit`, or an `Equilibrium`. Of a point that was not located, such as `LP?`,
      it is the one before it.
    - `index`: number of the point of the branch before it.
    - `slope`: direction of the branch there: of orbits the rates of the first point, of the period if
      it is an unknown, and of the parameter; of equilibria those of the state and of the parameter; of
      a curve those of its two parameters.
    - `system`: with the parameters at these values.
    """

    label: str
    values: np.ndarray
    orbit: Found
    words: str
    index: int
    slope: np.ndarray
    system: AbstractHybridSystem

    @property
    def value(self) -> float:
        """Value of the only parameter, or of the first one."""
        return float(self.values[0])

    def __repr__(self) -> str:
        period = isinstance(self.orbit, Equilibrium) and np.isfinite(self.orbit.period)
        more = f", period {float(self.orbit.period):.10g} s" if period else ""
        return f"{self.label} at {_list_text(self.values)}{more}{': ' * bool(self.words)}{self.words}"


class Branch(eqx.Module):
    """Periodic orbits or equilibria over one parameter, or special orbits over two, in order.

    - `parameters`: names; `values`, `[point]`, over two parameters `[point, 2]`.
    - `orbits`: a `PeriodicOrbit` or an `Equilibrium` with a leading axis, `[point]`.
    - `sequences`: the sequence of (guard, mode after) of each orbit, turned to its smallest form; of an
      equilibrium its mode.
    - `specials`: `BranchPoint`s, in order along the branch; the first and the last are its ends, `EP`,
      of a closed one only the last.
    - `label`: of a curve over two parameters that of its points, as of a `BranchPoint`.
    """

    parameters: tuple[str, ...]
    values: np.ndarray
    orbits: Found
    sequences: tuple
    specials: tuple[BranchPoint, ...]
    system: AbstractHybridSystem
    label: str = ""

    @property
    def parameter(self) -> str:
        """The only parameter, or the first one."""
        return self.parameters[0]

    @property
    def ends(self) -> tuple[BranchPoint, ...]:
        """Where and why it ends, on one side and the other."""
        return self["EP"]

    def __getitem__(self, label: str) -> tuple[BranchPoint, ...]:
        """All special points with a label."""
        return tuple(s for s in self.specials if s.label == label)

    def __len__(self) -> int:
        return self.values.shape[0]

    def __repr__(self) -> str:
        return "\n".join([self._head(), *(f"  {special!r}" for special in self.specials)])

    def _head(self) -> str:
        low, high = (np.atleast_1d(end(self.values, axis=0)) for end in (np.min, np.max))
        over = ", ".join(
            f"{name} from {number(a)} to {number(b)}"
            for name, a, b in zip(self.parameters, low, high, strict=True)
        )
        if self.label:
            return f"Branch of {self.label}: {amount(len(self), 'point')}; {over}"
        stable = int(np.sum(np.asarray(self.orbits.stable)))
        if isinstance(self.orbits, Equilibrium):
            return (
                f"Branch: {amount(len(self), 'equilibrium', 'equilibria')}, {stable:,} stable; {over}"
            )
        flagged = int(np.sum(np.asarray(self.orbits.flags) != 0))
        # Along which components the place of the orbits is that of the first one.
        free = jax.tree.map(lambda leaf: leaf[0], self.orbits).place.partition(",")[0]
        return (
            f"Branch: {amount(len(self), 'orbit')}, {stable:,} stable; {over}{'; ' * bool(free)}{free}"
            f"{f'; derivative flags: {flagged:,} of the orbits' * (flagged > 0)}"
        )

    def _repr_html_(self) -> str:
        rows = [(s.label, *(f"{v:.10g}" for v in s.values), s.words) for s in self.specials]
        return html_table(self._head(), ("label", *self.parameters, ""), rows)

    def to_dataset(self) -> "xr.Dataset":
        """The branch as an `xarray.Dataset` along `point`, special points along `special`.

        Of orbits `period` [s], `stable`, `multiplier_real` and `multiplier_imag` along `multiplier`,
        `start_<name>` (the state at the start of each orbit, with its unit), `lowest_<name>`,
        `highest_<name>` and `amplitude_<name>` (half their difference) over the period, `sequence` (a
        number per mode sequence), `mode_sequence` (its modes by name), `num_events` and the derivative
        `flags` of each orbit; of equilibria the components of the state, `stable`, `eigenvalue_real`
        and `eigenvalue_imag` [1/s] along `eigenvalue`. The parameter is a coordinate, two are columns;
        `label`, `special_<parameter>`, `special_period` [s], `special_words` along `special`. A
        parameter with the name of one of these is called `parameter_<name>`.
        """
        import xarray as xr

        units = getattr(self.system, "parameter_units", {})
        marks = self.specials
        periods = np.array([float(s.orbit.period) for s in marks], float)
        data: dict[str, Any] = {
            **self.orbits.columns(self.system),
            **self._sequences(),
            "label": ("special", np.array([s.label for s in marks], dtype=str)),
            "special_period": ("special", periods, {"units": "s"}),
            "special_words": ("special", np.array([s.words for s in marks], dtype=str)),
        }
        coordinates, columns = {}, self.values.reshape(len(self), -1).T
        for i, (name, column) in enumerate(zip(self.parameters, columns, strict=True)):
            unit = {"units": units[name]} if name in units else {}
            own = column_of(name, data)
            places = np.array([s.values[i] for s in marks], float)
            data[f"special_{own}"] = "special", places, unit
            coordinates[own] = "point", column, unit
        if len(self.parameters) > 1:
            return xr.Dataset({**data, **coordinates}, attrs={"label": self.label})
        return xr.Dataset(data, coords=coordinates)

    def _sequences(self) -> dict[str, Any]:
        if isinstance(self.orbits, Equilibrium):
            return {}
        names = {s: k for k, s in enumerate(dict.fromkeys(self.sequences))}
        modes = [_modes(self.system, s) for s in self.sequences]
        return {
            "sequence": ("point", np.array([names[s] for s in self.sequences])),
            "mode_sequence": ("point", np.array(modes)),
        }


def _list_text(values: np.ndarray) -> str:
    return ", ".join(f"{value:.10g}" for value in values)


def column_of(parameter: str, data: Mapping[str, Any]) -> str:
    """Name of a parameter beside the columns of a dataset, whose names and axes it may have."""
    axes = ("point", "special", "multiplier")
    free = parameter not in data and parameter not in axes and f"special_{parameter}" not in data
    return parameter if free else f"parameter_{parameter}"


def _modes(system: AbstractHybridSystem, sequence: tuple) -> str:
    """Modes of a sequence by name, in the order in which they are entered."""
    # Without events the sequence is the one mode that there is.
    modes = [m[1] if isinstance(m, tuple) else m for m in sequence]
    return ", ".join(str(system.mode_names[mode]) for mode in modes)


def branch_of(
    family: AbstractFamily, half: Half, system: AbstractHybridSystem, label: str = ""
) -> Branch:
    """The branch of points in order, of the system as users know it."""
    names = family.names
    orbits = [family.orbit(point) for point in half.points]
    values = np.stack([np.asarray(point.values, float) for point in half.points])

    def special(event: Event) -> BranchPoint:
        at = np.array(event.point.values, float)
        there = with_parameters(system, dict(zip(names, map(np.float64, at), strict=True)))
        orbit, slope = family.orbit(event.point, event.label), family.slope(event.point)
        return BranchPoint(event.label, at, orbit, event.words, event.index, slope, there)

    return Branch(
        names, values if len(names) > 1 else values[:, 0],
        jax.tree.map(lambda *leaves: np.stack(leaves), *orbits),
        tuple(family.sequence(point) for point in half.points),
        tuple(special(event) for event in half.events), system, label,
    )  # fmt: skip
