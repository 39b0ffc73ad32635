"""Right arguments of the CoreXY machine."""

import jax
import jax.numpy as jnp

import corexy_jax as cx
from stickslip import FixedStep, Integrator
from tests.house._nonsense_laws import FINITE, NOT_NEGATIVE, POSITIVE, finite, not_negative, positive
from tests.house._nonsense_target import Target, arg

PARAMETERS = cx.CoreXYParameters()
VOLTAGE = cx.Harmonic(10.0, 5.0)
ZERO = jnp.zeros(())
SENSES = cx.SlipDirections(1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
FRICTIONS = cx.FrictionForces(0.1, 0.1, cx.PassivePulleys(*(0.01,) * 8), 0.1, 0.1, 0.1, 0.1)
NEEDED = cx.RollingRequirement(0.1, 0.1, 0.1, 0.1)
ROW = jnp.zeros(3)
DATA = cx.Measurement(ROW, ROW, ROW, ROW)
TIMES = [0.1, 0.2, 0.3]
SOLUTION = cx.CoreXYSolution(
    PARAMETERS, VOLTAGE, jnp.arange(3.0), cx.CoreXYState(*(ROW,) * 9), cx.Accelerations(*(ROW,) * 4),
    jnp.ones(3, jnp.int32), jnp.zeros((3, 8)),
    cx.Ledger(ROW, ROW, jnp.zeros((3, 8)), jnp.zeros((3, 2))), None, jnp.zeros((), jnp.int32),
    None, "consistent",
)  # fmt: skip
_TWO = jnp.zeros((1, 2))
PLAN = cx.Feedforward(
    PARAMETERS, jnp.asarray([[0.0, 0.0], [0.3, 0.0]]),
    cx.Ramps([0.0, 1.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.0]), jnp.arange(2.0),
    _TWO, _TWO, _TWO, _TWO, jnp.arange(2.0),
)  # fmt: skip

P = {"p": arg(PARAMETERS)}
PAIR = arg((0.1, 0.1), "pair")
TORQUES = arg((0.1, 0.1), "two numbers")
ERRATA = arg(cx.Errata(), "none")
RK4 = arg(Integrator("rk4", FixedStep(0.1)), "none")
MACHINE = {"parameters": arg(PARAMETERS), "voltage": arg(VOLTAGE)}
RUN = {**MACHINE, "t1": arg(1.0, "positive", "float32"), "rows": arg(11), "y0": arg(None, "none")}
FLOW = {"integrator": RK4, "throw": arg(True, "flag")}
SMOOTH = {
    "variant": arg("tanh", "whole"), **positive(width=1e-2),
    "stribeck_speed": arg(0.1, "none", *POSITIVE),
}  # fmt: skip
TABLE = {"times": arg([0.0, 1.0], "times"), "v1": arg([1.0, 2.0], "row"), "v2": arg([0.0, 0.0], "row")}
NUMBERS = {"m": 0.5, "M": 1.0, "J": 1e-3, "J_passive": 5e-4, "r": 0.05, "R": 0.9, "K_t": 2.0,
           "P1": 20.0, "P2": 20.0, "g": 9.81}  # fmt: skip
COEFFICIENTS = {"K_e": 0.03, "mu_s": 0.4, "mu_k": 0.1, "mu_1s_b": 10.0, "mu_2s_b": 0.1, "mu_1k_b": 0.2,
                "mu_2k_b": 0.2}  # fmt: skip
SWITCHES = ("A1", "A2", "A3", "A4", "A6", "A8", "A9", "A12")

TARGETS = [
    Target(
        cx.CoreXYParameters,
        {
            **positive(**NUMBERS), **not_negative(**COEFFICIENTS),
            "r_f": arg(0.05, "none", *NOT_NEGATIVE),
        },
    ),
    *(
        Target(kind, {**finite(v01=10.0, v02=5.0), **positive(frequency=0.5)})
        for kind in (cx.Harmonic, cx.SquareWave)
    ),
    *(Target(kind, TABLE) for kind in (cx.Sampled, cx.PiecewiseStep)),
    Target(cx.Ramps, {**TABLE, "slope_1": arg([0.0, 1.0], "row"), "slope_2": arg([0.0, 0.0], "row")}),
    Target(
        cx.feedforward,
        {
            "parameters": arg(PARAMETERS), "points": arg([[0.0, 0.0], [0.3, 0.0]]),
            "volts": arg(24.0, "positive", "float32"), "margin": arg(0.9, "float32"),
            "tension_error": arg(0.0, "zero", "float32"), "steps": arg(8),
        },
    ),
    Target(
        cx.feedforward_along,
        {
            "parameters": arg(PARAMETERS), "path": arg(cx.Path.arc((0.0, 0.0), 0.1, 0.9, 0.5)),
            "volts": arg(24.0, "positive", "float32"), "margin": arg(0.9, "float32"),
            "tension_error": arg(0.0, "zero", "float32"), "steps": arg(8),
        },
    ),
    Target(
        cx.Path,
        {
            "function": arg(lambda s: (s, 0.0 * s), "function"),
            "end": arg(3.0, "positive", "float32"), "jumps": arg([1.0], "no times", "times"),
        },
    ),
    Target(
        cx.Path.arc,
        {
            "centre": arg((0.0, 0.0), "row"), "radius": arg(0.1, "positive", "float32"),
            "start": arg(0.0, "finite", "float32"), "turn": arg(1.0, "turn", "float32"),
        },
    ),
    Target(cx.Path.through, {"points": arg([[0.0, 0.0], [0.3, 0.0]])}),
    Target(
        cx.Path.rounded,
        {
            "points": arg([[0.0, 0.0], [0.3, 0.0], [0.3, 0.2]]),
            "radius": arg(0.05, "float32"),
        },
    ),
    Target(
        cx.check_rolling,
        {
            "plan": arg(PLAN), "parameters": arg(None, "none"), "voltage": arg(None, "none"),
            "rows": arg(11), "integrator": RK4,
        },
    ),
    Target(cx.Feedforward.at, {"t": arg(0.1, "reals")}, PLAN.at),
    Target(cx.ConstantVoltage, finite(v1=1.0, v2=1.0)),
    Target(
        cx.UserVoltage,
        {
            "function": arg(lambda t, args: (t, t)), "args": arg(None, "handed on"),
            "shortest": arg(None, "none", "positive", "float32"),
        },
    ),
    Target(cx.scenario, {"number": arg(1), "errata": ERRATA}),
    Target(cx.Errata, dict.fromkeys(SWITCHES, arg(False, "flag"))),
    Target(cx.Errata.corrected, dict.fromkeys(SWITCHES, arg(False, "flag"))),
    Target(cx.Errata.describe, {"name": arg("A1")}),
    *(Target(f, P) for f in (cx.motor_dead_zone, cx.torque_dead_zone, cx.voltage_dead_zone)),
    Target(cx.axis_dead_zones, {**P, **finite(rolls_1=1.0, rolls_2=0.0)}),
    Target(cx.available_coefficients, {**P, "errata": ERRATA}),
    Target(cx.belt_friction, {**P, **finite(sense_1=1.0, sense_2=0.0)}),
    Target(cx.ground_friction, {**P, "mu": arg(0.4, *NOT_NEGATIVE), "senses": arg(SENSES)}),
    Target(cx.motor_current, {**P, **finite(v=1.0, omega=0.0)}),
    Target(cx.motor_torque, {**P, **finite(v=1.0, omega=0.0)}),
    Target(cx.voltage_for_torque, {**P, **finite(torque=1.0, omega=0.0)}),
    *(
        Target(f, {**finite(vx=1.0, vy=0.0), **positive(r=0.05)})
        for f in (cx.passive_pulleys, cx.virtual_pulleys)
    ),
    Target(cx.rolling_motors, {**finite(ax=1.0, ay=0.0), **positive(r=0.05)}),
    Target(cx.slipping_motor, {**P, **finite(torque=1.0, tau_0=0.0, f_b=0.0)}),
    *(
        Target(f, {**P, "f": arg(FRICTIONS), "torques": TORQUES, "errata": arg(cx.Errata())})
        for f in (cx.dmn_1, cx.dmn_2, cx.dmn_3, cx.dmn_4)
    ),
    Target(
        cx.dynamic_model,
        {"number": arg(1), **P, "f": arg(FRICTIONS), "torques": TORQUES, "errata": ERRATA},
    ),
    Target(
        cx.needed_friction,
        {**P, "accelerations": PAIR, "torques": PAIR, "ground": PAIR, "errata": ERRATA},
    ),
    Target(cx.next_dmn, {"number": arg(1), "needed": arg(NEEDED), "available": PAIR}),
    Target(cx.outputs, {"solution": arg(SOLUTION), "errata": ERRATA}),
    Target(cx.simulate, {**RUN, "method": arg("consistent")}),
    Target(cx.simulate_consistent, {**RUN, **FLOW, "max_events": arg(8, "none", "count")}),
    Target(
        cx.simulate_as_printed, {**RUN, "dt": arg(0.1, "float32"), "errata": ERRATA},
    ),
    Target(cx.simulate_smoothed,
        {
            **RUN, **FLOW, "variant": arg("tanh", "whole"), "width": arg(1e-2, "positive", "float32"),
            "stribeck_speed": arg(0.1, "none", "positive", "float32"),
        },
    ),
    Target(cx.SmoothedCoreXY, {**MACHINE, **SMOOTH}),
    Target(cx.CoreXY, MACHINE),
    Target(
        cx.CoreXY.state,
        {
            **finite(x=0.0, y=0.0, vx=0.0, vy=0.0, theta_1=0.0, theta_2=0.0, t=0.0),
            **dict.fromkeys(("omega_1", "omega_2"), arg(0.0, "none", *FINITE)),
        },
        cx.CoreXY(PARAMETERS, VOLTAGE).state,
    ),
    Target(cx.measurement, {**MACHINE, "times": arg(TIMES, "times"), "integrator": RK4}),
    Target(
        cx.measurement_residuals,
        {
            "values": arg({"mu_s": 0.3}, "mapping"), "data": arg(DATA), **MACHINE,
            "times": arg(TIMES, "times"),
            "noise": arg(cx.MEASUREMENT_NOISE), "integrator": RK4,
        },
    ),
    Target(
        cx.with_noise,
        {"clean": arg(DATA), "key": arg(jax.random.key(0), "key"), "noise": arg(cx.MEASUREMENT_NOISE)},
    ),
    Target(
        cx.with_values, {"parameters": arg(PARAMETERS), "values": arg({"mu_s": 0.3}, "mapping")},
    ),
]  # fmt: skip
