"""Right arguments of periodic orbits and their branches."""

import os

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip import continuation, plot
from stickslip.continuation._frequency_response import Solver
from stickslip.hybrid import EventLog
from stickslip.systems import Motion
from tests.house._nonsense_engine import (
    ARGS,
    INSIDE,
    INTEGRATOR,
    MODE,
    OSCILLATOR,
    START,
    STATE,
    SYSTEM,
    TIME,
)
from tests.house._nonsense_target import Target, arg

ONE, ZERO, NONE = jnp.asarray(1.0), jnp.zeros((), jnp.int32), jnp.zeros(0)
ROWS = np.ones(1)
CODES, POINT = jnp.zeros(0, jnp.int32), Motion(ONE, ONE)
ORBIT = continuation.PeriodicOrbit(
    ONE, POINT, ZERO, ONE, jnp.zeros(1, complex), ONE, ZERO, ZERO, jnp.eye(2), ONE, ONE, ONE, ONE, ZERO,
    POINT, POINT, EventLog(ZERO, NONE, CODES, CODES, CODES, Motion(NONE, NONE), Motion(NONE, NONE)),
    jnp.zeros((), jnp.uint32), ZERO, continuation.ORBITS.successful, ss.RESULTS.successful,
    jnp.zeros((2, 2)), POINT, POINT,
)  # fmt: skip
ROW = jax.tree.map(lambda leaf: leaf[None], ORBIT)
BRANCH = continuation.Branch(("belt_speed",), np.array([0.2]), ROW, ((0,),), (), OSCILLATOR)
SPECIAL = continuation.BranchPoint("PD", np.array([0.2]), ORBIT, "", 0, np.zeros(4), OSCILLATOR)
FOLLOW, SHOOTING = continuation.Follow(), continuation.Shooting()
FORCING = continuation.Forcing("belt_speed")
FORCED = continuation.Forcing("belt_speed", "x")
OBSERVABLES = arg("x", "none")
TABLE, MANY = {"x": np.ones(1)}, {"x": np.ones((1, 5), complex)}
RESPONSES = continuation.ForcedResponse(
    ROWS, ROWS, Motion(ROWS, ROWS), ZERO[None], TABLE, TABLE, TABLE, MANY, MANY["x"][:, :2], ZERO[None],
    ROWS, np.zeros(1, bool), ZERO[None], jnp.zeros(1, jnp.uint32), ZERO[None],
    jax.tree.map(lambda code: code[None], ORBIT.result),
)  # fmt: skip
SOLVER = Solver(OSCILLATOR, None, None, FORCING, (("x", None),), 8)
RESPONSE = continuation.FrequencyResponse(np.array([0.2]), RESPONSES, BRANCH, ((0,),), SOLVER)
BACKBONE = continuation.Backbone("stiffness", *(np.ones(1),) * 4, RESPONSES)


def inside(path):
    """Not in the working directory."""
    named = isinstance(path, str | os.PathLike) and os.fspath(path)
    return f"{INSIDE.name}/{os.fspath(path)}" if named else path


def _saved() -> str:
    return str(continuation.save_branch(BRANCH, f"{INSIDE.name}/branch.nc"))


