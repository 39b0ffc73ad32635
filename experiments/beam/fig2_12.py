"""Fig. 2.12: the greatest Lyapunov exponent at v = 0.0005 as it converges."""

import jax
import numpy as np
import xarray as xr

from .._experiment import Context
from .._thresholds import Beam
from ._draw import draw_running
from ._exponent import NOTE, printed_separation, spectrum
from ._figure import figure
from ._model import CAPTION, VARIANTS


def compute(parameters, context: Context) -> xr.Dataset:
    """Running values of the greatest exponent, of the mass, and of (2.25) to the letter."""
    parts = []
    for variant in VARIANTS:
        program = jax.jit(
            lambda v, variant=variant: (
                spectrum(variant, v, parameters),
                printed_separation(variant, v, parameters),
            )
        )
        found, apart = program(parameters["v"])
        values = np.asarray(found.exponents)
        best = int(np.argmax(values))
        mass = int(np.flatnonzero(np.isfinite(values))[-1])
        running, error = np.asarray(found.running), np.asarray(found.error)
        parts.append(
            xr.Dataset(
                {
                    "greatest": ("time", running[:, best], {"units": "1"}),
                    "greatest_error": ((), error[best], {"units": "1"}),
                    "mass": ("time", running[:, mass], {"units": "1"}),
                    "mass_error": ((), error[mass], {"units": "1"}),
                    "letter": ("time", np.asarray(apart.running), {"units": "1"}),
                    "distance": ("time", np.asarray(apart.distance), {"units": "1"}),
                    "exponents": ("exponent", values, {"units": "1"}),
                    "error": ("exponent", error, {"units": "1"}),
                },
                {"time": ("time", np.asarray(found.time), {"units": "1"})},
            )
        )
    joined = xr.concat(parts, xr.Variable("variant", list(VARIANTS)))
    text = f"{CAPTION} {NOTE}".format(modes=parameters["modes"])
    return joined.assign_attrs(v=parameters["v"], caption=text)


TITLE = f"Running Lyapunov exponents at v = {Beam.SLOW:g}, by tangent dynamics and by Eq. (2.25)"
PARAMETERS = {
    "v": Beam.SLOW, "transient": 0.0, "segment": 0.5, "segments": 1600, "distance": 1e-8, "h": 0.005,
    "modes": 4,
}  # fmt: skip
EXPERIMENT = figure(12, TITLE, PARAMETERS, {"segments": 120}, compute, draw_running)
