"""A curve of special points over two parameters as data."""

from typing import TYPE_CHECKING

import equinox as eqx
import jax
import numpy as np

from .._show import counted, html_table, number
from ..hybrid import AbstractHybridSystem
from ._branch import column_of, labelled_states
from ._curve import Place
from ._follow import Point
from ._orbit import PeriodicOrbit

if TYPE_CHECKING:
    import xarray as xr


class CurveEnd(eqx.Module):
    """End of a curve: `values` of both parameters, the `orbit` there, and in `words` why it ends."""

    values: np.ndarray
    orbit: PeriodicOrbit
    words: str

    def __repr__(self) -> str:
        return f"at {self.values[0]:.10g}, {self.values[1]:.10g}: {self.words}"


class BifurcationCurve(eqx.Module):
    """Special points of one kind over two parameters, in order along their curve.

    - `label`: as of a `BranchPoint`. `parameters`: names; `values`, `[point, 2]`.
    - `orbits`: a `PeriodicOrbit` with a leading axis, `[point]`.
    - `sequences`: the sequence of (guard, mode after) of each orbit, turned to its smallest form.
    - `ends`: first and last point with the reason, two `CurveEnd`s.
    """

    label: str
    parameters: tuple[str, str]
    values: np.ndarray
    orbits: PeriodicOrbit
    sequences: tuple
    ends: tuple[CurveEnd, CurveEnd]
    system: AbstractHybridSystem

    def __len__(self) -> int:
        return self.values.shape[0]

    def __repr__(self) -> str:
        low, high = self.values.min(axis=0), self.values.max(axis=0)
        over = ", ".join(
            f"{name} from {number(a)} to {number(b)}"
            for name, a, b in zip(self.parameters, low, high, strict=True)
        )
        head = f"BifurcationCurve of {self.label}: {counted(len(self), 'point')}; {over}"
        return "\n".join([head, *(f"  ends {end!r}" for end in self.ends)])

    def _repr_html_(self) -> str:
        rows = [(f"{e.values[0]:.10g}", f"{e.values[1]:.10g}", e.words) for e in self.ends]
        return html_table(repr(self).partition("\n")[0], (*self.parameters, "end"), rows)

    def to_dataset(self) -> "xr.Dataset":
        """The curve as an `xarray.Dataset` along `point`.

        Both parameters (`parameter_<name>` for one with the name of another column), `period` [s],
        `multiplier_real` and `multiplier_imag` along `multiplier`, `num_events`, `sequence` (a number
        per mode sequence); `start_<name>`, `lowest_<name>` and `highest_<name>` as of a `Branch`;
        attributes `label` and `ends`.
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
        ends = [repr(end) for end in self.ends]
        return xr.Dataset(data, attrs={"label": self.label, "ends": ends})


def curve_of(
    label: str,
    parameters: tuple[str, str],
    halves: list[tuple[list[Place], tuple[Point, str]]],
    system: AbstractHybridSystem,
) -> BifurcationCurve:
    """The curve of its halves, each from the same place; the second one backwards if there is one."""
    (forward, end), *rest = halves
    points = [place.point for place in forward]
    first = points[0], "begins here"
    if rest:
        ((backward, first),) = rest
        points = [place.point for place in backward[:0:-1]] + points
    orbits = jax.tree.map(lambda *leaves: np.stack(leaves), *(p.orbit for p in points))
    low, high = (CurveEnd(p.values, p.orbit, words) for p, words in (first, end))
    return BifurcationCurve(
        label,
        parameters,
        np.stack([p.values for p in points]),
        orbits,
        tuple(p.sequence for p in points),
        (low, high),
        system,
    )
