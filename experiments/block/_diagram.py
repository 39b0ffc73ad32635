"""Bifurcation diagrams over k3 of both models, by the paper's protocol and by a converged one."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

import stickslip as ss
from stickslip.analysis import PeriodTest, Recording, orbit_diagram
from stickslip.sweep import Labels, Storage, Variable
from stickslip.systems import BlockOnBelt, BlockOnDrivenBelt, BlockState, DrivenBlockState

from .._experiment import Context
from ._drive import SIGNS, signed_drive
from ._exponent import largest_exponents
from ._sets import found_set, simplified, with_drive

# Frozen at the paper's 40 s with the first 15 s dropped; "converged" drops so much that the slowest
# branches of set A have settled, and then records a little more than the paper.
PROTOCOL = {
    "set": "A",  # or one that the search has found, see `_sets.FOUND`
    "k3_step": 0.001,
    "transient": 15.0,
    "duration": 25.0,
    "converged_transient": 200.0,
    "converged_duration": 40.0,
    "tolerance": 1e-8,  # of adaptive steps; 0 takes steps of h instead
    "h": 1e-3,
    "method": "tsit5",
    "exponents": 501,
    "max_points": 96,
}
# The paper's protocol alone: most of a quick look is tracing, and each protocol is traced by itself.
QUICK = {"k3_step": 0.5, "duration": 15.0, "converged_duration": 0.0, "exponents": 6}
MODELS = ("simplified", "full, sign as printed", "full, consistent sign")
CONSTRUCTED = (
    "Constructed parameters (set {set}): the paper prints none. 64-bit, {method} with {steps}, "
    "crossings located to rounding. Section: acceleration of m crosses zero from positive to negative."
)


def system_of(model: str, k3: Any, name: str = "A"):
    """The model at `k3` [N/m] with the parameter set `name`, and its initial state, all zero.

    Errors: `ValueError` for a set that is neither A nor one of those found.
    """
    return _built(model, k3, sign_of(model), name)


def sign_of(model: str) -> float:
    """Factor of the belt reaction in the model; of no meaning to the simplified one."""
    return SIGNS["printed" if "printed" in model else "consistent"]


def _built(model: str, k3: Any, sign: Any, name: str):
    if name != "A":
        values, pull = found_set(name)
        return simplified(values, k3) if model == "simplified" else with_drive(sign)(values, k3, pull)
    if model == "simplified":
        return BlockOnBelt.constructed(k3), BlockState(0.0, 0.0, 0.0, 0.0)
    start = DrivenBlockState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return BlockOnDrivenBelt.constructed(k3, drive=signed_drive(sign)), start


def lanes_of(model: str, k3: np.ndarray, name: str) -> tuple[Any, dict[str, Any]]:
    """`(**point) -> system` and the grid over k3, one function and one shape for both signs.

    The sign is a coordinate of one value: as an input it is not part of the program.
    """
    if model == "simplified":
        return lambda k3: _built(model, k3, 1.0, name)[0], {"k3": k3}
    return (
        lambda sign, k3: _built(model, k3, sign, name)[0],
        {"sign": np.array([sign_of(model)]), "k3": k3},
    )


def without_sign(result: xr.Dataset) -> xr.Dataset:
    """The dataset without the coordinate that only chose the program's input."""
    if "sign" not in result.dims:
        return result
    return result.isel(sign=0, drop=True).drop_vars("checked_sign", errors="ignore")


def protocols(parameters: Mapping[str, Any]) -> Iterator[tuple[str, float, float]]:
    """Name, time dropped and time recorded [s] of each protocol that is asked for."""
    yield "paper", parameters["transient"], parameters["duration"]
    if parameters["converged_duration"] > 0:
        yield "converged", parameters["converged_transient"], parameters["converged_duration"]


