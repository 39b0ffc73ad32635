"""Motion at one belt speed: time histories, spectra, powers."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from stickslip.analysis import Samples, amplitude_spectrum, time_history
from stickslip.sweep import Labels, Variable

from ._model import CAPTION, VARIANTS, accurate, stick_section, system_of

PARAMETERS = {"duration": 400.0, "dropped": 200.0, "dt": 0.01, "shown": 10.0, "modes": 5}
QUICK = {"duration": 60.0, "dropped": 20.0}
OBSERVABLES = {
    "x": "x", "vx": "vx", "y": "y", "vy": "vy", "w": "w", "w_rate": "w_rate",
    "W_f": "friction_power", "W_b": "beam_power",
}  # fmt: skip


def motions(v: float, parameters: Mapping[str, Any]) -> xr.Dataset:
    """Histories from the start, and amplitude spectra of what follows the first `dropped` units."""
    t = np.arange(0.0, parameters["duration"] + 0.5 * parameters["dt"], parameters["dt"])
    parts = []
    for variant in VARIANTS:
        system = system_of(variant, v, parameters["modes"])
        history = time_history(
            system, system.start(), Samples(t, max_points=4096), OBSERVABLES, integrator=accurate(),
            sections={"stick": stick_section()},
            labels=Labels(dict.fromkeys(OBSERVABLES, Variable(units="1"))),
        )  # fmt: skip
        kept = history[[*OBSERVABLES, "mode"]]
        late = t >= parameters["dropped"]
        for name in OBSERVABLES:
            spectrum = amplitude_spectrum(history[name].values[late], parameters["dt"])
            kept[f"{name}_amplitude"] = ("frequency", np.asarray(spectrum.amplitude), {"units": "1"})
            frequency = np.asarray(spectrum.frequency)
        onsets = np.full(4096, np.nan)
        begins = history.at_stick_t.values
        onsets[: begins.size] = begins
        kept["stick_begins"] = ("stick", onsets, {"units": "1"})
        kept = kept.assign_coords(frequency=("frequency", frequency, {"units": "1"}))
        parts.append(kept.drop_attrs())
    joined = xr.concat(parts, xr.Variable("variant", list(VARIANTS)))
    joined["time"].attrs["units"] = "1"
    return joined.assign_attrs(
        v=v,
        caption=CAPTION.format(modes=parameters["modes"]),
        dropped=parameters["dropped"],
        shown=parameters["shown"],
        mode_names=list(system.mode_names),
    )
