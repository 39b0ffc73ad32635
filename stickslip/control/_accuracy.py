"""Numbers that decide in loops of controllers."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers that decide in loops of controllers; `ACCURACY` is the one object of this class."""

    same_sample: float = 1e-14
    """Part of a time: less apart, it is that of a sample, whose sum and product are rounded."""


ACCURACY = Accuracy()
