"""The noise of a motion and of its measurements."""

from collections.abc import Mapping

import equinox as eqx
import jax
from jaxtyping import Array, Float, PyTree

from .._types import Given, Numeric
from .._validation import (
    as_parameter,
    check_mapping,
    check_nonnegative,
    leaves_of,
    one_number,
    refusal,
)


class Noise(eqx.Module):
    r"""White noise of measurements, and of the rates of the state.

    **Arguments**

    - `measured`: standard deviation of each quantity that is measured, by name, positive.
    - `process`: a state of the densities $d_i$, not negative, by which components wander: within a
      time $T$ the rate of component $i$ adds the variance $d_i^2T$ to it [unit of it per root of s];
      `None` for none. Intensities are the squares. A mode keeps to what it allows: the speed
      of a contact that sticks does not wander.

    White noise in a speed is a force without a bound, which no contact could hold for any time; the
    filter lets it act on what slips and not on guards. A disturbance that breaks contacts loose is a
    state of the system, whose rate has the noise.

    **Raises** `TypeError`, `ValueError` for anything else.
    """

    measured: dict[str, Float[Array, ""]]
    process: PyTree

    def __init__(self, measured: Given[Mapping[str, Numeric]], process: PyTree = None):
        found = check_mapping("measured", measured)
        if not found:
            raise refusal("measured", measured, "a mapping from names to numbers, not empty")
        for name, sd in found.items():
            one_number(f"measured[{name!r}]", sd, "positive")
        for where, density in leaves_of("process", process):
            check_nonnegative(where, density)
        self.measured = {name: as_parameter(sd) for name, sd in found.items()}
        self.process = jax.tree.map(as_parameter, process)