def diagrams(
    models: tuple[str, ...],
    low: float,
    high: float,
    parameters: Mapping[str, Any],
    context: Context,
    *,
    ends: bool = False,
) -> xr.Dataset:
    """Diagrams of the models over k3 from `low` to `high`, along the dimensions model and protocol.

    With `ends` the states at the end of each lane are kept.
    """
    count = round((high - low) / parameters["k3_step"]) + 1
    # Counted in steps, so that the windows fall on the very values of the whole diagram.
    first = low / parameters["k3_step"]
    first = round(first) if abs(first - round(first)) < 1e-6 else first
    k3 = (first + np.arange(count)) * parameters["k3_step"]
    per_model = []
    for model in models:
        parts = [
            _diagram(model, k3, dropped, kept, name, parameters, context, ends)
            for name, dropped, kept in protocols(parameters)
        ]
        names = [name for name, *_ in protocols(parameters)]
        joined = xr.concat(parts, xr.Variable("protocol", names), join="outer")
        if parameters["exponents"] > 0:
            joined = joined.merge(_exponents(model, k3, parameters, context))
        per_model.append(joined)
    result = xr.concat(
        per_model, xr.Variable("model", list(models)), join="outer", combine_attrs="override"
    )
    times = {name: (dropped, kept) for name, dropped, kept in protocols(parameters)}
    result = result.assign_coords(
        transient=("protocol", [times[n][0] for n in names], {"units": "s"}),
        duration=("protocol", [times[n][1] for n in names], {"units": "s"}),
    )
    return result.assign_attrs(
        caption=constructed(parameters),
        method=parameters["method"],
        h=parameters["h"],
        tolerance=parameters["tolerance"],
        set=parameters["set"],
    )


def constructed(parameters: Mapping[str, Any]) -> str:
    """Caption: what the parameters are and how the motion was computed."""
    tolerance, h = parameters["tolerance"], parameters["h"]
    steps = f"adaptive steps at {tolerance:g}" if tolerance > 0 else f"steps of {h:g} s"
    return CONSTRUCTED.format(set=parameters["set"], method=parameters["method"], steps=steps)


def integrator_of(parameters: Mapping[str, Any]) -> ss.Integrator:
    """Method and steps of an experiment: of length `h`, or adaptive if a `tolerance` is given."""
    tolerance = parameters["tolerance"]
    if tolerance > 0:
        step = ss.AdaptiveStep(tolerance, 0.1 * tolerance)
    else:
        step = ss.FixedStep(parameters["h"])
    return ss.Integrator(parameters["method"], step, max_steps=100_000_000)


def sweep_options(
    kind: str,
    model: str,
    settings: Mapping[str, Any],
    context: Context,
    *,
    chunk: int | None = None,
    **labels: Any,
) -> dict[str, Any]:
    """Where the lanes of one kind and model are kept, and how their sweep is labelled."""
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:8]
    word = {"simplified": "simplified"}.get(
        model, "full-" + ("printed" if "printed" in model else "consistent")
    )
    path = context.stores / f"block-{kind}-{word}-{digest}"
    return {
        "store": Storage(path, chunk=chunk, resume=not context.fresh),
        "labels": Labels(name=f"{kind}, {model}", **labels),
    }


LABELS = {
    "k3": Variable(units="N/m", long_name="stiffness k3"),
    "x": Variable(long_name="displacement x of the block"),
}


def _diagram(model, k3, transient, duration, protocol, parameters, context, ends) -> xr.Dataset:
    system, start = system_of(model, float(k3[0]), parameters["set"])
    keys = ("set", "h", "tolerance", "method", "max_points")
    settings = {
        "k3": [float(k3[0]), float(k3[-1]), k3.size],
        "times": [transient, duration],
        **{key: parameters[key] for key in keys},
    }
    build, grid = lanes_of(model, k3, parameters["set"])
    result = orbit_diagram(
        build,
        grid,
        start,
        Recording(
            transient, duration, system.zero_acceleration_section(), "x",
            max_points=parameters["max_points"], period=PeriodTest(1e-3),
        ),
        integrator=integrator_of(parameters),
        **sweep_options(f"diagram-{protocol}", model, settings, context, variables=LABELS),
    )  # fmt: skip
    dropped = [name for name in result.data_vars if str(name).startswith("end_") and not ends]
    return without_sign(result.drop_vars(dropped)).load()


def _exponents(model, k3, parameters, context) -> xr.Dataset:
    values = (
        k3
        if k3.size <= parameters["exponents"]
        else np.linspace(k3[0], k3[-1], parameters["exponents"])
    )
    dropped = max(parameters["transient"], min(parameters["converged_transient"], 100.0))
    settings = {
        "k3": [float(values[0]), float(values[-1]), values.size],
        "transient": dropped,
        "set": parameters["set"],
        "h": parameters["h"],
        "tolerance": parameters["tolerance"],
        "method": parameters["method"],
    }
    build, grid = lanes_of(model, values, parameters["set"])
    result = largest_exponents(
        build,
        grid,
        system_of(model, 85.0, parameters["set"])[1],
        transient=dropped,
        segments=100 if parameters["converged_transient"] >= 100 else 30,
        integrator=integrator_of(parameters),
        **sweep_options("exponent", model, settings, context, chunk=512),
    )
    return without_sign(result).rename(k3="k3_exponent").load()