PERIOD = arg(1.0, "positive", "float32")
COUNT = arg(8)
TARGETS = [
    Target(
        continuation.OrbitGuess,
        {
            "y0": arg(START, "states"), "period": PERIOD, "mode0": arg(0, "none", "whole", "text"),
            "t0": TIME, "turns": arg(None, "none", "entries"),
        },
    ),
    Target(
        continuation.orbit_guess,
        {
            "system": SYSTEM, "y0": STATE, "transient": arg(1.0, "not negative", "float32"),
            "max_period": PERIOD, "forcing_period": arg(None, "none"), "t0": TIME, "mode0": MODE,
            "args": ARGS, "shooting": arg(SHOOTING),
        },
    ),
    Target(
        continuation.Follow,
        {
            "step": arg(0.01, "positive", "float32"), "max_points": COUNT, "both": arg(True, "flag"),
            "values": arg((0.15, 0.2), "none of them"), "tests": arg({}, "mapping"),
        },
    ),
    Target(
        continuation.Shooting,
        {"segments": arg(2), "integrator": INTEGRATOR, "max_events": COUNT},
    ),
    Target(
        continuation.periodic_orbit,
        {
            "system": SYSTEM, "guess": arg(continuation.OrbitGuess(START, 1.0, 0)),
            "forced": arg(True, "flag"), "shooting": arg(SHOOTING), "tolerance": PERIOD,
            "max_steps": COUNT, "args": ARGS,
        },
    ),
    Target(
        continuation.continue_orbit,
        {
            "system": SYSTEM, "orbit": arg(ORBIT), "parameter": arg("belt_speed"),
            "bounds": arg((0.1, 0.3)), "forcing_period": arg(None, "none"), "follow": arg(FOLLOW),
            "shooting": arg(SHOOTING), "args": ARGS,
        },
    ),
    Target(
        continuation.continue_point,
        {
            "system": SYSTEM, "point": arg(SPECIAL), "parameters": arg(("belt_speed", "stiffness")),
            "bounds": arg(((0.1, 0.3), (0.5, 2.0))), "forcing_period": arg(None, "none"),
            "follow": arg(FOLLOW), "shooting": arg(SHOOTING), "args": ARGS,
        },
    ),
    Target(
        continuation.continue_equilibrium,
        {
            "system": SYSTEM, "y0": arg(START), "parameter": arg("belt_speed"),
            "bounds": arg((0.1, 0.3)), "mode0": MODE, "follow": arg(FOLLOW), "args": ARGS,
        },
    ),
    Target(
        continuation.Forcing,
        {
            "frequency": arg("w", "text"), "force": arg(None, "none", "text", "function"),
            "period": arg(None, "none"), "harmonics": COUNT,
        },
    ),
    Target(
        continuation.forced_response,
        {
            "system": SYSTEM, "y0": STATE, "forcing": arg(FORCING), "observables": OBSERVABLES,
            "periods": COUNT, "mode0": MODE, "shooting": arg(SHOOTING), "args": ARGS,
        },
    ),
    Target(
        continuation.frequency_response,
        {
            "system": SYSTEM, "y0": STATE, "frequencies": arg((0.1, 0.3)), "forcing": arg(FORCING),
            "observables": OBSERVABLES, "follow": arg(FOLLOW), "shooting": arg(SHOOTING), "args": ARGS,
        },
    ),
    Target(
        continuation.backbone,
        {
            "system": SYSTEM, "y0": STATE, "level": arg("stiffness"), "values": arg([1.0, 2.0]),
            "forcing": arg(FORCED), "observable": arg("x", "none"), "energy": arg(None, "none"),
            "shooting": arg(SHOOTING), "args": ARGS,
        },
    ),
    Target(
        continuation.FrequencyResponse.peak, {"observable": arg("x", "none")}, RESPONSE.peak
    ),
    Target(
        plot.frequency_response,
        {
            "found": arg(RESPONSE), "observable": arg("x", "none"), "phase": arg(False, "flag"),
            "ax": arg(None, "none"),
        },
    ),
    Target(plot.backbone, {"found": arg(BACKBONE), "ax": arg(None, "none")}),
    Target(
        continuation.save_branch,
        {"branch": arg(BRANCH), "path": arg("branch.nc", "path")},
        lambda branch, path: continuation.save_branch(branch, inside(path)),
    ),
    Target(
        continuation.load_branch,
        {"path": arg(_saved(), "path"), "system": SYSTEM, "y0": arg(START, "states")},
    ),
    Target(
        plot.branch,
        {
            "branch": arg(BRANCH), "observable": arg("period", "none"), "lowest": arg(False, "flag"),
            "ax": arg(None, "none"),
        },
    ),
    Target(plot.multipliers, {"orbits": arg(BRANCH), "ax": arg(None, "none")}),
    Target(
        plot.orbit,
        {
            "branch": arg(BRANCH), "at": arg(0, "axis"), "x": arg("x", "none", "function"),
            "y": arg("v", "none", "function"), "args": ARGS, "ax": arg(None, "none"),
        },
    ),
]  # fmt: skip
