"""Right arguments of the analyses."""

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip import analysis, derived
from stickslip.systems import BlockOnBelt, BlockState
from tests.house._nonsense_engine import ARGS, INTEGRATOR, SWEEP, TIME, inside
from tests.house._nonsense_target import Target, arg

BLOCK = BlockOnBelt.constructed(k3=85.0)
SYSTEM = arg(BLOCK)
START = BlockState(0.0, 0.0, 0.0, 0.0)
MODE = arg(0, "none", "whole")
DURATION = arg(1.0, "positive", "float32")
TRANSIENT = arg(1.0, "not negative", "float32")
COMMON = {
    "system": SYSTEM, "y0": arg(START), "mode0": MODE, "args": ARGS, "integrator": INTEGRATOR,
}  # fmt: skip
SEGMENTS = analysis.Segments(1.0, 40, warm_up=4, blocks=4)
AVERAGE = {"record": arg(SEGMENTS), "components": arg(("x",), "none")}
SPECTRUM = analysis.Spectrum(jnp.arange(9.0), jnp.array([0, 1, 5, 1, 0, 2, 0.5, 0.2, 0.1]), "hann")
SECTION = ss.Section(lambda s, t, y, dy, m, a: dy.vx)
GRID = arg({"k3": [80.0, 81.0]})
BUILDER = arg(BLOCK)


def _logistic(z):
    return jax.tree.map(lambda x: 3.9 * x * (1.0 - x), z)


def _swept(function):
    return lambda store=None, **given: function(store=inside(store), **given)


TARGETS = [
    Target(
        analysis.lyapunov_spectrum,
        {**COMMON, **AVERAGE, "exponents": arg(1, "none"), "scales": arg(None, "none")},
    ),
    Target(
        analysis.period_of,
        {
            "points": arg([[0.0, 1.0], [1.0, 0.0]], "table"), "count": arg(2, "count"),
            "span": arg([[0.0, 0.0], [1.0, 1.0]]), "tolerance": arg(1e-3, "positive", "float32"),
            "max_period": arg(4), "start": arg(None, "none", "row", "nan row"),
            "periods": arg(None, "none", "circles"),
        },
    ),
    Target(
        analysis.two_trajectory_exponent,
        {
            **COMMON, **AVERAGE, "distance": arg(1e-3, "positive", "float32"),
            "renormalise": arg(True, "flag"),
        },
    ),
    Target(analysis.volume_growth, {**COMMON, "record": arg(SEGMENTS), "max_events": arg(8)}),
    Target(
        analysis.lyapunov_diagram,
        {
            "system": BUILDER, "grid": GRID, "y0": arg(START), "record": arg(SEGMENTS),
            "scales": arg(None, "none"),
            "spectrum": arg(None, "none", "mapping"), **SWEEP,
        },
        _swept(analysis.lyapunov_diagram),
    ),
    Target(
        analysis.lyapunov_spectrum_of_map,
        {
            "function": arg(_logistic), "z0": arg(0.3, "states"),
            "record": arg(analysis.Segments(1, 40, blocks=4)), "exponents": arg(1, "none"),
        },
    ),
    Target(
        analysis.time_history,
        {
            **COMMON, "record": arg([0.0, 1.0], "times"), "observables": arg("x"),
            "sections": arg(None, "none", "mapping"), "labels": arg(None, "none"),
        },
    ),
    Target(
        analysis.energy_ledger,
        {**COMMON, "record": arg([0.0, 1.0], "times"), "max_events": arg(8)},
    ),
    Target(
        analysis.orbit_diagram,
        {
            **COMMON, "system": BUILDER, "grid": GRID,
            "record": arg(analysis.Recording(1.0, 1.0, SECTION, "x", max_points=8, check=0)),
            "carried": arg(None, "none"), **SWEEP,
        },
        _swept(analysis.orbit_diagram),
    ),
    Target(
        analysis.Recording,
        {
            "transient": TRANSIENT, "duration": DURATION, "section": arg(SECTION),
            "observables": arg("x"), "points": arg(4, "none"), "max_points": arg(8),
            "period": arg(analysis.PeriodTest()), "domain": arg((), "none of them", "constant"),
            "check": arg(0, "count"), "t0": arg(0.0, "finite"),
        },
        lambda **given: analysis.orbit_diagram(
            BLOCK, {"k3": [80.0, 81.0]}, START, analysis.Recording(**given)
        ),
    ),
    Target(
        analysis.Samples,
        {"ts": arg([0.0, 1.0], "times"), "transient": TRANSIENT, "max_points": arg(8)},
    ),
    Target(
        analysis.Segments,
        {
            "length": DURATION, "count": arg(40), "transient": TRANSIENT,
            "warm_up": arg(4, "none", "count"), "blocks": arg(4), "t0": arg(0.0, "finite"),
        },
    ),
    Target(
        analysis.PeriodTest,
        {"tolerance": arg(1e-4, "positive", "float32"), "longest": arg(4)},
    ),
    Target(analysis.Maximum, {"observable": arg("x", "text", "constant")}),
    Target(analysis.Minimum, {"observable": arg("x", "text", "constant")}),
    Target(
        analysis.amplitude_spectrum,
        {"signal": arg(np.arange(16.0)), "dt": DURATION, "window": arg("hann"), "axis": arg(0, "axis")},
    ),
    Target(
        analysis.spectral_peaks,
        {
            "spectrum": arg(SPECTRUM), "count": arg(3), "floor": arg(1e-3, "not negative", "float32"),
            "bases": arg({"f": 1.0}, "none", "unknowns", "mapping"), "tolerance": DURATION,
        },
    ),
    Target(
        analysis.divergence,
        {
            "system": SYSTEM, "t": TIME, "y": arg(START), "mode": arg(0, "whole"), "args": ARGS,
        },
    ),
    Target(derived.WithDeviations, {"system": SYSTEM}),
]  # fmt: skip
