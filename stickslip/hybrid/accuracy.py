"""Numbers that decide in the engine, each with its unit and its meaning, chosen by us unless said.

None is an option: tolerances that users choose are those of `Integrator` and `AdaptiveStep`. "Part" is
a ratio without a unit.
"""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers that decide in the engine; `ACCURACY` is the one object of this class."""

    # Location of events and sections.
    solved: float = 1e-11
    """Part of the full step: an event whose last Newton correction is this small is accepted. The
    correction is applied, so that its square is the error of the location. Part of the motion to which
    stage equations of implicit methods are solved where no tolerance says it. Part of all forces:
    overloads below it are rounding in the search for what slides."""
    bisect_every: int = 8
    """Tries between two bisections: steep on one side, flat on the other, interpolation may creep."""
    reach: float = 1e-3
    """Part of the step to an event that the last Newton correction may be; a step that ends beyond a
    zero by less of slope times step ends on it."""
    crossing_tries: int = 64
    """Tries to find a crossing that goes on from a stored step; bisection alone needs 52."""
    rounding: float = 1e-15
    """Part of a number: four roundings. No event is located better in time, and the last instant before
    a break is earlier by it. A mismatch by this part of the magnitude of a guard, whose terms may all
    but cancel, is rounding, and so is a bend of a motion by this part of a component."""
    same_instant: float = 4.0
    """Multiples of the accuracy of an event's time within which two events share their instant."""
    lowest: float = 1e-16
    """Part of its magnitude by which a function still falls at its lowest, at the end of a step,"""
    was_lowest: float = 0.1
    """and part of `lowest` by which it does at the start of the next: no touch is lost in between."""
    touching: float = 0.02
    """Part of what counts as touching for derivatives: a hundred tolerances."""
    events_at_one_instant: int = 16
    """Events without time between them before a lane is chattering."""
    guards_of_one_jump: int = 2
    """Guards that one jump of a load may violate, one after the other."""

    # Levels of smallness, of which other packages use the same.
    same: float = 1e-6
    """Part: two of a size, a step or a way that differ by less are one; as a factor of a first order,
    its square is `slack`. So near are sections located, which are corrected after the run with their
    exact rate; an instant to a break that is at it; a motion to the parabola through its ends and
    slopes that is even, of which the error of a step has nothing to see; the speed of a contact, or
    the gap of a stop, to that of one that sticks, or is closed, beside its terms; two attractors."""
    zero: float = 1e-9
    """Part: a difference that is zero without rounding is smaller, where slopes, orbits or solutions of
    equations enter it: a slope beside another, two sides of a bend that does not jump, what a direction
    has besides others; of a full step, two guards that fire at one instant."""
    slack: float = 1e-12
    """Part of its magnitude by which a guard below zero is not violated, and a component at rest moves:
    rounding of the state. Whatever a few operations make of terms is zero below this part of them, and
    at rest what is slower, or closer, than so many m/s, or m."""
    some_roundings: float = 64 * 2.0**-52
    """Part of a value, 64 spacings of numbers: sums and square roots went into it, or a time at which a
    load such as the sign of a sine jumps, and from which it is evaluated so far away."""
    few_roundings: float = 8 * 2.3e-16
    """Part of the terms that cancel in a field, a speed or a gap: their rounding, eight spacings."""
    tiny: float = 1e-150
    """A number whose square is still a normal number: nothing, but to divide by."""
    most: float = 1e6
    """A share, or a doubt, beyond it says no more: the step is much too long, the force too large."""

    # Guards beside zero.
    part_of_slack: float = 4e-3
    """Part of the terms in parameters of which `slack` is the rounding."""
    edge: float = 4e-12
    """Part of its terms by which a state is moved off a border on which it lies; more than `slack`."""
    far: float = 1e30
    """Value of an event function that cannot fire, and time of the break after the last [s]."""

    # Excursions of an event function inside a step.
    points_inside: tuple[float, float] = (0.3819660112501051, 0.7236067977499789)
    """Where functions are evaluated inside a step, as parts of it: loads that repeat at a whole part of
    the step are not met at the same phase by both."""
    doubt_certain: float = 3.0
    """A mismatch of this part of the room, inverted, is accepted."""
    value_rounding: float = 1e-13
    """Part of the values: mismatches below it are rounding."""
    judged_together: int = 4
    """Functions judged in one call, which has one result: the compiler would compute what several share
    for each. It would run a larger call on several threads, which a fused program cannot do. In a
    portable one, more functions are judged by one small program. It compiles sooner, but puts an end to
    vector instructions in all that the compiler fuses with the stacking: batches ran three times as
    long."""

    # Bends and jumps of the field.
    jump: float = 1e-5
    """Part of itself by which the field differs at least on both sides of a bend that jumps. Its slope
    differs by `zero` at least, where the field does not. Part of the steps before: a step so much
    shorter, accepted only because its error is small now, holds a jump of the field. Steps resolve a
    smooth field long before."""
    outcome_bits: int = 48
    """Bits of all outcomes of comparisons, which are a part of the mode."""
    longest_scan: int = 16
    """Rounds of a loop in the field that is looked into."""

    # Breaks of loads, and periodic pieces.
    early: float = 0.1
    """Part of what is left of the period beside a piece: so long before it begins it is the next."""
    of_rest: float = 0.4
    """The same, as time scale: no step passes over more than what is left."""

    # Errors of a step and the magnitudes that they are measured by.
    smallest: float = 1e-6
    """Part of the largest component: a smaller one is measured against this part. In a long chain the
    far end begins to move like a high power of the time, of which no method has a digit."""
    short: float = 1e4
    """Roundings of the time: shorter steps may hold a jump that cannot be told any better."""
    loose: float = 1e-4
    """Part of a component: an absolute tolerance above it says nothing about the component. Step times
    rate of the field, to the power of the order: beyond it slopes may be off by so much."""
    expected: float = 0.4
    """Power of `rtol` by which the last stage of a step may differ from its end, as a part of the
    motion: such is the order of that difference beside that of the error."""
    forgets: float = 0.95
    """Part of the longest step that is remembered after one more."""
    root_share: float = 0.1
    """Part of the tolerance to which stage equations of implicit methods are solved. The step-size rule
    does not see the error that is left; but a stricter bound than the iteration can meet rejects steps
    that are accurate enough."""

    # Lengths of steps where no error sets them.
    of_time_scale: float = 2.0
    """Part of a declared time scale, inverted, that a step may be. While nothing moves the error of a
    step is zero, whatever its length; a load is seen at its ends and at two points inside."""
    of_run: float = 1e-3
    """The same of a run where a load declares no time scale."""
    resolution: float = 1e-10
    """Part of the run: an event function that still jumps within it is discontinuous."""
    first_step: float = 333.0
    """Resolutions: length of the first step where the motion does not say any."""
    of_period: float = 1.0 / 36.0
    """Part of a declared period that is travelled in one step,"""
    of_seen_period: float = 4.5
    """and times more where the error of a step sees a motion."""
    numbers_told_apart: int = 64
    """Numbers of a state whose turns are told apart; of a larger state its leaves are."""
    unseen_motion: float = 1e7
    """Tolerances: a motion of fewer does not set the length of its steps,"""
    seen_motion: float = 1e-3
    """but one of this part of the state does."""
    still_beginning: int = 10
    """Steps in which the length may have grown from that of the first to that of the run."""

    # States inside of a step, from the stages of a method.
    inner_order: int = 5
    """Order of those states: the cubic that they are compared with has order 3, more is not needed."""
    inner_weight: float = 2.0
    """Largest weight of a slope; larger ones would be the difference of large numbers."""

    # Sizes of programs, tapes and messages: they decide on time and room alone.
    block: int = 8
    """Attempts after which it is asked whether the lanes have ended,"""
    block_fused: int = 4 * block
    """and where to enter the loop costs as much as an attempt."""
    tape_rows: int = 32 * block
    """Most rows of the tape of reverse mode."""
    rows_at_once: int = 32
    """Rows of a log that are written in one go."""
    worth_a_call: int = 8
    """Operations that a call must save: it has to store its result, which is read again."""
    named_modes: int = 1024
    """Of more modes only those are named that occur."""


ACCURACY = Accuracy()
