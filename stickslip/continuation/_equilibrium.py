"""An equilibrium: where the motion of a mode rests, and how stable it is there."""

from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import PyTree

from ..hybrid import AbstractHybridSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.components import components_of


class Equilibrium(eqx.Module):
    r"""A state at which a mode of a system rests, $f(y) = 0$; of a branch with a leading axis.

    - `y`: the state; `mode`: number of the mode.
    - `eigenvalues` [1/s], `[size]`: of the linear motion about it, fastest growth first.
    - `period` [s]: of the pair on the imaginary axis at a Hopf point or at flutter; otherwise NaN.
      `swing`, `[size]`: the real part of its eigenvector as a flat state; otherwise zeros.
    """

    y: PyTree
    mode: np.ndarray
    eigenvalues: np.ndarray
    period: np.ndarray
    swing: np.ndarray

    @property
    def lowest(self) -> PyTree:
        """Least values of the motion, which does not move: `y`; `highest` likewise."""
        return self.y

    @property
    def highest(self) -> PyTree:
        """Greatest values of the motion: `y`."""
        return self.y

    @property
    def stable(self) -> np.ndarray:
        """Whether all eigenvalues have negative real parts, beyond rounding: what nothing damps is
        not."""
        found = self.eigenvalues
        largest = np.max(np.abs(found), axis=-1, keepdims=True, initial=0.0)
        return np.all(np.real(found) < -ENGINE.some_roundings * largest, axis=-1)

    def columns(self, system: AbstractHybridSystem) -> dict[str, Any]:
        """Columns of a dataset along `point`: state, stability, eigenvalues."""
        # A state has its own units by name; eigenvalues mix them, and are rates in any.
        rate = {"units": "1/s"}
        data: dict[str, Any] = {
            "stable": ("point", self.stable),
            "eigenvalue_real": (("point", "eigenvalue"), np.real(self.eigenvalues), rate),
            "eigenvalue_imag": (("point", "eigenvalue"), np.imag(self.eigenvalues), rate),
        }
        for name, leaf in components_of(self.y).items():
            axes = ["point", *(f"{name}_{k}" for k in range(np.ndim(leaf) - 1))]
            label = {"units": system.units[name]} if name in system.units else {}
            data[name] = axes, np.asarray(leaf), label
        return data
