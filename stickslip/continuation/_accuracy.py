"""The numbers that decide in this package, each with its unit, its meaning and where it comes from.

Where no source is named a number is a choice: it was tried on the truths of the tests, which hold for
numbers several times larger and smaller.
"""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers of continuation; "parts" are parts of what is named behind them."""

    # Steps along a branch.
    shorter: float = 0.5  # factor of a step that failed, bends or leaps
    longer: float = 1.5  # factor of the step after one that succeeded
    quick: int = 4  # evaluations of Newton's method, after which the next step is longer
    bend: float = 0.9  # cosine of the angle between two tangents: sharper bends get shorter steps
    straight: float = 0.99  # the same: between two such orbits their branch is straight
    shortest: float = 2.0**-10  # part of a step below which it is not shortened for a bend
    patience: float = 2.0**-4  # part of a step that failed, down to which shorter ones are tried
    strays: float = 2.0  # steps, that an orbit may be from where it was expected
    swerves: float = 0.1  # of a step, that it may be, besides what the branch bends
    known: float = 1e-6  # of the motion's size: to which orbits are known
    looking: tuple[float, ...] = (2.0**-4, 2.0**-8, 2.0**-12)  # of a step: looked at behind a point
    # Events along a branch.
    zero: float = 1e-3  # of its larger value at the ends: a function that only jumps stays above this
    at_bound: float = 1e-6  # of the bounds' distance: an end no farther from a bound is at it
    least_round: int = 8  # points of a closed branch
    # Newton's method.
    integration: float = 1e-12  # relative, of the integrator of orbits where none is given


ACCURACY = Accuracy()
