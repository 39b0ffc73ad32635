"""The noise of a motion and of its measurements."""

from collections.abc import Mapping

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from .._types import Given, Numeric
from .._validation import as_float64, as_parameter, check_mapping, one_number, refusal
from ._gaussian import check_not_negative


class Noise(eqx.Module):
    r"""White noise of measurements, and of the rates of the state.

    **Arguments**

    - `measured`: standard deviation of each quantity that is measured, by name, positive.
    - `process`: a state of densities $d_i$, not negative, or `None`: within a time $T$ component $i$
      wanders by a standard deviation of $d_i\sqrt T$. A mode keeps to what it allows: the speed of a
      contact that sticks does not wander.

    White noise in a speed is a force without a bound, which no contact holds for any time: the filter
    lets it act on what slips, and not on guards. A disturbance that breaks contacts loose is a state
    of the system, whose rate has the noise.

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
        self.measured = {name: as_parameter(sd) for name, sd in found.items()}
        self.process = check_not_negative("process", as_float64("process", process))
