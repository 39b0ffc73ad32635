"""Lyapunov exponents over belt speed: the beam and the mass, and Eq. (2.25) to the letter."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from stickslip.analysis import (
    LyapunovSpectrum,
    Segments,
    Separation,
    lyapunov_diagram,
    lyapunov_spectrum,
    two_trajectory_exponent,
)
from stickslip.sweep import Variable, run_sweep

from .._experiment import Context
from ._model import CAPTION, VARIANTS, fixed_step, norm_of, sweep_options, system_of

DRIVEN = ("y", "vy", "q", "p")
PARAMETERS = {
    "v_min": 1e-4, "v_max": 3e-2, "speeds": 300, "transient": 200.0, "segment": 0.5, "segments": 800,
    "distance": 1e-8, "h": 0.005, "modes": 4, "chunk": 32,
}  # fmt: skip
QUICK = {"speeds": 8, "transient": 40.0, "segments": 120}
NOTE = (
    "x moves by itself and is neutral (two exponents of 0), and so is the fifth mode, with its node at "
    "the joint: the exponents are those of y and of {modes} modes."
)


def options(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Options of the spectrum: all exponents of the driven part."""
    return {"components": DRIVEN, "integrator": fixed_step(parameters["h"])}


def segments_of(parameters: Mapping[str, Any], transient: Any = 0.0) -> Segments:
    """How long, after a transient, the growth is averaged."""
    return Segments(parameters["segment"], parameters["segments"], transient)


def spectrum(variant: str, v: Any, parameters: Mapping[str, Any]) -> LyapunovSpectrum:
    """All exponents of the driven part at one belt speed."""
    system = system_of(variant, v, parameters["modes"])
    return lyapunov_spectrum(
        system, system.start(), segments_of(parameters, parameters["transient"]),
        scales=norm_of(system), **options(parameters),
    )  # fmt: skip


def printed_separation(variant: str, v: Any, parameters: Mapping[str, Any]) -> Separation:
    """Eq. (2.25) to the letter: two motions from neighbouring starts, never brought together again."""
    system = system_of(variant, v, parameters["modes"])
    return two_trajectory_exponent(
        system,
        system.start(),
        segments_of(parameters),
        distance=parameters["distance"],
        renormalise=False,
        integrator=fixed_step(parameters["h"]),
    )


def exponents(parameters: Mapping[str, Any], context: Context) -> xr.Dataset:
    """Both over the belt speeds and both readings of the equations."""
    speeds = np.linspace(parameters["v_min"], parameters["v_max"], parameters["speeds"])
    speed = Variable(units="1", long_name="belt speed v")
    letter = Variable(units="1", long_name="last value of (2.25)")
    parts = []
    for variant in VARIANTS:

        def separation(v, variant=variant):
            # To the letter: what it comes out as, though the distance has long saturated.
            return {"letter": printed_separation(variant, v, parameters).running[-1]}

        both = [
            lyapunov_diagram(
                lambda v, variant=variant: system_of(variant, v, parameters["modes"]),
                {"v": speeds},
                lambda system: system.start(),
                segments_of(parameters, parameters["transient"]),
                scales=norm_of,
                spectrum=options(parameters),
                **sweep_options(
                    "spectrum", variant, parameters, context,
                    chunk=parameters["chunk"], variables={"v": speed},
                ),
            ),
            run_sweep(
                separation,
                {"v": speeds},
                **sweep_options(
                    "letter", variant, parameters, context, chunk=2 * parameters["chunk"],
                    variables={"v": speed, "letter": letter},
                ),
            ),
        ]  # fmt: skip
        parts.append(xr.merge([p.load() for p in both], combine_attrs="override"))
    joined = xr.concat(parts, xr.Variable("variant", list(VARIANTS)), combine_attrs="override")
    caption = CAPTION.format(modes=parameters["modes"]) + " " + NOTE.format(modes=parameters["modes"])
    return joined.assign_attrs(caption=caption)
