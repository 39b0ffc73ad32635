"""Dimensional and dimensionless quantities of a beam."""

from typing import Any, ClassVar

import jax
from jaxtyping import Array, Float

from .._argument_checks import parameters
from .._show import AbstractShown
from ..friction.law import Number

# Of a jointed beam with dimensions.
PARAMETER_UNITS = {
    "m": "kg", "k1": "N/m", "k2": "N/m", "k3": "N/m", "mu_s": "1", "gamma": "s/m", "v": "m/s",
    "z_A": "m", "damping": "1",
}  # fmt: skip


class BeamScales(AbstractShown):
    r"""Scales that turn dimensional quantities of a beam into dimensionless ones, Eq. (2.9).

    With $\alpha_1 = EI$, $\alpha_2 = L$, $\alpha_3 = \rho A$ as units, a dimensionless quantity is the
    dimensional one divided by

    | quantity | unit | |
    |---|---|---|
    | time | $L^2\sqrt{\rho A/EI}$ | [s] |
    | length $x, y, w$ | $L$ | [m] |
    | speed | $\sqrt{EI/\rho A}/L$ | [m/s] |
    | mass | $\rho A L$ | [kg] |
    | stiffness | $EI/L^3$ | [N/m] |
    | force | $EI/L^2$ | [N] |
    | energy | $EI/L$ | [J] |
    | power | $\sqrt{EI/\rho A}\,EI/L^3$ | [W] |

    and $\gamma^* = \gamma\sqrt{EI/\rho A}/L$.

    **Arguments:** `EI` [N m^2], `L` [m], `rhoA` [kg/m], positive. **Errors** `ValueError` otherwise.

    ??? cite "Reference"

        *Non-linear Dynamics of Jointed Systems Under Dry Friction Forces*, Eq. (2.9).
    """

    EI: Float[Array, "..."]
    L: Float[Array, "..."]
    rhoA: Float[Array, "..."]

    parameter_units: ClassVar = {"EI": "N m2", "L": "m", "rhoA": "kg/m"}

    @parameters(EI="positive", L="positive", rhoA="positive")
    def __init__(self, EI: Number = 1.0, L: Number = 1.0, rhoA: Number = 1.0):
        pass

    @property
    def length(self) -> Float[Array, "..."]:
        """Unit of length [m]."""
        return self.L

    @property
    def speed(self) -> Float[Array, "..."]:
        """Unit of speed [m/s]."""
        return jax.lax.sqrt(self.EI / self.rhoA) / self.L

    @property
    def time(self) -> Float[Array, "..."]:
        """Unit of time [s]."""
        return self.L / self.speed

    @property
    def mass(self) -> Float[Array, "..."]:
        """Unit of mass [kg]: that of the beam."""
        return self.rhoA * self.L

    @property
    def stiffness(self) -> Float[Array, "..."]:
        """Unit of stiffness [N/m]."""
        return self.EI / (self.L * self.L * self.L)

    @property
    def force(self) -> Float[Array, "..."]:
        """Unit of force [N]."""
        return self.stiffness * self.L

    @property
    def energy(self) -> Float[Array, "..."]:
        """Unit of energy [J]."""
        return self.force * self.L

    @property
    def power(self) -> Float[Array, "..."]:
        """Unit of power [W]."""
        return self.force * self.speed


def times_scale(state: Any, scales: BeamScales, power: int) -> Any:
    """State whose lengths and speeds are multiplied by their units to the `power` +1 or -1."""

    units = (scales.length, scales.speed) * 3  # of a place and its rate in turn
    pairs = zip(state, units, strict=True)
    return type(state)(*(a * unit if power > 0 else a / unit for a, unit in pairs))
