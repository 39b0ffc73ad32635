"""Sweep of the belt speed: Poincaré points of all three coordinates, and how much the mass sticks."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.sweep import Variable, run_sweep
from stickslip.systems import JointedBeam

from .._experiment import Context
from ._model import (
    CAPTION,
    SECTIONS,
    STICK,
    VARIANTS,
    fixed_step,
    stick_section,
    sweep_options,
    system_of,
)

PARAMETERS = {
    "v_min": 1e-4, "v_max": 3e-2, "speeds": 2000, "transient": 300.0, "duration": 54.05,
    "direction": "falling", "max_points": 256, "h": 0.005, "modes": 5, "chunk": 256, "executor": "auto",
}  # fmt: skip
# So few lanes are done before a fused program is compiled.
QUICK = {"speeds": 16, "transient": 20.0, "duration": 10.81, "h": 0.01, "executor": "portable"}


def stick_share(system, t, y, mode, args):
    """Rate of the time spent in stick."""
    return {"stick": jnp.where(mode == STICK, 1.0, 0.0)}


def lane(variant: str, v: Any, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Points of one belt speed."""
    system = system_of(variant, v, parameters["modes"])
    return points(system, system.start(), parameters)


def points(system: JointedBeam, start: Any, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Poincaré points of all coordinates, and the stick, of one system from one start."""
    integrator = fixed_step(parameters["h"])
    begin = parameters["transient"]
    counted = WithIntegrals(system, stick_share)

    def section(function):
        return ss.Section(
            lambda counted, t, y, dy, mode, args: function(counted.system, t, y.y, None, mode, args),
            parameters["direction"],
        )

    sections = (*(section(f) for f in SECTIONS.values()), stick_section())
    settled = ss.simulate(
        counted, 0.0, begin, counted.start(start), integrator=integrator,
        saveat=ss.SaveAt(max_events=None), throw=False,
    )  # fmt: skip
    run = ss.simulate(
        counted, begin, begin + parameters["duration"], settled.y1, settled.mode1,
        integrator=integrator,
        saveat=ss.SaveAt(sections=sections, max_events=None, max_crossings=parameters["max_points"]),
        throw=False,
    )  # fmt: skip
    x, y, w, stick = run.crossings
    shares = run.y1.integrals["stick"] - settled.y1.integrals["stick"]
    return {
        "x": x.y.y.x,
        "y": y.y.y.y,
        "w": jax.vmap(lambda state: system.w(0.0, state))(w.y.y),
        "sticks": stick.count,
        "stick_share": shares / parameters["duration"],
        "ok": (settled.successful & run.successful).astype(jnp.int32),
    }


LABELS = {
    "v": Variable(units="1", long_name="belt speed v"),
    "x": Variable(("point",), "1", "x at x' = 0"),
    "y": Variable(("point",), "1", "y at y' = 0"),
    "w": Variable(("point",), "1", "w(z_A) at w' = 0"),
    "stick_share": Variable(units="1", long_name="share of the time in stick"),
    "sticks": Variable(units="1", long_name="beginnings of stick"),
}


def diagrams(
    parameters: Mapping[str, Any], context: Context, variants: tuple[str, ...] = VARIANTS
) -> xr.Dataset:
    """Points over belt speed for these readings of the equations."""
    speeds = np.linspace(parameters["v_min"], parameters["v_max"], parameters["speeds"])
    parts = [
        run_sweep(
            lambda v, variant=variant: lane(variant, v, parameters),
            {"v": speeds},
            **sweep_options(
                "diagram", variant, parameters, context, chunk=parameters["chunk"],
                variables=LABELS, executor=parameters["executor"],
            ),
        ).load()
        for variant in variants
    ]  # fmt: skip
    joined = xr.concat(parts, xr.Variable("variant", list(variants)), combine_attrs="override")
    caption = CAPTION.format(modes=parameters["modes"])
    return joined.assign_attrs(caption=caption, duration=parameters["duration"])
