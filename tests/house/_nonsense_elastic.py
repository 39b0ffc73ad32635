"""Right arguments of the elastic CoreXY."""

import numpy as np

import corexy_jax as cx
from corexy_jax import elastic
from stickslip.control import InputShaper
from tests.house._nonsense_engine import ARGS
from tests.house._nonsense_laws import FINITE, NOT_NEGATIVE, POSITIVE
from tests.house._nonsense_target import Target, arg


def command(t, args):
    return (0.0, 0.0), (0.0, 0.0)


PARAMETERS, FRAME = cx.CoreXYParameters(), elastic.Frame(0.4, 0.4)
BELTS = elastic.Belts(FRAME, 1e4, 1e4)
MACHINE = elastic.ElasticCoreXY(PARAMETERS, BELTS)
STEPPER = elastic.Stepper(command, 1.0, 0.05)
WINDING = elastic.Winding(24.0, 1.7, 1.5, 2.8e-3)
STATE = MACHINE.at()
PATH = elastic.trajectory([[0.0, 0.0], [0.1, 0.0]], 0.1, acceleration=1.0, corner_speed=0.1)
SHAPER = InputShaper(PATH, "ZV", 300.0)
TIMES = np.arange(1600) / 3200.0
RECORD = elastic.HeadRecord(PATH, TIMES, np.sin(TIMES), np.sin(TIMES))
STEPPED = elastic.ElasticCoreXY(PARAMETERS, BELTS, STEPPER)
PLACE = {"x": arg(0.1, *FINITE), "y": arg(0.1, *FINITE)}
ABOUT = {
    "parameters": arg(PARAMETERS), "belts": arg(BELTS), **PLACE,
    "holding": arg(np.inf, "infinite", *NOT_NEGATIVE),
}  # fmt: skip
ANGLES = {"t": arg(0.1, *FINITE), "angles": arg((0.0, 0.0), "pair"), "args": ARGS}
TARGETS = [
    Target(elastic.AxisShapers, {"x": arg(SHAPER), "y": arg(SHAPER)}),
    Target(
        elastic.Frame,
        {
            "width": arg(0.4, *POSITIVE),
            "depth": arg(0.4, *POSITIVE),
            "x": arg(0.1, "none", *POSITIVE),
            "y": arg(0.1, "none", *POSITIVE),
        },
    ),
    Target(elastic.Frame.lengths, PLACE, FRAME.lengths),
    Target(
        elastic.Belts,
        {
            "frame": arg(FRAME),
            "EA_1": arg(1e4, *POSITIVE),
            "EA_2": arg(1e4, *POSITIVE),
            "retardation": arg(1e-3, *NOT_NEGATIVE),
        },
    ),
    Target(elastic.Belts.stiffness, PLACE, BELTS.stiffness),
    Target(
        elastic.ElasticCoreXY,
        {
            "parameters": arg(PARAMETERS),
            "belts": arg(BELTS),
            "drive": arg(lambda t, angles, speeds, args: (0.0, 0.0), "function"),
            "law": arg(None, "none"),
        },
    ),
    Target(elastic.ElasticCoreXY.at, PLACE, MACHINE.at),
    Target(elastic.ElasticCoreXY.tensions, {"y": arg(STATE)}, MACHINE.tensions),
    Target(elastic.resonances, ABOUT),
    Target(elastic.lost_motion, ABOUT),
    Target(
        elastic.acceleration_limits,
        {
            **ABOUT,
            "direction": arg([1.0, 0.0], "row"),
            "tolerance": arg(1e-5, *POSITIVE),
            "torque": arg(np.inf, "infinite", *NOT_NEGATIVE),
            "shaper": arg(None, "none"),
        },
    ),
    Target(
        elastic.Stepper,
        {
            "path": arg(command, "function"),
            "torque": arg(1.0, *POSITIVE),
            "r": arg(0.05, *POSITIVE),
            "detent": arg(0.0, *NOT_NEGATIVE),
            "damping": arg(0.0, *NOT_NEGATIVE),
            "winding": arg(None, "none"),
            "steps": arg(200),
        },
    ),
    Target(
        elastic.trajectory,
        {
            "points": arg([[0.0, 0.0], [0.1, 0.0]], "table"),
            "speeds": arg(0.1, *POSITIVE),
            "acceleration": arg(1.0, *POSITIVE),
            "corner_speed": arg(0.1, *POSITIVE),
            "begin": arg(0.0, *FINITE),
        },
    ),
    Target(
        elastic.contour_errors,
        {
            "points": arg([[0.0, 0.0], [0.1, 0.0]], "table"),
            "x": arg([0.0, 0.1], "row"),
            "y": arg([0.0, 0.1], "row"),
            "lines": arg([0, 0], "none"),
            "beside": arg(8, "count"),
        },
    ),
    Target(
        elastic.read_gcode,
        {
            "source": arg("G1 X1\n"),
            "chord": arg(1e-5, *POSITIVE),
            "speed": arg(0.1, *POSITIVE),
        },
    ),
    Target(elastic.Trajectory.travelled, {"t": arg(0.1, *FINITE)}, PATH.travelled),
    Target(
        elastic.resonance_sweep,
        {
            "direction": arg([1.0, 0.0], "row"),
            "f0": arg(20.0, *POSITIVE),
            "f1": arg(60.0, *POSITIVE),
            "rate": arg(30.0, *POSITIVE),
            "acceleration_per_hz": arg(0.06, *POSITIVE),
            **PLACE,
            "begin": arg(0.0, *FINITE),
        },
    ),
    Target(
        elastic.span_frequency,
        {
            "tension": arg(20.0, *POSITIVE),
            "mass_per_length": arg(0.0084, *POSITIVE),
            "length": arg(0.15, *POSITIVE),
        },
    ),
    Target(
        elastic.span_tension,
        {
            "frequency": arg(100.0, *POSITIVE),
            "mass_per_length": arg(0.0084, *POSITIVE),
            "length": arg(0.15, *POSITIVE),
        },
    ),
    Target(
        elastic.pluck_tone,
        {
            "times": arg(TIMES, "row"),
            "record": arg(np.sin(600.0 * TIMES), "row"),
            "lowest": arg(20.0, *POSITIVE),
            "highest": arg(400.0, *POSITIVE),
        },
    ),
    Target(
        elastic.HeadRecord,
        {
            "path": arg(PATH),
            "times": arg(TIMES, "row"),
            "x": arg(np.sin(TIMES), "row"),
            "y": arg(np.sin(TIMES), "row"),
        },
    ),
    Target(
        elastic.fit_belts,
        {"machine": arg(STEPPED), "records": arg(RECORD), "window": arg(8)},
    ),
    Target(
        elastic.expected_errors,
        {
            "machine": arg(STEPPED),
            "path": arg(PATH),
            "rate": arg(3200.0, *POSITIVE),
            "noise": arg(0.1, *POSITIVE),
            "window": arg(8),
        },
    ),
    Target(elastic.Trajectory.breaks, {"shaper": arg(None, "none")}, PATH.breaks),
    Target(elastic.Stepper.lags, ANGLES, STEPPER.lags),
    Target(elastic.Stepper.margin, ANGLES, STEPPER.margin),
    Target(elastic.Stepper.pull_out, {"speed": arg(0.1, *FINITE)}, STEPPER.pull_out),
    Target(
        elastic.Winding,
        {
            "voltage": arg(24.0, *POSITIVE),
            "current": arg(1.7, *POSITIVE),
            "resistance": arg(1.5, *POSITIVE),
            "inductance": arg(1e-3, *NOT_NEGATIVE),
        },
    ),
    Target(
        elastic.Winding.pull_out,
        {"torque": arg(0.3, *FINITE), "periods": arg(50.0, *FINITE), "speed": arg(0.1, *FINITE)},
        WINDING.pull_out,
    ),
    Target(
        elastic.DCMotors,
        {"voltages": arg(lambda t, args: (0.0, 0.0), "function"), "parameters": arg(PARAMETERS)},
    ),
    Target(
        elastic.microsteps,
        {
            "path": arg(command, "function"),
            "breaks": arg([0.0, 1.1], "times"),
            "r": arg(0.05, *POSITIVE),
            "division": arg(16),
            "steps": arg(200),
        },
    ),
    Target(
        elastic.tooth_jump,
        {"tensions": arg(elastic.Spans(20.0, 20.0, 20.0, 20.0)), "limit": arg(50.0, *POSITIVE)},
    ),
    Target(elastic.Stepper.lost_steps, ANGLES, STEPPER.lost_steps),
    Target(elastic.Stepper.angles, {k: ANGLES[k] for k in ("t", "args")}, STEPPER.angles),
]
