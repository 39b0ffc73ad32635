"""Numbers that decide in continuation, each with its unit and its meaning, chosen by us unless said.

None is an option. "Part" is a ratio without a unit, of the scale that stands beside the number where it
is used: the motion's size, the bounds' distance, the step, the largest entry. All were tried on the
truths of the tests, which hold for numbers several times larger and smaller.
"""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers that decide in continuation; `ACCURACY` is the one object of this class."""

    # Levels of smallness, so that one idea has one number: from rounding to what is only alike. Four
    # more are the engine's. `slack`: singular values, entries and rates that come out of a whole
    # computation are rounding below it, some thousand spacings of numbers. `solved`: part of the
    # motion's size to which an orbit closes where Newton's method ends; states on which a mode insists
    # are held to it, and balanced equations of equilibria are singular below it. `zero`: jumps at an
    # event, distances from the real axis, drifts, shares. `same`: part of the motion's size, nearer
    # than which two orbits are one, with room for the condition of the equations, which may lose five
    # of the digits that are `solved`.
    short: float = 1e-13
    """Part: a last step of a search. Newton's method squares the error, secants nearly do. A component
    that moves by less of its value, some hundreds of spacings of numbers, does not move."""
    closes: float = 1e-8
    """Part: an orbit simulated once more returns to it, times the growth of deviations in a period;
    field and guards of the same states are the same to it a period later."""
    little: float = 1e-4
    """Part: a move for differences and first secants, small against the bends of a branch, large
    against `ENGINE.zero`. An orbit whose extent has shrunk to it is at rest."""
    alike: float = 1e-3
    """Part: two results of different ways to one thing agree to it. A function that jumps is larger
    than this part of its values at both ends."""
    near: float = 1e-2
    """Part: beside an orbit, but of the same branch; also the growth of errors that is too much. Part
    that a tolerance of steps is of how far an orbit of such steps may be from closing."""

    # Steps along a branch.
    shorter: float = 0.5
    """Factor of a step that failed, bends or leaps, or ends on a branch point. Part of a way or of a
    period that is still near its beginning."""
    longer: float = 1.5
    """Factor of the step after one that succeeded."""
    bend: float = 0.9
    """Cosine of the angle between two tangents: sharper bends get shorter steps,"""
    bend_at_rest: float = 0.95
    """and of tangents of equilibria, whose steps cost little."""
    straight: float = 0.99
    """The same: between two such orbits their branch is straight."""
    patience: float = 2.0**-4
    """Part of a step that failed, down to which shorter ones are tried. A point is looked at from
    behind with this part of a step, its square and its cube."""
    strays: float = 2.0
    """Steps that an orbit may be from where it was expected. Also the factor from one part of a motion
    or of a branch to the next."""
    swerves: float = 0.1
    """Of a step, that it may be, besides what the branch bends; what a law may be off by; part of its
    mean speed at which an angle shows the place on an orbit."""
    follows: float = 0.9
    """Part of the move of a component by which it may differ from what the tangents predict."""
    shrinks: float = 0.3
    """Part by which a step may change the extent of the motion, or a period, or that is left of the way
    to a border to which a branch leads. Steps between orbits of that way that are all kept."""
    far: float = 10.0
    """Moves or sizes: what is farther from where it began is something else."""
    least_points: int = 8
    """Points of a closed branch, at least; evaluations, after which components that do not move along
    the branch are not waited for."""

    # Searches.
    tries: int = 30
    """Secants, halvings, sizes (of a first orbit in powers of ten, to both sides) or evaluations at an
    equilibrium that are tried at most; periods of a forcing before a first response is looked for."""
    rounds: int = 12
    """Times that a search begins anew from what was found. Evaluations of Newton's method at one orbit;
    an equilibrium has `tries`, from farther away."""
    few: int = 4
    """The same, where each costs several orbits, as attempts at a response do; each of these has so
    many times the periods of the one before. Evaluations after which the step along a branch is longer,
    and orbits from which a law is read off."""
    nearer: float = 2.0**-6
    """Part of what is left to which a round of bisection comes; where one round decides, it comes as
    far as four."""
    around: int = 16
    """Directions, or instants of an orbit, that are asked at first."""
    stalled: float = 1e3
    """Tolerances: rounding may keep the residual of Newton's method from falling further; then up to so
    much is an end, no failure."""
    inside: tuple[float, ...] = (0.0, 0.02, 0.1, 0.5, 2.0)
    """Of a step along a border: how far beside it orbits are looked for."""
    amplitudes: tuple[float, ...] = (1.0, 0.3, 3.0, 0.1, 10.0, 0.03, 0.01)
    """First amplitudes of an orbit that begins at another one, in parts of `near`, or at an
    equilibrium, in parts of what is hardly nonlinear."""
    widths: tuple[float, ...] = (0.08, 0.16, 0.03)
    """Of a step: distances of the orbits between which a branch point is found."""

    # Samples of a period, and laws that are read off from them.
    samples: int = 64
    """Points of a period, at least, at which the size of each component is read off; the most events
    or orbits that are compared one by one."""
    parts: int = 60
    """Of the period, at which the motion is compared with its start: most small numbers divide it."""
    block: int = 32
    """Steps in which extremes are looked for side by side."""
    as_near: float = 3.0
    """Factor: two returns whose distances differ by less are equally good: the first is taken."""
    steep: float = 4.0
    """Power of the period that an exponential law has at least where it is told from others."""

    # Integration of one period where no integrator is given: relative tolerances.
    integration: float = 1e-12
    """Of orbits, whose derivatives are looked at,"""
    guessing: float = 1e-10
    """and of first guesses."""

    @property
    def shortest(self) -> float:
        """Part of a step below which it is not shortened for a bend: the cube of `patience`.

        Of equilibria also not where Newton's method fails.
        """
        return self.patience**3


ACCURACY = Accuracy()
