"""One instance of each reference system, a start and a time span with several events."""

from typing import Any, NamedTuple

from stickslip.systems import (
    BouncingBall,
    CoulombOscillator,
    Motion,
    OscillatorBetweenStops,
    PairMotion,
    SlidingBlock,
    TwoBlocksOnBelt,
)

PAIR = dict(
    mass_1=1.0,
    mass_2=1.5,
    stiffness_1=1.0,
    stiffness_2=2.0,
    coupling=0.7,
    static_force_1=1.0,
    static_force_2=1.3,
    kinetic_force_1=0.5,
    kinetic_force_2=0.6,
    belt_speed=0.3,
)
STOPS = dict(
    mass=1.0,
    stiffness=2.0,
    damping=0.1,
    lower=-0.6,
    upper=1.0,
    restitution=0.8,
    force_amplitude=0.7,
    force_frequency=1.3,
)


class Case(NamedTuple):
    """A system ready to run; `losses` are its powers that may not be positive."""

    system: Any
    start: Any
    t1: float
    losses: tuple[str, ...]


CASES = {
    "oscillator on a belt": Case(
        CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2), Motion(0.0, 0.2), 20.0, ("friction",)
    ),
    "oscillator overtaking the belt": Case(
        CoulombOscillator(2.0, 3.0, 1.0, 0.6, 0.2), Motion(-1.9, -0.4), 12.0, ("friction",)
    ),
    "oscillator on rough ground": Case(
        CoulombOscillator(1.0, 4.0, 0.5, 0.4, 0.0), Motion(1.5, 0.0), 12.0, ("friction",)
    ),
    "sliding block": Case(SlidingBlock(2.0, 1.5, 1.0, 0.3), Motion(0.0, 2.0), 10.0, ("friction",)),
    "sliding block turning around": Case(
        SlidingBlock(2.0, 1.5, 1.0, -1.8), Motion(0.0, 2.0), 4.0, ("friction",)
    ),
    "bouncing ball": Case(BouncingBall(0.5, 9.81, 0.7, 0.2), Motion(1.0, 0.0), 4.0, ()),
    "two blocks": Case(
        TwoBlocksOnBelt(**PAIR), PairMotion(0.0, 0.3, 0.1, 0.3), 20.0, ("friction_1", "friction_2")
    ),
    "between stops": Case(OscillatorBetweenStops(**STOPS), Motion(0.0, 1.5), 10.0, ("damping",)),
    "coming to rest at a stop": Case(
        OscillatorBetweenStops(
            1.0,
            1.0,
            lower=0.2,
            upper=2.0,
            restitution=0.5,
            rest_speed=0.05,
            force_amplitude=1.0,
            force_frequency=0.4,
        ),
        Motion(1.0, 0.0),
        16.0,
        ("damping",),
    ),
}
