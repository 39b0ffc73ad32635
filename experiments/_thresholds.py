"""The numbers that statements are judged by, each with its meaning and where it comes from.

The papers seldom say how much is "much": where a number is not theirs, it is a choice. Predicates take
their numbers from here and nowhere else, so that this table is all there is to argue about.
"""

import dataclasses

PAPER = "paper"
STUDY = "study"  # an earlier one, of fixed steps, of the CoreXY statements
PUBLISHED = "published"  # with the measured record
OURS = "ours"


@dataclasses.dataclass
class Number:
    """A number of a class of this module; read from the class it is the number itself."""

    value: float
    unit: str
    meaning: str
    source: str
    name: str = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = f"{owner.__name__}.{name}"
        TABLE[self.name] = self

    def __get__(self, instance: object, owner: type) -> float:
        return self.value


TABLE: dict[str, Number] = {}


class Block:
    """Of the block on a belt, B1 to B6."""

    K3_LOW = Number(72.0, "N/m", "B1: least stiffness k3 of the diagrams", PAPER)
    K3_HIGH = Number(97.0, "N/m", "B1: greatest stiffness k3 of the diagrams", PAPER)
    END_OF_CHAOS = Number(95.1, "N/m", "B4: k3 at which chaos ends", PAPER)
    SPECIAL = Number(87.968, "N/m", "B5: k3 of the phase planes", PAPER)
    KINDS = Number(2, "", "B1: more numbers of branches than these are a visible change", OURS)
    APART = Number(0.02, "", "part of the span of all points by which two branches are apart", OURS)
    CHAOTIC = Number(0.02, "1/s", "an exponent above this, and above its own spread, is chaos", OURS)
    SPREADS = Number(2.0, "", "B5: spreads (standard deviations) that an exponent is in doubt by", OURS)
    FINE = Number(0.1, "N/m", "exponents farther apart say nothing on the extent of chaos", OURS)
    NEAR_END = Number(0.5, "N/m", "B4: two ends of chaos this near are almost the same", OURS)
    DIFFERENT = Number(0.2, "", "B6: part of the chaos that lies where the other is periodic", OURS)
    ENOUGH = Number(
        0.9, "", "part of lanes or exponents that must be known for a statement on all", OURS
    )
    FEWEST = Number(10, "", "lanes or exponents below which nothing is said", OURS)


class BlockMap:
    """Of the map of the block over k3 and the belt speed, X3 to X5."""

    NEAR = Number(1.0, "", "cells from a curve below which lanes are counted apart", OURS)
    SAME_PERIOD = Number(0.1, "", "difference of periods up to which orbits are of one family", OURS)
    AGREE = Number(0.99, "", "X4: part of the lanes that must lie on the right side", OURS)
    LOCATED = Number(1e-5, "N/m", "X5: difference of two k3 of one doubling", OURS)
    FEWEST = Number(10, "", "lanes below which nothing is said", OURS)


