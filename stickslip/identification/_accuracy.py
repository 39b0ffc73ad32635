"""Numbers that decide in fits, profiles, designs and reports: our choice where no source is named."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Accuracy:
    """Thresholds and counts of the package, each with its unit, its meaning and where it comes from."""

    # [-] singular values of a sensitivity below this part of the largest are not seen by the data: the
    # Jacobians of runs with a tolerance of 1e-8 have some seven digits
    seen: float = 1e-7
    # [-] entries of a direction, a unit vector, below this belong to unknowns that are no part of it
    part: float = 1e-4
    # [-] reduced chi squared from which on a fit is said not to explain the data: twice the noise
    poor_fit: float = 4.0
    # [-] an estimate nearer to its bound than this part of its standard error, and of the distance
    # between the bounds, is at the bound; two sides of a jump enclose it, when all steps are spent, if
    # they are nearer than this part of the distance
    near: float = 0.01

    # Steps of a fit.
    # [-] part of the distance to a bound that a step leaves: Coleman and Li (1996) take 0.995 of it
    left_to_bound: float = 0.005
    # [-] distances from a single bound at which a step may end, in those at which it began
    away_from_bound: float = 10.0
    # [-, standard deviations] part of the largest sensitivity that stands for that of an unknown that
    # moves nothing, and change of the residuals by a coordinate that does not matter
    least_sensitivity: float = 1e-8
    # [-] combinations with a smaller part of the largest singular value stay where they are; as damping
    # of a step it is hardly any, and shows what is still to be gained
    rank: float = 1e-10
    # starts in one call of the program of many starts, from one size to the next; the fewest fill the
    # widest vector unit
    more_starts: int = 4

    # Profiles.
    # [-] distances, or sizes, up to which an unknown is followed: along a profile where it has no bound
    # on that side, and towards a bound under rounded friction, from which itself nothing returns
    reach: float = 1e3
    # points of a side that are kept
    profile_points: int = 40
    # [-] length of a step along a profile in that of the one before
    longest_step: float = 3.0
    # steps of the refit at one point
    refit_steps: int = 25
    # [-] of the level: what a linearised problem may still promise at the end of a refit that gains no
    # more; of any other one `ENGINE.zero`, and `ENGINE.rounding` at the minimum of all unknowns, from
    # which the interval is measured
    refit_at_rest: float = 1e-4
    # [-] of the root of the level: the end of an interval is found
    interval_end: float = 2e-8
    # [-] of the root of the level: next to the minimum rounding has a say in the slope of the rise
    next_to_minimum: float = 1e-3
    # [-] damping, in parts of the largest curvature, at which the search of the minimum ends
    most_damping: float = 1e12
    # [-] damping, in parts of the largest curvature, at which a refit has come to a jump
    halted: float = 1e2
    # steps of a refit whose linearised problem stays far above the level
    given_up: int = 2
    # [-] roots of the rise, in those of the level, up to which a refit may have ended outside
    near_outside: float = 1.5
    # sets of points around the one inside from which a refit begins anew, and points of a set
    probes: int = 6

    # Posterior.
    # [-] acceptance aimed at: kinks of the density at a changed mode sequence cost accuracy
    acceptance: float = 0.9
    # [standard errors] spread of the first points of the chains
    chain_spread: float = 0.5

    # Design of inputs.
    # [-] size of the first steps of the search, in parts of the limits
    design_step: float = 0.2

    # Stamps and signals.
    # modes that are asked for oscillations
    most_modes: int = 16
    # swings between two stamps from which on a record is said not to show them: Nyquist asks for 0.5
    most_swings: float = 2.0

    # Words and pictures.
    # [-] probability of the band of a correlation of noise
    band: float = 0.95
    # largest denominator of an exponent of a combination
    largest_denominator: int = 6


ACCURACY = Accuracy()
