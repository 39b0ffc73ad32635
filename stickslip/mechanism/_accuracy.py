"""Numbers by which contacts are judged; `ENGINE`'s say what counts as rounding, and as zero.

Entries of constant directions are typed, so that what depends on others does so to some 1e-16: parts
below `ENGINE.zero` are none, and entries of their inverses nearer than `ENGINE.slack` to a whole number
are that number.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Accuracy:
    """Thresholds of the package, each with its unit, its meaning and where it comes from."""

    # contacts of a group with dependent directions: tables over all 2^12 sets of them
    most_dependent: int = 12
    # pivots of that search, after which it has failed; random groups of twelve take some 30
    most_pivots: int = 128
    # pivots after which ten times as much is taken for rounding: ties of ill-conditioned inertia
    patience: int = 16
    # [-] of the speed that an overload of the size of rounding brings about: slower is at rest. Slower
    # than the speed of rest over this a planar contact slides along a load whose slope differs by less
    slow: float = 0.1
    # [-] a drive beyond this part of all that can be borne leaves no question of rest
    clearly: float = 2.0
    # derivatives by time of a speed that is zero at the start: from rest under a rising load about a
    # lever of zero it grows as t^3
    highest_rate: int = 3


ACCURACY = Accuracy()
