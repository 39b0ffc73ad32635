"""Numbers that decide in maps of hunting."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers that decide in maps of hunting; `ACCURACY` is the one object of this class."""

    samples: int = 256
    """Of the motion in each of the two quarters of a run that are compared."""
    crossings: int = 256
    """Room for the crossings of the middle of the motion in the last quarter."""
    changes: float = 2.0
    """Ratio of the motion in the last quarter to that before: it has grown, or inverted, it decays."""


ACCURACY = Accuracy()