class Beam:
    """Of the jointed beam, C1 to C9; belt speeds and frequencies are dimensionless."""

    STICK_SLIP_BELOW = Number(2.5e-3, "", "C3, C4, C9b: border of stick-slip in the belt speed", PAPER)
    SLIP_ABOVE = Number(9e-3, "", "C4, C5, C9b: border of pure slip in the belt speed", PAPER)
    SLOW = Number(5e-4, "", "C6, C7: belt speed of Figs. 2.4 to 2.7", PAPER)
    FAST = Number(5e-3, "", "C8: belt speed of Figs. 2.8 to 2.11", PAPER)
    PERIOD = Number(0.54, "", "C6: period of stick-slip", PAPER)
    LOW_FREQUENCY = Number(0.25, "", "C8: the frequency", PAPER)
    SAME_PERIOD = Number(0.005, "", "C6: periods this near are the same; two digits are printed", OURS)
    SAME_FREQUENCY = Number(0.01, "", "C8: frequencies this near are the same", OURS)
    NEAR_BEAM = Number(0.05, "", "C6: part of a frequency of the beam by which a line is near it", OURS)
    LINES_OF_Y = Number(3, "", "C6: superharmonics in y", OURS)
    LINES_OF_W = Number(2, "", "C6, C8: superharmonics in w, and in y", OURS)
    EXACT = Number(1e-6, "", "C1: maxima of x that differ by less, against their size, are one", OURS)
    SINGLE = Number(0.01, "", "points that differ by less than this part of their size are one", OURS)
    GROWS = Number(0.9, "", "C2: correlation with the belt speed of what grows with it", OURS)
    EVERY = Number(0.98, "", "C3: sticks a contact from which on it sticks at every one", OURS)
    IRREGULAR = Number(0.9, "", "C4a: part of the lanes that must be more than one line", OURS)
    BORDER = Number(0.05, "", "speeds this near a border of two digits are not judged", OURS)
    SAME_BORDER = Number(0.05, "", "C3b: a speed this near one of two digits is the same", OURS)
    NEUTRAL = Number(1e-9, "", "C3b, C4c, C5b: a multiplier nearer to the unit circle is on it", OURS)
    REGULAR = Number(0.1, "", "C7: change over a period, against the size, of what is regular", OURS)
    ENOUGH = Number(
        0.9, "", "part of the lanes of a range that must be known for a statement on all", OURS
    )
    FEWEST = Number(3, "", "lanes, points or sticks below which nothing is said", OURS)
    FEWEST_SPEEDS = Number(5, "", "C9b: exponents of a range below which it has no slope", OURS)
    PERIODS = Number(5, "", "periods of contact that a record must hold", OURS)
    RESOLUTION = Number(0.0125, "", "C8: coarsest spacing of the lines of a spectrum", OURS)
    ZERO = Number(
        0.01, "", "C9a: an exponent below this, with its doubt, is known not to be positive", OURS
    )
    ERRORS = Number(2.0, "", "C9: standard errors that an exponent or a slope is uncertain by", OURS)


