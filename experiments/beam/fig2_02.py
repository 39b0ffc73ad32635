"""Fig. 2.2: the friction law, consistent and as printed."""

import numpy as np
import xarray as xr

from .._experiment import Context
from ._draw import draw_friction
from ._figure import figure
from ._model import VARIANTS, system_of


def compute(parameters, context: Context) -> xr.Dataset:
    """T_d over mu_s N from the model itself, on both sides of rest."""
    V = np.linspace(-parameters["V_max"], parameters["V_max"], parameters["points"])
    V = V[V != 0.0]
    curves = []
    for variant in VARIANTS:
        system = system_of(variant, 0.0)
        y = system.start(1.0)
        load = float(system.mu_s * system.normal_force(0.0, y, 0))
        force = [
            float(system.friction_force(0.0, y._replace(vy=u), 2 if u > 0 else 0)) / load for u in V
        ]
        # Next to the pole the printed law has no value that could be drawn.
        curves.append(np.where(np.abs(force) < 50, force, np.nan))
    return xr.Dataset(
        {"T_d": (("variant", "V"), np.array(curves), {"units": "1"})},
        {"variant": list(VARIANTS), "V": ("V", V, {"units": "1"})},
        {
            "pole": -1.0 / float(system_of("as printed", 0.0).gamma),
            "caption": "Constructed gamma = 10. As printed, 1 + gamma V has a pole at V = -1/gamma.",
        },
    )


TITLE = "Friction force over relative velocity, consistent and as printed"
PARAMETERS = {"V_max": 0.3, "points": 601}
EXPERIMENT = figure(2, TITLE, PARAMETERS, {"points": 61}, compute, draw_friction)
