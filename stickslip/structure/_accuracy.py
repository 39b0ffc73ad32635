"""Numbers by which sliders are judged."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers that decide in this package; `ACCURACY` is the one object of this class."""

    at_limit: float = 1e-11
    """Part of the elongation, the position of the slider and its limit: a spring that is as near to its
    limit has reached it. Positions of sliders that moved come with the rounding of thousands of steps."""
    symmetric: float = 1e-9
    """Part of the largest entry by which a matrix and its transpose may differ: assembly and reduction
    leave some 1e-13, a mistake leaves more."""


ACCURACY = Accuracy()