class CoreXY:
    """Of the CoreXY mechanism, S1 to S3; shares are of the time."""

    PERIOD = Number(2.0, "s", "S1: period of the voltages", PAPER)
    STEP = Number(1e-4, "s", "S1.10: the time step", PAPER)
    TURN = Number(2.0, "s", "S3: the time after which all changes, printed as about 2 s", PAPER)
    SOON = Number(0.02, "s", "'at first', 'immediately', after the start", STUDY)
    AT_ONCE = Number(1e-3, "s", "S1.02: 'right from the beginning'; S3.01: what is left out", STUDY)
    BEGINNING = Number(0.05, "s", "S1.02: the beginning", STUDY)
    EARLY = Number(0.1, "s", "S2.05, S3.01, S3.13: end of the start", STUDY)
    LASTS = Number(1e-3, "s", "what rests or stays this long has halted", STUDY)
    BRIEF = Number(0.05, "s", "S2.16: longest isolated instance", STUDY)
    SPREAD = Number(1.0, "s", "S2.07: time over which impulses are spread", STUDY)
    TURN_BEFORE = Number(1.4, "s", "S3.03: begin of the time before the turn", STUDY)
    TURN_FROM = Number(1.9, "s", "S3: earliest 'about 2 s'", STUDY)
    TURN_TO = Number(2.6, "s", "S3: time after the turn", STUDY)
    TURN_SEEN = Number(2.7, "s", "S3: latest 'about 2 s'", STUDY)
    AFTERWARDS = Number(3.0, "s", "S3.05, S3.12: 'afterwards'", STUDY)
    TRIGGERED = Number(5e-3, "s", "S3.13: slip this soon after a jump is triggered by it", STUDY)
    SOME = Number(0.01, "", "least share of what 'occurs', 'is substantial'", STUDY)
    MOST = Number(0.5, "", "share of 'most'", STUDY)
    NEARLY = Number(0.9, "", "S1.02, S2.11, S3.09, S3.10: share of 'nearly all'", STUDY)
    ALMOST_ALL = Number(0.95, "", "share of 'almost all', 'nothing but'", STUDY)
    FOR_GOOD = Number(0.99, "", "S3.04: share of 'for good'", STUDY)
    BOTH_STATES = Number(0.1, "", "S3.14: least share of RR and of SS", STUDY)
    NO_OTHER = Number(0.05, "", "S3.14: largest share of SR and RS", STUDY)
    MUCH_LESS = Number(0.25, "", "largest ratio of 'much less'", STUDY)
    DIMINISHED = Number(0.7, "", "S1.07: voltage against its peak that has diminished", STUDY)
    SMOOTH = Number(0.02, "", "S1.10: largest jump in a step against the top speed", STUDY)
    ELLIPSE = Number(1e-3, "", "S1.11: largest deviation from the ellipse", STUDY)
    WAVE_START = Number(0.05, "", "S1.13: part of the period that is the start of a wave", STUDY)
    REPEATED = Number(2, "", "S1.09, S2.05, S2.09: fewest episodes of what happens again", STUDY)
    IMPULSES = Number(3, "", "S2.07: fewest impulses", STUDY)
    IMPULSIVE = Number(0.5, "", "S2.07: acceleration against the largest that is an impulse", STUDY)
    SPORADIC = Number(0.01, "", "S2.07: share that impulses stay below", STUDY)
    RARE = Number(1e-4, "", "S2.05: least share of intervals of motion", STUDY)
    LEVELS = Number(3, "", "S3.15: most levels of a pulse", STUDY)
    JUMP = Number(1.0, "V", "S3.13, S3.15: smallest jump of a voltage", STUDY)
    DIVERGE = Number(100.0, "rad/s", "S2.02, S2.13: speed of what diverges or oscillates", STUDY)
    RESIDUAL = Number(0.01, "", "S2.10: speed against the largest that is residual", STUDY)
    CONSTANT = Number(0.01, "", "S2.04: range of x against that of y up to which x is constant", STUDY)
    CONSTANT_X = Number(1e-6, "m", "S2.04: range of x up to which x is constant", STUDY)
    MILLIMETRES_FROM = Number(0.5e-3, "m", "S2.06: least range of y on the scale of millimetres", STUDY)
    MILLIMETRES_TO = Number(20e-3, "m", "S2.06: greatest such range", STUDY)
    MOVES = Number(0.01, "m", "S3.08: range of what moves", STUDY)
    RESTARTS = Number(1e-3, "m", "S3.12: range of what cannot be restarted", STUDY)
    AT_REST = Number(1e-12, "m/s", "speed, or rad/s, up to which it rests: rounding", OURS)
    MOVING = Number(1e-9, "m/s", "speed above which the mechanism moves", OURS)
    ACCELERATES = Number(1e-9, "m/s2", "S2.07, S3.07: acceleration above rounding", OURS)
    POWER = Number(1e-12, "W", "S1.06: power above rounding", OURS)
    KINETIC = Number(1e-6, "", "relative difference from the kinetic friction: rounding", OURS)
    DIGITS = Number(9, "", "S3.15: decimals to which voltages are one level", OURS)
    FEWEST = Number(10, "", "rows below which nothing is said", OURS)


class Machines:
    """Of declared machines against known results, M1 to M5; relative unless a unit says otherwise."""

    MODES = Number(1e-8, "m", "M1.1: distance from the superposition of modes", OURS)
    PERIOD = Number(1e-8, "", "M1.2: difference of periods, and of releases in s", OURS)
    ORDER = Number(0.25, "", "M1.3: difference of the order of time stepping from 1", OURS)
    ROOTS = Number(1e-9, "", "M2.1: difference of growth rates", OURS)
    HOPF = Number(1e-6, "", "M2.2: difference of the critical speed", OURS)
    STEPS = Number(1.5, "", "M2.3: steps of the grid by which a border is uncertain", OURS)
    SWINGS = Number(1e-6, "", "M3.1: difference of growth rates", OURS)
    AMPLITUDE = Number(2e-3, "", "M3.2: difference of the amplitude in the limit", OURS)
    HALF_STEP = Number(0.6, "", "M3.3: steps of the grid by which a border is uncertain", OURS)
    AVERAGING = Number(0.01, "", "M3.3: and what the averaging leaves out", OURS)
    FLUTTER = Number(1e-6, "", "M4.1: difference of growth rates", OURS)
    FLUTTER_APART = Number(
        0.02, "", "M4.1: distance from the border, where the rate has no slope", OURS
    )
    GROWS = Number(1e-4, "1/s", "M4.2: rate above which a mode grows", OURS)
    BORDER = Number(1e-6, "", "M4.2: difference of the critical coefficient", OURS)
    ENERGY = Number(1e-8, "", "M4.3: energy that is not accounted for", OURS)
    LOOPS = Number(1e-4, "", "M5.1: difference of the area of a loop", OURS)
    SMALL = Number(1e-5, "", "M5.2: difference of the frequency of small swings", OURS)
    RIGID = Number(1e-5, "", "M5.3: difference of the area without bristles", OURS)
    MOVES = Number(1e-9, "m", "M5.3: turn of a carriage that moves", OURS)


