"""Numbers by which contacts are judged: what counts as rounding, as vanishing, as dependent."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Accuracy:
    """Thresholds of the package, each with its unit, its meaning and where it comes from."""

    # [-] of the terms of a sliding speed or a gap: eight units of rounding of a double
    rounding: float = 8 * 2.3e-16
    # [-] of the largest entry: zero in computations with constant directions (their entries are
    # typed, so that what depends does so to some 1e-16)
    direction: float = 1e-9
    # [-] entries of null spaces and inverses closer to a whole number than this are that number
    whole: float = 1e-12
    # [-] of the largest entries of a column: a pivot of a null space below it is zero
    pivot: float = 1e-10
    # [-] of their terms: constant inertia between speeds along contacts that vanishes
    inertia: float = 1e-12
    # contacts of a group with dependent directions: tables over all 2^12 sets of them
    most_dependent: int = 12
    # [N, 1/kg] nothing, but a number to divide by; its square is a number too, for derivatives
    nothing: float = 1e-150
    # [-] part of a diagonal entry that elimination leaves of a row that depends on those before it
    dependent_row: float = 1e-12
    # [-] part of its terms to which the side of such a row agrees with that of the others
    agreeing_row: float = 1e-9
    # [-] a share of friction, or of what surfaces that part bear, beyond it says no more
    most_share: float = 1e6
    # [-] of all forces: overloads below it are rounding in the search for what slides
    slack: float = 1e-11
    # pivots of that search, after which it has failed; random groups of twelve take some 30
    most_pivots: int = 128
    # pivots after which ten times as much is taken for rounding: ties of ill-conditioned inertia
    patience: int = 16
    # [-] of the speed that an overload of the size of rounding brings about: slower is at rest
    slow: float = 0.1
    # [-] part of the static friction that a law may lose by rounding as it begins to slide
    no_drop: float = 1e-13
    # [-] a drive beyond this part of all that can be borne leaves no question of rest
    clearly: float = 2.0
    # [-] of all forces: what surfaces that part would have to bear against each other
    apart: float = 1e-9
    # derivatives by time of a speed that is zero at the start: from rest under a rising load about a
    # lever of zero it grows as t^3
    highest_rate: int = 3
    # [-] of the velocities: a contact said to stick that is faster than this slides; of the places:
    # a stop said to be closed whose gap is larger is not met
    slides: float = 1e-6
    # [m/s, m] slower or closer than it is rounding at rest
    rests: float = 1e-12


ACCURACY = Accuracy()
