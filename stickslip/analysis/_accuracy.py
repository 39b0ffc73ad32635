"""Numbers that decide in analyses; what counts as rounding, and as zero, the engine's numbers say."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers that decide in analyses; `ACCURACY` is the one object of this class."""

    small: float = 0.05
    """Part of the size of the motion: a smaller distance is small. A smaller difference is a step of an
    approach, not a jump on an attractor."""
    unchanged: float = 1e-7
    """Part of the largest derivative: along a shift of less, it may be that nothing changes. Nothing
    does that changes by less than this part of the largest value along the motion, and components
    with less of a shift have no part in it."""
    shifts: tuple[float, ...] = (0.37, -31.7, 1234.5)
    """Sizes of the motion by which a state is shifted to see whether anything changes."""
    samples: int = 64
    """Of the motion, of which it is asked whether a shift of its states changes anything."""
    fewest_samples: int = 8
    """Of a motion whose extent says anything."""
    side_by_side: int = 512
    """Transitions that are tried, and lanes of a block of a diagram: so few that the check can run the
    same program on as many."""
    with_tangents: int = 64
    """Lanes of a block where each is a motion with all its tangents."""
    open_leaves: int = 4
    """Leaves that may be read in two ways, all ways of reading which are tried."""


ACCURACY = Accuracy()
