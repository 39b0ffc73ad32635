"""Right arguments of the public methods of what users make or are returned: one object of each class.

Arguments are told by their names, which mean the same in all methods of a kind.
"""

import inspect
import tempfile
from typing import Any

import jax.numpy as jnp
import numpy as np

import corexy_jax as cx
import stickslip as ss
from stickslip import derived, friction, identification, systems
from tests.house._nonsense_control import AXIS, LOOP
from tests.house._nonsense_engine import OSCILLATOR, START
from tests.house._nonsense_identification import (
    BEST,
    FITS,
    PREDICTION,
    PROBLEM,
    RECORD,
    SIGNAL,
    UNKNOWN,
)
from tests.house._nonsense_laws import BLOCK, DRY, SMOOTH
from tests.house._nonsense_machine import PARAMETERS, VOLTAGE
from tests.house._nonsense_public import methods_of
from tests.house._nonsense_report import COMPARISON, POSTERIOR, PROFILE, REPORT
from tests.house._nonsense_structure import DAMPED, RUBBED, SLID
from tests.house._nonsense_structure import PAIR as PAIR_OF_NODES
from tests.house._nonsense_target import Argument, Target, arg

REALS = ("reals",)
BEAM = systems.JointedBeam.constructed(v=5e-4)
BROKEN = ss.WithBreaks(OSCILLATOR, [0.5, 1.5])
RECURRING = ss.WithPeriodicBreaks(OSCILLATOR, [0.5, 1.5], 2.0)
LEDGER = derived.WithIntegrals(OSCILLATOR, systems.CoulombOscillator.powers)
TANGENT = derived.WithDeviations(OSCILLATOR)
DEVIATING = TANGENT.start(START, np.eye(2))
DRIVE = systems.DCDrive.constructed()
SMOOTHED = cx.SmoothedCoreXY(PARAMETERS, VOLTAGE)
CARRIAGE = cx.CoreXYState(*(0.0,) * 9)
INSIDE = tempfile.TemporaryDirectory()
TABLE = ([0.0, 1.0], [1.0, 2.0], [0.0, 0.0])

# What an argument of a name takes, whatever the method.
NAMED = {
    **dict.fromkeys(("v", "normal_force", "t", "T_s", "coefficient"), arg(0.1, *REALS)),
    "sense": arg(1, "senses"), "mode": arg(0, "modes"), "guard": arg(0, "modes"),
    "args": arg(None, "unused"),
    "piece": arg(0.0, "pieces"), "z": arg(0.1, "real"), "level": arg(0.95, "float32"),
    "factor": arg(2.0, "positive", "float32", "batch"),
    "v_reg": arg(1e-3, "positive", "float32", "batch"), "kind": arg("tanh"),
    "loads": arg(BLOCK.loads(systems.DrivenBlockState(*(0.0,) * 6))),
}  # fmt: skip


def of(thing: Any, without: tuple[str, ...] = (), **special: Argument) -> list[Target]:
    """All public methods of an object but those named in `without`; arguments that are `special` to it
    are given by name, those of one method only as `method__argument`."""
    found = []
    for method in methods_of(type(thing)).values():
        name = method.__name__
        if name in without:
            continue
        known = {
            argument: special.get(f"{name}__{argument}", special.get(argument, NAMED.get(argument)))
            for argument in list(inspect.signature(method).parameters)[1:]
        }
        found.append(Target(method, known, getattr(thing, name)))
    return found


