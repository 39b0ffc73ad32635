"""Branches of the periodic orbit over the belt speed, under the diagrams of Fig. 2.3."""

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
import xarray as xr

import stickslip as ss
from stickslip.continuation import Branch, Follow, OrbitGuess, PeriodicOrbit, Shooting, continue_orbit

from .._experiment import Context
from ._diagram import PARAMETERS, diagrams
from ._model import STICK, VARIANTS, system_of
from ._pressed import PressedBeam, pressed

WORDS = (
    " Lines: the orbit whose period is that of the bounce, with its greatest y. Bounce given in closed "
    "form."
)


def with_branches(parameters: Mapping[str, Any], context: Context) -> xr.Dataset:
    """Diagrams, and branches from `follow_min` to `follow_max`: without damping, and with a little."""
    variants = VARIANTS if parameters["variants"] == "all" else VARIANTS[:1]
    lanes = {name: parameters[name] for name in PARAMETERS}
    found = diagrams(lanes, context, variants)
    dampings = sorted({0.0, float(parameters["damping"])})
    branches = [
        (variant, damping, followed(variant, damping, parameters))
        for variant in variants
        for damping in dampings
    ]
    attrs = {**found.attrs, "caption": found.attrs["caption"] + WORDS, "damping": dampings[-1]}
    return found.merge(as_table(branches)).assign_attrs(attrs)


def followed(variant: str, damping: float, parameters: Mapping[str, Any]) -> Branch:
    """The branch of the orbit near which the paper's start is, to both sides."""
    beam = system_of(variant, parameters["follow_from"], parameters["modes"], damping=damping)
    system = pressed(beam)
    # A deviation of the fastest mode is not seen by the control of steps, which looks at the motion.
    longest = parameters["longest_step"] * float(system.time_scale(None))
    rule = ss.AdaptiveStep(parameters["orbit_tolerance"], dtmax=longest)
    return continue_orbit(
        system,
        OrbitGuess(system.start(), float(system.period())),
        "beam__v",
        (parameters["follow_min"], parameters["follow_max"]),
        forcing_period=PressedBeam.period,
        follow=Follow(step=parameters["step"], max_points=parameters["max_orbits"]),
        shooting=Shooting(integrator=ss.Integrator("dop853", rule)),
    )


def stick_share(orbit: PeriodicOrbit) -> float:
    """Part of the period that one orbit spends in stick."""
    count, period = int(orbit.events.count), float(orbit.period)
    times = np.asarray(orbit.events.t)[:count]
    stuck = np.asarray(orbit.events.mode_after)[:count] == STICK
    lasts = np.diff(np.append(times, times[0] + period)) if count else np.zeros(0)
    return float(lasts[stuck].sum() / period)


ORBIT = ("variant", "damping", "v", "stick", "stable", "y", "size", "turn")
SPECIAL = ("variant", "damping", "v", "stick", "label", "words", "y", "size", "turn")
NAMED = {
    "v": "belt speed v", "stick": "share of the period in stick", "y": "greatest y",
    "size": "size of a multiplier", "turn": "angle of a multiplier over 2 pi T: its frequency",
}  # fmt: skip


def as_table(branches: list[tuple[str, float, Branch]]) -> xr.Dataset:
    """Orbits of all branches along `orbit`, special points along `special`; multipliers by size."""
    orbits: list[tuple] = []
    specials: list[tuple] = []
    for variant, damping, branch in branches:
        for i, v in enumerate(branch.values):
            orbit = _one(branch.orbits, i)
            stable = bool(np.asarray(orbit.stable))
            orbits.append((variant, damping, v, stick_share(orbit), stable, *_shape(orbit)))
        for mark in branch.specials:
            head = (variant, damping, mark.value, stick_share(mark.orbit), mark.label, mark.words)
            specials.append((*head, *_shape(mark.orbit)))
    columns = {
        f"{axis}_{key}": _column(axis, key, [row[i] for row in rows])
        for axis, keys, rows in (("orbit", ORBIT, orbits), ("special", SPECIAL, specials))
        for i, key in enumerate(keys)
    }
    return xr.Dataset(columns)


def _one(orbits: Any, index: int) -> Any:
    return jax.tree.map(lambda leaf: leaf[index], orbits)


def _shape(orbit: PeriodicOrbit) -> tuple[float, np.ndarray, np.ndarray]:
    """Greatest y, sizes and frequencies of the multipliers."""
    multipliers = np.asarray(orbit.multipliers)
    turn = np.abs(np.angle(multipliers)) / (2 * np.pi * float(orbit.period))
    return float(orbit.highest.y), np.abs(multipliers), turn


def _column(axis: str, key: str, values: list[Any]) -> tuple:
    label = {"units": "1", "long_name": NAMED[key]} if key in NAMED else {}
    if key in ("size", "turn"):
        return (axis, "multiplier"), np.stack(values), label
    return axis, np.asarray(values), label
