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

    # Newton's method for orbits, and their equations.
    # Part of the strongest direction: the residual does not see weaker ones
    newton_neutral: float = 1e-12
    newton_shortest: float = 2.0**-10  # part of a step: shorter ones are not tried
    newton_stalled: float = 1e3  # tolerances: a residual that stops falling below so many is an end
    newton_nearly: float = 10.0  # tolerances, up to which few shorter steps are tried
    newton_tried: float = 0.25  # part of a step, down to which they are
    evaluations: int = 10  # of Newton's method at one point of a branch
    near_start: float = 0.02  # of the period: an event as near to the start moves the start
    samples: int = 64  # of a period, at which the size of each component is read off
    turning: float = 0.1  # of its mean speed: an angle that turns so fast shows the place on the orbit
    swings: float = 1e-6  # of its values: what else moves by this part swings
    swings_back: float = 0.5  # of that: it comes back to this part
    keeps: float = 1e-6  # of the growth of deviations in a piece: the most that changes a neutral shift
    turns_rounding: float = 256 * 2.0**-52  # of a number: what differs by less is the same
    turns_as_near: float = 1e-6  # squares of turns: of counts that leave the same the first is taken
    settling_evaluations: int = 10  # of Newton's method for an equilibrium that is near
    # Of what is missing to a closed motion, that the linear one does not explain
    settling_nonlinear: float = 0.1
    # One orbit and its multipliers.
    return_as_near: float = 3.0  # factor: returns whose distances differ by less are equally good
    return_near: float = 1e-6  # of the motion's size: a return as near is one in any case
    guess_samples: int = 256  # of the time in which a return is looked for
    rough: float = 1e-10  # relative, of the integrator of a guess where none is given
    shrunk: float = 1e-9  # of the motion's size at the guess: a smaller motion is an equilibrium
    closes: float = 1e-8  # times the growth of deviations: an orbit simulated once more returns to this
    closes_at_most: float = 1e-2  # of the size: to this at the least, however unstable it is
    apart: float = 1e-5  # of the size: states farther from each other are not the same again
    between: float = 0.381966  # of a part of the period: where what acts is compared a period later
    asked_beside: float = 0.37  # of the motion's size: states that are asked too
    recurs: float = 1e-7  # of the largest field and guard: a larger change is another forcing
    parts: int = 60  # of the period, at which the motion is compared with its start
    drifts: float = 1e-9  # of what the component moves through: less is rounding
    # Of the largest singular value: what an event projects out is rounding
    lost_direction: float = 1e-12
    lost_at_event: float = 1e-9  # the same for the jump at one event
    # Of its length: a constraint that the others leave no more of is one of them
    dependent: float = 1e-9
    held: float = 1e-11  # of the sizes: numbers that are zero but for rounding
    extremes_block: int = 32  # steps that are looked at side by side for extremes
    extremes_longer: float = 2.0  # times the last one: the next part of a motion with more steps
    extremes_evaluations: int = 6  # of the motion near an extreme; each squares the error
    # Of a component's magnitude: extremes that differ by less are equal
    extremes_rounding: float = 1e-14
    # Orbits along a branch, their borders and ends.
    shrinks: float = 0.3  # of the motion's extent: the most that one step changes it
    at_rest: float = 1e-4  # of its largest extent on the branch: a motion as small is a rest
    near_border: float = 2.0  # of what is left of the step: the next orbit beyond a border is as near
    apart_from_border: float = 0.01  # of the step: or as near as this
    sparse: float = 0.25  # of the step: orbits from a border to a distant one so far apart are all kept
    reach: float = 1e-3  # so far at least the last orbit of the other side is looked for
    same: float = 1e-3  # of the step: a fold so near to a branch point is that point
    bound_rounds: int = 12  # in which the orbit at a bound is approached
    stuck: float = 1e-7  # of the step: a branch that goes on by less ends
    halved: float = 2.0**-24  # of the distance, to which the search for a border is halved
    border_rounds: int = 12  # how often that search begins again
    further: float = 1e-13  # of the distance: it goes on if it gains more
    bends: float = 0.5  # of the distance: orbits farther from the straight line are of another branch
    # Of its size, that a multiplier or eigenvalue beside the real axis is from it
    off_axis: float = 1e-9
    # Of the motion's size: how far from a border motions are looked at
    corner_beside: tuple[float, ...] = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
    # How far the first orbit beyond is from the border
    corner_beyond: tuple[float, ...] = (1e-4, 1e-3, 1e-2, 1e-5)
    corner_farthest: float = 10.0  # moves, that it is from the border
    touches_border: float = 1e-4  # a branch that leads back as near meets the border
    connected: float = 0.3  # or as near as this part of what it was away
    steps_back: int = 60  # at most, that lead back to a border
    halvings: int = 4  # of a step back
    # How far beside an orbit that touches a guard motions have other events
    touching: tuple[float, ...] = (1e-9, 1e-8, 1e-7, 1e-6)
    jumps: float = 1e-9  # of the motion's size: a larger jump of the state is an impact
    most_events: int = 64  # in which the events that are new are looked for
    # Of the step, of the nodes around a zero at a branch point
    widths: tuple[float, ...] = (0.08, 0.16, 0.03)
    branching_rounds: int = 4  # how often the zero is searched anew from what was found
    branching_astray: float = 0.05  # of the step: orbits farther from the cubic are of another branch
    branching_agree: float = 1e-6  # of the step: by which two polynomials may place the zero apart
    branching_closes: float = 1e-9  # of the motion's size: the orbit between the nodes closes to this
    hopf_secants: int = 30  # to the Hopf point at which a branch ends
    hopf_nearly: float = 1e-14  # of the bounds' distance: a secant as short is the last
    # Of the period: how far the Hopf point's period may be from that of the last orbit
    hopf_near: float = 0.3
    endless_doubled: float = 2.0  # factor of the period over which its law is read off
    endless_least: int = 5  # steps, at least, within it
    endless_unexplained: float = 0.02  # of what the rate changes by: what the law may leave
    endless_off: float = 0.15  # by which the power of the period may differ from that of the law
    endless_steep: float = 4.0  # power of the period that an exponential law has at least
    endless_resolved: float = 1e-6  # of the bounds' distance: so near to its limit a branch is at it
    endless_rounding: float = 1e-12  # of the bounds' distance: how well the parameter is known
    alike: float = 1e-3  # of their size, by which the ends of one motion differ at other instants
    family_singular: float = 1e-9  # of the derivative: below it orbits are a family
    vertical: float = 1e-7  # rate of the parameter, below which they are one at one value of it
    aside: float = 1e-2  # how far away that is looked at too
    # From a special point to another branch.
    # Of the motion's size: first amplitudes that are tried
    amplitudes: tuple[float, ...] = (1e-2, 3e-3, 3e-2, 1e-3, 3e-4, 1e-4)
    # Of the amplitude at a Hopf point that are tried
    birth_parts: tuple[float, ...] = (1.0, 0.3, 3.0, 0.1, 10.0, 0.03, 0.01)
    birth_smaller: int = 4  # how often smaller ones are
    birth_aside: float = 0.01  # of the bounds' distance: how far the orbit may be from the Hopf point
    birth_late: float = 0.1  # of the period: how far its period may be from there
    nonlinear: float = 1e-2  # part of the linear field that the rest of the field is at that amplitude
    around_ellipse: int = 16  # points of the linear orbit at which it is measured
    decades: int = 25  # of sizes that are tried, up and down
    motionless: float = 1e-9  # of the largest: components that move by less do not take part
    birth_halved: int = 6  # times, a step in search of the orbit that is doubled
    doubling_secants: int = 25  # to its doubling
    doubling_first: float = 1e-4  # of the motion's size: the first secant
    doubling_nearly: float = 1e-12  # the same: the last one
    doubling_reach: float = 0.1  # the same: how far away the doubling may be
    # Curves of special points over two parameters.
    slope: float = 1e-4  # of the motion's size: slopes of a test are differences over this
    curve_secants: int = 12  # at most, to the curve
    curve_nearly: float = 1e-13  # of the size: a secant as short ends the search
    curve_last: float = 1e-9  # of the step: how exactly the end of a curve is known
    curve_nearer: float = 2.0**-6  # by which the end is nearer in each round
    curve_rounds: int = 10  # in which the end of a curve is searched anew
    chord: float = 1e-5  # of the size: shorter chords have no direction
    # Of the step: how far beside a border orbits are looked for
    inside: tuple[float, ...] = (0.0, 0.02, 0.1, 0.5, 2.0)
    inside_near: float = 1.0  # of the way to them, that they are from where they are expected
    around: int = 16  # directions in which they are looked for at first
    # Of the motion's size: how far beyond a border its other sequence is looked for
    outside: tuple[float, ...] = (1e-9, 1e-8, 1e-7)
    # The same around a corner, for all sequences that there are
    nearby: tuple[float, ...] = (1e-6, 1e-5, 1e-4)
    # Of the first parameter's bounds: where a border's curve may begin
    begin_beside: tuple[float, ...] = (1e-10, 1e-9, 1e-8, 1e-7, 1e-6)
    # Equilibria; all sizes are independent of units.
    rest_bend: float = 0.32  # rad, between two tangents: sharper bends get shorter steps
    rest_shortest: float = 2.0**-12  # of a step
    rest_known: float = 1e-9  # of the sizes: to which equilibria are known
    rest_astray: float = 0.9  # of a component's move: largest deviation from what the tangents predict
    double: float = 1e-7  # of the largest singular value: no step ends as near to a branch point
    away_from_double: float = 0.8  # factor of a step that did
    double_nearer: int = 30  # halvings in the search for a branch point
    double_evaluations: int = 20  # of Newton's method for it
    double_close: float = 1e-13  # of the sizes: a step as short is the last
    double_null: float = 1e-9  # of the defect of an equation at a solution
    level: float = 1e-5  # rate of the parameter along the branch, at a branch point where it turns
    rest_evaluations: int = 20  # of Newton's method
    rest_close: float = 1e-13  # of the sizes: a step as short ends it
    rest_rounding: float = 1e-9  # or one no shorter than the one before and below this
    rest_waits: int = 8  # evaluations after which components that do not move are not waited for
    nothing: float = 1e-12  # of the largest: parts of a tangent that are rounding
    still: float = 1e-10  # of what the others let expect: a component that moved by less has not moved
    steady: float = 1e-9  # of its own value: the same
    tiny: float = 1e-10  # entries of a balanced matrix that are left out
    rest_singular: float = 1e-11  # of the largest: smaller singular values are zero
    slack: float = 1e-12  # of the bounds' distance: as far outside of them is rounding
    first_tries: int = 16  # of a first step
    first_ladder: int = 30  # of first sizes, up and down
    first_step: float = 0.02  # of the bounds' distance: the first step


ACCURACY = Accuracy()
