"""Right arguments of the identification."""

import pathlib
import tempfile

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from stickslip import identification
from stickslip.identification._unknowns import scalars
from stickslip.systems import CoulombOscillator, Motion
from tests.house._nonsense_engine import INTEGRATOR
from tests.house._nonsense_target import Target, arg

UNKNOWN = {"a": 2.0}
RESIDUAL = arg(lambda p, *shared: p["a"][None], "function")
FITS = identification.Fit(
    {"a": jnp.ones(2)}, jnp.ones((2, 3)),
    eqx.filter_vmap(lambda m: identification.Sensitivity(("a",), m))(jnp.ones((2, 3, 1))),
    jnp.ones(2, jnp.int32), scalars("start", {"a": 1.0})[0], jnp.zeros(2, jnp.int32),
)  # fmt: skip
LEVENBERG = {
    "damping": arg(1.0, "positive", "float32"), "tolerance": arg(1e-8, "positive", "float32"),
    "max_steps": arg(8),
}  # fmt: skip
LOSS = arg(None, "none")
LANES = {"chunk_size": arg(2, "none"), "executor": arg("portable")}
RECORD = identification.Record([0.0, 1.0], {"x": [0.0, 0.1]})
FOLDER = tempfile.TemporaryDirectory()
TABLE = f"{FOLDER.name}/table.csv"
pathlib.Path(TABLE).write_text("t,x\n0,1\n", encoding="utf-8")


def _block(values, inputs):
    return CoulombOscillator(1.0, values["a"], 1.0, 0.5, 0.2)


def _start(values, inputs):
    return Motion(x=0.0, v=0.2)


