"""A curve of special points over two parameters as data."""

from typing import TYPE_CHECKING, NamedTuple

import equinox as eqx
import jax
import numpy as np

from .._show import counted, html_table, number
from ..analysis.observable import with_parameters
from ..hybrid import AbstractHybridSystem
from ._branch import Special, column_of, labelled_states
from ._curve import Place
from ._follow import Point
from ._orbit import PeriodicOrbit

if TYPE_CHECKING:
    import xarray as xr


class CurvePoint(eqx.Module):
    """A special point on a curve: `label`, `values` of both parameters, `orbit`, in `words` what it is.

    `index`: number of the point of the curve before it. `system`: with both parameters at these values.
    """

    label: str
    values: np.ndarray
    orbit: PeriodicOrbit
    words: str
    index: int
    system: AbstractHybridSystem

    def __repr__(self) -> str:
        more = f": {self.words}" if self.words else ""
        return f"{self.label} at {self.values[0]:.10g}, {self.values[1]:.10g}{more}"


class CurveEnd(eqx.Module):
    """End of a curve: `values` of both parameters, the `orbit` there, and in `words` why it ends.

    `system`: with both parameters at these values.
    """

    values: np.ndarray
    orbit: PeriodicOrbit
    words: str
    system: AbstractHybridSystem

    def __repr__(self) -> str:
        return f"at {self.values[0]:.10g}, {self.values[1]:.10g}: {self.words}"


class BifurcationCurve(eqx.Module):
    """Special points of one kind over two parameters, in order along their curve.

    - `label`: as of a `BranchPoint`. `parameters`: names; `values`, `[point, 2]`.
    - `orbits`: a `PeriodicOrbit` with a leading axis, `[point]`.
    - `sequences`: the sequence of (guard, mode after) of each orbit, turned to its smallest form.
    - `ends`: first and last point with the reason, two `CurveEnd`s.
    - `specials`: `CurvePoint`s, in order along the curve.
    """

    label: str
    parameters: tuple[str, str]
    values: np.ndarray
    orbits: PeriodicOrbit
    sequences: tuple
    ends: tuple[CurveEnd, CurveEnd]
    system: AbstractHybridSystem
    specials: tuple[CurvePoint, ...] = ()

    def __getitem__(self, label: str) -> tuple[CurvePoint, ...]:
        """All special points with a label."""
        return tuple(s for s in self.specials if s.label == label)

    def __len__(self) -> int:
        return self.values.shape[0]

    def __repr__(self) -> str:
        low, high = self.values.min(axis=0), self.values.max(axis=0)
        over = ", ".join(
            f"{name} from {number(a)} to {number(b)}"
            for name, a, b in zip(self.parameters, low, high, strict=True)
        )
        head = f"BifurcationCurve of {self.label}: {counted(len(self), 'point')}; {over}"
        ends = [f"  ends {end!r}" for end in self.ends]
        return "\n".join([head, *(f"  {special!r}" for special in self.specials), *ends])

    def _repr_html_(self) -> str:
        marks = [(s.label, s) for s in self.specials] + [("end", e) for e in self.ends]
        rows = [(label, f"{m.values[0]:.10g}", f"{m.values[1]:.10g}", m.words) for label, m in marks]
        return html_table(repr(self).partition("\n")[0], ("", *self.parameters, ""), rows)

    def to_dataset(self) -> "xr.Dataset":
        """The curve as an `xarray.Dataset` along `point`.

        Both parameters (`parameter_<name>` for one with the name of another column), `period` [s],
        `multiplier_real` and `multiplier_imag` along `multiplier`, `num_events`, `sequence` (a number
        per mode sequence); `start_<name>`, `lowest_<name>` and `highest_<name>` as of a `Branch`;
        attributes `label`, `ends` and `specials`.
        """
        import xarray as xr

        orbits, units = self.orbits, getattr(self.system, "parameter_units", {})
        numbers = {s: k for k, s in enumerate(dict.fromkeys(self.sequences))}
        data = {
            "period": ("point", np.asarray(orbits.period), {"units": "s"}),
            "multiplier_real": (("point", "multiplier"), np.real(orbits.multipliers)),
            "multiplier_imag": (("point", "multiplier"), np.imag(orbits.multipliers)),
            "sequence": ("point", np.array([numbers[s] for s in self.sequences])),
            "num_events": ("point", np.asarray(orbits.events.count)),
            **labelled_states(orbits, self.system),
        }
        for i, name in enumerate(self.parameters):
            label = {"units": units[name]} if name in units else {}
            data[column_of(name, data)] = ("point", self.values[:, i], label)
        ends, specials = ([repr(mark) for mark in marks] for marks in (self.ends, self.specials))
        return xr.Dataset(data, attrs={"label": self.label, "ends": ends, "specials": specials})


class Half(NamedTuple):
    """Places of a curve to one side; the last point and why it is that; special points."""

    places: list[Place]
    end: tuple[Point, str]
    specials: list[Special]


def curve_of(
    label: str,
    parameters: tuple[str, str],
    halves: list[Half],
    system: AbstractHybridSystem,
) -> BifurcationCurve:
    """The curve of its halves, each from the same place; the second one backwards if there is one."""

    def there(point: Point) -> AbstractHybridSystem:
        return with_parameters(system, dict(zip(parameters, np.asarray(point.values), strict=True)))

    def special(mark: Special, index: int) -> CurvePoint:
        point = mark.point
        return CurvePoint(mark.label, point.values, point.orbit, mark.words, index, there(point))

    forward, *rest = halves
    points, end = [place.point for place in forward.places], forward.end
    first, specials, count = (points[0], "begins here"), [], 0
    if rest:
        (backward,) = rest
        first, count = backward.end, len(backward.places) - 1
        points = [place.point for place in backward.places[:0:-1]] + points
        specials = [special(m, max(count - m.index - 1, 0)) for m in backward.specials[::-1]]
    specials += [special(m, count + m.index) for m in forward.specials]
    orbits = jax.tree.map(lambda *leaves: np.stack(leaves), *(p.orbit for p in points))
    low, high = (CurveEnd(p.values, p.orbit, words, there(p)) for p, words in (first, end))
    return BifurcationCurve(
        label,
        parameters,
        np.stack([p.values for p in points]),
        orbits,
        tuple(p.sequence for p in points),
        (low, high),
        system,
        tuple(specials),
    )
