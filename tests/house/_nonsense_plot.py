"""Right arguments of the pictures, and of what makes tables of solutions."""

import jax.numpy as jnp
import matplotlib
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import analysis, plot
from stickslip.hybrid import EventLog, StateLog
from stickslip.hybrid._solution import Stats
from stickslip.systems import Motion
from tests.house._nonsense_engine import OSCILLATOR
from tests.house._nonsense_identification import PREDICTION
from tests.house._nonsense_report import ONE
from tests.house._nonsense_target import Target, arg

matplotlib.use("agg")

ROWS = jnp.asarray([0.0, 1.0])
LOG = StateLog(
    jnp.asarray(2, jnp.int32), ROWS, Motion(ROWS, ROWS), Motion(ROWS, ROWS), jnp.zeros(2, jnp.int32)
)
ZERO = jnp.zeros((), jnp.int32)
RUN = ss.Solution(
    ROWS[0], ROWS[1], Motion(ROWS[1], ROWS[1]), Motion(ROWS[1], ROWS[1]), ZERO, LOG, None, None, (),
    ss.RESULTS.successful, ZERO, jnp.nan * ROWS[0], ZERO - 1,
    jnp.zeros((), jnp.uint32), Stats(ZERO, ZERO, ZERO), (),
)  # fmt: skip
CODES = jnp.zeros(2, jnp.int32)
EVENTS = EventLog(LOG.count, ROWS, CODES, CODES, CODES, Motion(ROWS, ROWS), Motion(ROWS, ROWS))
DIAGRAM = xr.Dataset({"x": (("k", "point"), np.ones((2, 3)))}, {"k": [0.0, 1.0]})
LEDGER = xr.Dataset(
    {name: ("time", np.zeros(3)) for name in ("energy", "loss_at_events", "imbalance")},
    {"time": [0.0, 1.0, 2.0]},
)
SPECTRUM = analysis.Spectrum(jnp.arange(3.0), jnp.ones(3), "hann")
MOVIE = plot.Movie(Figure(), lambda i: None, 2, 20)
EXPONENTS = analysis.LyapunovSpectrum(
    jnp.zeros(1), jnp.zeros(1), jnp.zeros((4, 1)), jnp.arange(4.0), jnp.zeros(1, jnp.int32), 1.0, ROWS
)
AX = arg(None, "none")
# A number, the name of an observable, or a function f(t, y) of what is read when it is drawn.
QUANTITY = ("finite", "text", "function")
CONTACT = arg(None, "none", "text")
ARGS = arg(None, "handed on")
TARGETS = [
    Target(
        ss.Solution.to_dataset,
        {"system": arg(OSCILLATOR), "batch": arg(None, "none", "none of them", "mapping")},
        RUN.to_dataset,
    ),
    Target(ss.Solution.to_dataframe, {"system": arg(OSCILLATOR)}, RUN.to_dataframe),
    Target(EventLog.to_dataframe, {"system": arg(OSCILLATOR)}, EVENTS.to_dataframe),
    Target(
        plot.motion,
        {
            "solution": arg(RUN), "system": arg(OSCILLATOR),
            "observables": arg("x", "none", "function"), "lane": arg(None, "none"),
            "contacts": arg(None, "none", "none of them"), "events": arg(True, "flag"), "args": ARGS,
            "ax": AX,
        },
    ),
    Target(
        plot.phase_plane,
        {
            "solution": arg(RUN), "system": arg(OSCILLATOR), "x": arg("x", "none", "function"),
            "y": arg("v", "none", "function"), "args": ARGS, "ax": AX,
        },
    ),
    Target(plot.orbit_diagram, {"dataset": arg(DIAGRAM), "observable": arg("x", "none"), "ax": AX}),
    Target(
        plot.spectrum,
        {
            "found": arg(SPECTRUM), "unit": arg("m", "none", "text"),
            "bases": arg(None, "none", "mapping", "unknowns"), "ax": AX,
        },
    ),
    Target(plot.exponents, {"found": arg(EXPONENTS), "ax": AX}),
    Target(
        plot.fit,
        {"found": arg(ONE), "problem": arg(None, "none"), "record": arg(0, "count"), "ax": AX},
    ),
    Target(plot.prediction, {"found": arg(PREDICTION), "ax": AX}),
    Target(plot.energy_account, {"dataset": arg(LEDGER), "ax": AX}),
    Target(
        plot.shade,
        {
            "time": arg(np.arange(2.0), "row"), "holds": arg(np.array([True, False]), "mask"),
            "label": arg(None, "none", "text"), "color": arg("0.8"), "ax": AX,
        },
    ),
    Target(
        plot.Block,
        {
            "x": arg(0.0, *QUANTITY), "y": arg(0.0, *QUANTITY), "width": arg(None, "none", "positive"),
            "height": arg(None, "none", "positive"), "contact": CONTACT,
        },
    ),
    Target(plot.Belt, {"speed": arg(0.0, *QUANTITY), "y": arg(None, "none", "finite")}),
    Target(plot.Wall, {"x": arg(0.0, *QUANTITY), "y": arg(0.0, *QUANTITY)}),
    Target(plot.Spring, {"start": arg(0.0, *QUANTITY), "end": arg("x", *QUANTITY)}),
    Target(plot.Damper, {"start": arg(0.0, *QUANTITY), "end": arg("x", *QUANTITY)}),
    Target(
        plot.Pendulum,
        {
            "angle": arg(0.0, *QUANTITY), "pivot": arg((0.0, 0.0), *QUANTITY),
            "length": arg(1.0, "positive"), "contact": CONTACT,
        },
    ),
    Target(
        plot.coil,
        {
            "start": arg((0.0, 0.0), "two numbers", "row"),
            "end": arg((1.0, 0.0), "two numbers", "row"),
            "turns": arg(6), "width": arg(1.0, "positive"),
        },
    ),
    Target(
        plot.animate,
        {
            "solution": arg(RUN), "system": arg(OSCILLATOR), "draw": arg([plot.Block("x")], "none"),
            "observables": arg(None, "none", "function"), "lane": arg(None, "none"), "args": ARGS,
            "speed": arg(1.0, "float32"), "per_second": arg(20),
        },
    ),
    Target(
        plot.Movie,
        {
            "figure": arg(Figure()), "update": arg(print, "function"), "frames": arg(2),
            "per_second": arg(20),
        },
    ),
    Target(plot.Movie.save, {"path": arg("a.gif"), "dpi": arg(80)}, MOVIE.save),
    Target(plot.Movie.still, {"frame": arg(0, "none", "count")}, MOVIE.still),
]  # fmt: skip