class Designs:
    """Of plans and designs of our own, F and I."""

    FOLLOWS = Number(1e-9, "m", "F1: largest distance from the path", OURS)
    SCATTER = Number(4.0, "", "I2: standard deviations by which a mean square may be off", OURS)


class Measured:
    """Of fits to measured records, R1 to R4."""

    SAME = Number(1e-3, "", "R1.3, R3.1, R4.9: difference of what starts end at", OURS)
    WHITE = Number(0.05, "", "R1.5, R3.5, R4.10: probability below which residuals are not white", OURS)
    EMPS_INVERSE = Number(5e-3, "", "R1.1: relative difference from what is published", OURS)
    EMPS_MASS = Number(0.01, "", "R1.2: the same, of the mass", OURS)
    EMPS_FRICTION = Number(0.03, "", "R1.2: the same, of the friction", OURS)
    EMPS_ASYMMETRY = Number(0.05, "", "R1.4: the same, of friction in each direction", OURS)
    SWING_LEFT_OUT = Number(6e-3, "rad", "R2.3, R2.4: error of the rest of a segment", OURS)
    SWING_GRAVITY = Number(0.01, "", "R2.6: relative difference from what is published", OURS)
    SURE = Number(10.0, "", "R2.7: standard errors from zero of what is there", OURS)
    ROCK = Number(0.0088, "", "R3.2, R3.3: a and b", PUBLISHED)
    ROCK_WITHIN = Number(0.0006, "", "R3.2, R3.3: and how far off", PUBLISHED)
    INTERVALS = Number(0.1, "", "R3.4: difference of two intervals against their width", OURS)
    WEAKENS = Number(2.0, "", "R3.6: standard errors of a difference that is there", OURS)
    STEP_TIME = Number(0.02, "s", "R3.7: difference of two times of the step", OURS)
    AIC = Number(10.0, "", "R3.8: AIC by which two laws are told apart", OURS)
    PREDICTS = Number(1.2, "", "R3.9: error against the noise", OURS)
    ARM_INERTIA = Number(0.08, "", "R4.1, R4.3: relative difference from what is published", OURS)
    ARM_FRICTION = Number(0.3, "", "R4.2, R4.4: the same, of dry friction", OURS)
    ARM_LEFT_OUT = Number(0.026, "rad", "R4.5: error of the trajectory held out", OURS)


class Synthetic:
    """Of fits to synthetic records, Y1 and Y2."""

    LEAST = Number(0.93, "", "Y1.3, Y1.4, Y2.3, Y2.4: least coverage of intervals of 95%", OURS)
    MOST = Number(0.97, "", "and the greatest", OURS)
    RECORDS = Number(1000, "", "Y1.3 to Y1.5: fewest records", OURS)
    LOWER = Number(1e-3, "", "Y1.1: by how much a sum of squares is lower than that of a fit", OURS)
    DOUBTED = Number(0.01, "", "Y1.5: probability below which a distribution is another one", OURS)
    MACHINES = Number(100, "", "Y2: fewest machines", OURS)
    RECOVERED = Number(0.95, "", "Y2.1, Y2.2: part of the machines", OURS)
    FAR = Number(4.0, "", "Y2.1: standard errors from the truth of what is recovered", OURS)


COVERED = f"{100 * Synthetic.LEAST:.0f} to {Synthetic.MOST:.0%}"