LAWS = [
    DRY, SMOOTH, friction.Stribeck(0.4, 0.3, 0.01, 2.0), friction.HyperbolicWeakening(0.4, 1.0),
    friction.ViscousFriction(0.1), friction.ViscousDamping(0.1), friction.Regularised(DRY, 1e-3),
    friction.Asymmetric(DRY, DRY), friction.Sum(DRY, DRY),
]  # fmt: skip
BRISTLES = [
    friction.Dahl(DRY, 1e4), friction.LuGre(DRY, 1e4),
    friction.Sum(friction.LuGre(DRY, 1e4), friction.ViscousFriction(0.1)),
    friction.RateAndState(0.6, 0.009, 0.01, 1e-5, 1e-6),
]  # fmt: skip
PAIR = systems.TwoBlocksOnBelt(
    **dict.fromkeys(
        ("mass_1", "mass_2", "stiffness_1", "stiffness_2", "coupling", "static_force_1",
         "static_force_2", "kinetic_force_1", "kinetic_force_2", "belt_speed"), 1.0,
    )
)  # fmt: skip
NO_SMOOTH_FORM = ("regularised",)  # refused: there are stops
MOTION = arg(START)
BLOCK_STATE = arg(systems.BlockState(*(0.0,) * 4))
DRIVEN_STATE = arg(systems.DrivenBlockState(*(0.0,) * 6))
STATES = "states"
TARGETS = [
    *(target for law in LAWS for target in of(law, state=arg((), "no state"))),
    *(target for law in BRISTLES for target in of(law, state=arg((0.0,), "one state"))),
    *of(OSCILLATOR, y=MOTION),
    *of(systems.SlidingBlock(1.0, 1.0, 0.5, 0.2), y=MOTION),
    *of(systems.BouncingBall(1.0, 9.81, 0.5, 1e-3), NO_SMOOTH_FORM, y=MOTION),
    *of(
        systems.OscillatorBetweenStops(1.0, 1.0, lower=-1.0, upper=1.0, restitution=0.5),
        NO_SMOOTH_FORM, y=MOTION,
    ),
    *of(PAIR, y=arg(systems.PairMotion(*(0.0,) * 4))),
    *of(systems.BlockOnBelt.constructed(k3=85.0), y=BLOCK_STATE),
    *of(systems.BlockOnBeltSetValued.constructed(k3=85.0), y=BLOCK_STATE),
    *of(BLOCK, y=DRIVEN_STATE),
    *of(systems.BlockOnDrivenBeltSetValued.constructed(k3=85.0), y=DRIVEN_STATE),
    *of(DRIVE, y=arg(systems.DriveState(0.0, 0.0)), initial_mode__args=arg(0.0, "none", *REALS)),
    *of(
        BEAM, y=arg(BEAM.start()), start__x=arg(1e-3, "none", "finite", "float32", "batch"),
        scales=arg(systems.BeamScales(2.0, 2.0, 2.0)),
    ),
    *of(BROKEN, start__y=arg(START, STATES), start__t=arg(0.0, "finite", "float32"),
        y=arg(BROKEN.start(START))),
    *of(RECURRING, y=MOTION),
    *of(LEDGER, start__y=arg(START), start__t=arg(0.0, "finite", "float32"),
        y=arg(LEDGER.start(START))),
    *of(TANGENT, start__y=arg(START, STATES), columns=arg(np.ones((2, 1))), y=arg(DEVIATING),
        state=arg(DEVIATING)),
    *of(
        PAIR_OF_NODES, y=arg(PAIR_OF_NODES.state()),
        **dict.fromkeys("qv", arg([1.0, 2.0], "none", "row")),
    ),
    *of(RUBBED, y=arg(RUBBED.state()), start__y=arg(PAIR_OF_NODES.state()),
        direction=arg([1.0, 2.0], "row")),
    *of(DAMPED, y=arg(SLID), start__y=arg(SLID.y), z=arg([0.0], "none"),
        start__t=arg(0.0, "finite", "float32"), t=arg(0.1, "real")),
    *of(LOOP, y=arg(LOOP.start(AXIS)), start__y=arg(AXIS, STATES),
        start__t=arg(0.0, "finite", "float32")),
    *of(FITS, path=arg(f"{INSIDE.name}/fit.nc", "path"), robust=arg(False, "flag")),
    *of(PREDICTION),
    *of(PROFILE, name=arg("a")),
    *of(RECORD.summary()),
    *of(POSTERIOR),
    *of(COMPARISON, by=arg("bic")),
    *of(REPORT, path=arg("x", "path")),
    *of(SIGNAL, delay=arg(0.1, "real")),
    *of(identification.Huber(1.0), residual=arg(0.1, *REALS)),
    *of(identification.SoftL1(1.0), residual=arg(0.1, *REALS)),
    *of(
        PROBLEM, values=arg(UNKNOWN, "unknowns"), record=arg(0, "whole"),
        residual=arg(np.zeros(2), "residuals"), method=arg(None, "none"),
        start=arg(None, "none", "unknowns"),
        starts=arg(None, "none"), fits__starts=arg({"a": [1.0, 2.0]}), seed=arg(0, "count"),
        chunk_size=arg(None, "none"), records=arg(RECORD), fit=arg(BEST),
        score__fit=arg(BEST, "unknowns"), draws=arg(None, "none"),
        after=arg(0.1, "not negative", "float32"), windows=arg(2), robust=arg(False, "flag"),
    ),
    *of(identification.Sensitivity(("a",), jnp.ones((3, 1)))),
    *(target for kind in (cx.Harmonic, cx.SquareWave) for target in of(kind(1.0, 2.0))),
    *(target for kind in (cx.Sampled, cx.PiecewiseStep)
      for target in of(kind(*TABLE), piece_of__t=arg(0.1, "real"), __call____t=arg(0.1, "real"))),
    *of(cx.Ramps(*TABLE, *TABLE[1:]), piece_of__t=arg(0.1, "real"), __call____t=arg(0.1, "real")),
    *of(cx.ConstantVoltage(1.0, 2.0)),
    *of(cx.UserVoltage(lambda t, args: (t, t))),
    *of(ss.sweep.Storage(), chunk=arg(4, "none")),
    *of(SMOOTHED, y=arg(SMOOTHED.state(CARRIAGE)), s=arg(SMOOTHED.state(CARRIAGE)),
        state__y=arg(CARRIAGE), powers__t=arg(0.1, "finite", "float32", "batch")),
]  # fmt: skip
