"""Equilibria over a parameter as data: states in order, folds, Hopf points, a labelled Dataset."""

from typing import TYPE_CHECKING, Any

import equinox as eqx
import numpy as np
from jaxtyping import PyTree

from .._show import counted, html_table, number
from ..hybrid import AbstractHybridSystem
from ..hybrid.components import components_of

if TYPE_CHECKING:
    import xarray as xr


class EquilibriumPoint(eqx.Module):
    """A special point of equilibria: `label`, `value` of the parameter, state `y` in `mode`.

    `eigenvalues` [1/s] of the linear motion about it, fastest growth first. Of a Hopf point, `HB`:
    `period` [s] of the pair on the imaginary axis, and `swing`, the real part of its eigenvector as a
    flat state; otherwise NaN and zeros. `words`: why an `EP` is the end; of a point that was not
    located, such as `LP?`, up to which state it may lie, and `y` is the one before it. `system`: with
    the parameter at this value.
    """

    label: str
    value: float
    y: PyTree
    mode: int
    eigenvalues: np.ndarray
    period: float
    swing: np.ndarray
    words: str
    system: AbstractHybridSystem

    def __repr__(self) -> str:
        more = f", period {self.period:.10g} s" if self.label == "HB" else ""
        return f"{self.label} at {self.value:.10g}{more}{': ' * bool(self.words)}{self.words}"


class EquilibriumBranch(eqx.Module):
    """Equilibria over one parameter, in order along their branch.

    - `parameter`: its name; `values`, `[point]`; `mode`: in which the system rests.
    - `y`: states with a leading axis; `eigenvalues`, `[point, size]` [1/s], fastest growth first.
    - `specials`: `EquilibriumPoint`s, in order.
    """

    parameter: str
    values: np.ndarray
    mode: int
    y: PyTree
    eigenvalues: np.ndarray
    specials: tuple[EquilibriumPoint, ...]
    system: AbstractHybridSystem

    @property
    def stable(self) -> np.ndarray:
        """Whether all eigenvalues have negative real parts, `[point]`."""
        return np.all(np.real(self.eigenvalues) < 0.0, axis=1)

    def __getitem__(self, label: str) -> tuple[EquilibriumPoint, ...]:
        """All special points with a label."""
        return tuple(s for s in self.specials if s.label == label)

    def __len__(self) -> int:
        return self.values.size

    def __repr__(self) -> str:
        head = (
            f"EquilibriumBranch: {counted(len(self), 'state')}, {int(self.stable.sum()):,} stable; "
            f"{self.parameter} from {number(self.values.min())} to {number(self.values.max())}"
        )
        return "\n".join([head, *(f"  {special!r}" for special in self.specials)])

    def _repr_html_(self) -> str:
        rows = [(s.label, f"{s.value:.10g}", s.words) for s in self.specials]
        return html_table(repr(self).partition("\n")[0], ("label", self.parameter, ""), rows)

    def to_dataset(self) -> "xr.Dataset":
        """The branch as an `xarray.Dataset` along `point`, special points along `special`.

        The components of the state with their units, `stable`, `eigenvalue_real` and
        `eigenvalue_imag` [1/s] along `eigenvalue`, the parameter as coordinate; `label`,
        `special_<parameter>`, `special_period` [s] along `special`.
        """
        import xarray as xr

        units = getattr(self.system, "parameter_units", {})
        unit = {"units": units[self.parameter]} if self.parameter in units else {}
        rate = {"units": "1/s"}
        data: dict[str, Any] = {
            "stable": ("point", self.stable),
            "eigenvalue_real": (("point", "eigenvalue"), np.real(self.eigenvalues), rate),
            "eigenvalue_imag": (("point", "eigenvalue"), np.imag(self.eigenvalues), rate),
            "label": ("special", np.array([s.label for s in self.specials], dtype=str)),
            f"special_{self.parameter}": ("special", np.array([s.value for s in self.specials]), unit),
            "special_period": (
                "special", np.array([s.period for s in self.specials], float), {"units": "s"},
            ),
        }  # fmt: skip
        for name, leaf in components_of(self.y).items():
            axes = ["point", *(f"{name}_{k}" for k in range(np.ndim(leaf) - 1))]
            label = {"units": self.system.units[name]} if name in self.system.units else {}
            data[name] = axes, np.asarray(leaf), label
        return xr.Dataset(data, coords={self.parameter: ("point", self.values, unit)})