OBSERVED = {"x": identification.Observed(lambda t, y, system: y.x, 0.1)}
PROBLEM = identification.Problem(_block, _start, UNKNOWN, OBSERVED, RECORD)
SIGNAL = identification.Signal([0.0, 1.0], [0.0, 1.0])
ROW = arg([0.0, 1.0], "times")
DAMPED = {**LEVENBERG, "loss": LOSS}
MEASURED = [
    Target(identification.LevenbergMarquardt, DAMPED),
    Target(
        identification.GaussNewton,
        {name: one for name, one in DAMPED.items() if name != "damping"},
    ),
    Target(
        identification.GradientDescent,
        {
            "optimiser": arg(None, "none"), "steps": arg(3),
            "tolerance": arg(0.1, "positive", "float32"), "loss": LOSS,
        },
    ),
    Target(identification.Huber, {"corner": arg(1.0, "positive")}),
    Target(identification.SoftL1, {"corner": arg(1.0, "positive")}),
    Target(
        identification.MultipleShooting,
        {
            "segments": arg(4), "guess": arg(None, "none", "function"), "weights": arg((1.0, 0.1)),
            "max_steps": arg(4), "polish": arg(identification.LevenbergMarquardt(1.0)),
        },
    ),
    Target(
        identification.Homotopy,
        {
            "widths": arg((1.0, 0.1)), "smooth": arg(None, "none", "function"),
            **dict.fromkeys(("method", "polish"), arg(identification.LevenbergMarquardt(1.0))),
        },
    ),
    Target(
        identification.KalmanFilter,
        dict.fromkeys(("process", "spread"), arg(lambda p, inputs: None, "function")),
    ),
    Target(
        identification.Observed,
        {
            "function": arg(lambda t, y, system: y.x, "function"),
            "sd": arg(0.1, "positive", "float32", "none"), "unit": arg("m", "text", "empty text"),
            "quantum": arg(None, "none", "positive", "float32"),
        },
    ),
    Target(
        identification.Signal,
        {"times": ROW, "values": arg([0.0, 1.0], "row"), "kind": arg("hold")},
    ),
    Target(
        identification.Record,
        {
            "times": ROW, "values": arg({"x": [0.0, 1.0]}), "inputs": arg(None, "none", "mapping"),
            "missing": arg(None, "none", "mapping"), "known": arg(None, "none", "entries"),
            "begin": arg(None, "none", "finite", "float32"), "interpolation": arg("hold"),
            "units": arg(None, "none", "mapping"), "name": arg("", "text", "empty text"),
        },
    ),
    Target(
        identification.Record.from_table,
        {
            "table": arg({"t": [0.0, 1.0], "x": [0.0, 1.0]}), "time": arg("t"),
            "values": arg(("x",)), "inputs": arg((), "none of them", "none", "mapping"),
            "from_units": arg(None, "none", "mapping"),
        },
    ),
    Target(
        identification.noise_level,
        {
            "series": arg(np.arange(9.0) ** 2), "quantum": arg(None, "none", "positive", "float32"),
        },
    ),
    Target(
        identification.read_table,
        {
            "path": arg(TABLE), "columns": arg(None, "none"), "decimal": arg("."),
            "skip": arg(0, "count"),
        },
    ),
    Target(
        identification.Problem,
        {
            "system": arg(_block, "function"), "initial_state": arg(_start, "function"),
            "unknowns": arg(UNKNOWN, "unknowns"), "observed": arg(OBSERVED), "records": arg(RECORD),
            "integrator": INTEGRATOR, "delay": arg(None, "none"),
            "correct": arg(None, "none", "function"),
        },
    ),
    Target(
        identification.sobol_starts,
        {
            "unknowns": arg(UNKNOWN, "unknowns"), "count": arg(4), "spread": arg(2.0, "positive"),
            "seed": arg(0, "count"),
        },
    ),
]  # fmt: skip
FITTED = [
    Target(
        identification.least_squares,
        {
            "residual": RESIDUAL, "start": arg(UNKNOWN, "unknowns"),
            "method": arg(identification.LevenbergMarquardt(1.0), "none"),
        },
    ),
    Target(
        identification.many_starts,
        {
            "residual": RESIDUAL, "starts": arg({"a": [1.0, 2.0]}), "shared": arg(1.0, "shared"),
            "method": arg(identification.LevenbergMarquardt(1.0), "none"), **LANES,
            "progress": arg(None, "none", "flag"),
        },
        lambda residual, starts, shared, **given: identification.many_starts(
            residual, starts, shared, **given
        ),
    ),
    Target(
        identification.sensitivities,
        {
            "residual": RESIDUAL, "values": arg({"a": [1.0, 2.0]}),
            "each": arg(np.ones(2), "shared"), **LANES},
        lambda residual, values, each, **given: identification.sensitivities(
            residual, values, each, **given
        ),
    ),
    Target(
        identification.CMAES,
        {
            "rounds": arg(2), "population": arg(8), "seed": arg(0, "count"),
            "start": arg(None, "none", "reals"),
        },
    ),
    Target(
        identification.design_input,
        {
            "residual": RESIDUAL, "values": arg(UNKNOWN, "unknowns"),
            "low": arg(np.zeros(3), "finite", "float32"),
            "high": arg(np.ones(3), "positive", "float32"),
            "shared": arg(1.0, "shared"), "criterion": arg("D"),
            "about": arg(None, "none"), "search": arg(None, "none"), **LANES,
        },
        lambda residual, values, low, high, shared, **given: identification.design_input(
            residual, values, low, high, shared, **given
        ),
    ),
    Target(
        identification.sensitivity, {"residual": RESIDUAL, "values": arg(UNKNOWN, "unknowns")},
    ),
    Target(identification.best, {"fits": arg(FITS)}),
    Target(
        identification.Normal,
        {"mean": arg(0.0, "finite", "float32"), "sd": arg(1.0, "positive", "float32")},
    ),
    Target(
        identification.Unknown,
        {
            "start": arg(0.5, "batch", "float32", "finite"), "bounds": arg((None, None)),
            "prior": arg(None, "none"), "unit": arg("m", "text", "empty text"),
            "per_record": arg(False, "flag"), "scale": arg(None, "none", "positive", "float32"),
        },
    ),
]  # fmt: skip
BEST = identification.best(FITS)
SAVED = tempfile.TemporaryDirectory()

ROWS = {"x": np.zeros(2)}
PREDICTION = identification.Prediction(
    RECORD.times, ROWS, ROWS, ROWS, ROWS, ROWS, level=0.95, units={"x": ""}, record=RECORD
)
READ = [
    Target(identification.load_fit, {"path": arg(str(BEST.save(f"{SAVED.name}/fit.nc")), "path")}),
]
TARGETS = [*READ, *FITTED, *MEASURED]
