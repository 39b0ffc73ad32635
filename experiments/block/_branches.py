"""Branches of periodic orbits over k3 under the diagrams: basic orbits, and those of each doubling."""

import dataclasses
import hashlib
import json
import pathlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

import stickslip as ss
from stickslip.analysis import STATUS
from stickslip.continuation import (
    Branch,
    BranchPoint,
    Follow,
    OrbitGuess,
    PeriodicOrbit,
    Shooting,
    continue_orbit,
    load_branch,
    save_branch,
)  # fmt: skip

from .._experiment import Context
from ._diagram import diagrams, system_of

# Of a diagram's lane: the period is its time by the number of its points, or one more or less.
MISCOUNTED = (0.0, 1.0, -1.0)
TURNS = (1, 2, 4, 3, 6)  # points per period that a lane may have
ROWS = 64  # orbits that are simulated again at once
SETTLED = (STATUS.index("ok"), STATUS.index("buffer_full"))


@dataclasses.dataclass(frozen=True)
class Family:
    """Branches of a model with the number of doublings that led to each, 0 for the basic orbit's.

    `not_followed`: the doublings whose branch was not found, each with the reason.
    """

    model: str
    branches: tuple[Branch, ...]
    doublings: tuple[int, ...]
    not_followed: tuple[str, ...]


def with_branches(
    models: tuple[str, ...], parameters: Mapping[str, Any], context: Context
) -> xr.Dataset:
    """Diagrams over k3 from `k3_min` to `k3_max`, and branches from `follow_min` to `follow_max`."""
    low, high = parameters["k3_min"], parameters["k3_max"]
    found = diagrams(models, low, high, parameters, context, ends=True)
    families = [
        family(model, found.sel(model=model), parameters, kept_in(model, parameters, context))
        for model in models
    ]
    kept = found.drop_vars([name for name in found.data_vars if str(name).startswith("end_")])
    missing = "; ".join(f"{one.model}: {words}" for one in families for words in one.not_followed)
    table = as_table(families, models, parameters)
    return kept.merge(table).assign_attrs(found.attrs, not_followed=missing)


def kept_in(model: str, parameters: Mapping[str, Any], context: Context) -> pathlib.Path:
    """The folder of a model's branches; empty after `fresh`."""
    digest = hashlib.sha256(json.dumps(dict(parameters), sort_keys=True).encode()).hexdigest()[:8]
    word = "-".join(model.replace(",", "").split())
    folder = context.stores / f"block-branches-{word}-{digest}"
    folder.mkdir(parents=True, exist_ok=True)
    if context.fresh:
        for file in folder.glob("*.nc"):
            file.unlink()
    return folder


def family(
    model: str, diagram: xr.Dataset, parameters: Mapping[str, Any], folder: pathlib.Path
) -> Family:
    """The branch of the basic orbit, and those of its doublings up to so many.

    Each is kept in the folder, so that a run that was interrupted goes on with the next one.
    """
    options = {
        "bounds": (parameters["follow_min"], parameters["follow_max"]),
        "follow": Follow(step=parameters["step"], max_points=parameters["max_orbits"]),
        "shooting": Shooting(integrator=precise(parameters)),
    }
    system, start = system_of(model, parameters["follow_min"], parameters["set"])[:2]

    def once(name: str, make: Callable[[], Branch]) -> Branch:
        file = folder / f"{name}.nc"
        if not file.is_file():
            save_branch(make(), file)
        return load_branch(file, system, start)

    branches = [once("basic", lambda: _basic(model, diagram, parameters["set"], options))]
    doublings, missing = [0], []
    for level in range(1, parameters["doublings"] + 1):
        # The longer the orbits are the more they depend on where they start.
        segments = level * parameters["segments"]
        options["shooting"] = Shooting(segments, precise(parameters))
        here = [b for b, d in zip(branches, doublings, strict=True) if d == level - 1]
        met: list[float] = []
        for number, point in enumerate(_flips(here)):
            # A branch that begins at one doubling may end at another one.
            if any(abs(point.value - value) < 2.0 * _longest(parameters) for value in met):
                continue
            name = f"doubled-{level}-{number}"
            try:
                branch = once(name, lambda at=point: continue_orbit(system, at, "k3", **options))
            except ValueError as error:
                missing.append(f"{point!r}: {error}")
                continue
            met += [e.value for e in branch["EP"] if e.words.startswith("repeats")]
            branches.append(branch)
            doublings.append(level)
    return Family(model, tuple(branches), tuple(doublings), tuple(missing))


def precise(parameters: Mapping[str, Any]) -> ss.Integrator:
    """For orbits: a method that compiles fast, to `orbit_tolerance`."""
    return ss.Integrator("tsit5", ss.AdaptiveStep(parameters["orbit_tolerance"]))


def _longest(parameters: Mapping[str, Any]) -> float:
    return parameters["step"] * (parameters["follow_max"] - parameters["follow_min"])


def _flips(branches: list[Branch]) -> Iterator[BranchPoint]:
    for branch in branches:
        yield from branch["PD"]


def _basic(model: str, diagram: xr.Dataset, name: str, options: dict[str, Any]) -> Branch:
    """The branch that begins at the settled lane of lowest k3, or at the orbit that it doubles.

    Errors: `ValueError` where no lane leads to an orbit.
    """
    for k3, guess in _guesses(model, diagram, name):
        system = system_of(model, k3, name)[0]
        try:
            branch = continue_orbit(system, guess, "k3", **options)
        except ValueError:
            continue
        # At its doubling a branch of doubled orbits meets the orbit itself.
        for end in branch["EP"]:
            if end.words.startswith("repeats"):
                branch = continue_orbit(system, end, "k3", **options)
                break
        return branch
    raise ValueError(f"{model}: no lane of the diagram leads to a periodic orbit.")


def _guesses(model: str, diagram: xr.Dataset, name: str) -> Iterator[tuple[float, OrbitGuess]]:
    part = diagram.isel(protocol=-1)
    state = type(system_of(model, 85.0, name)[1])
    for i in np.flatnonzero(np.isin(np.asarray(part.status), SETTLED)):
        lane = part.isel(k3=int(i))
        k3 = float(lane.k3)
        y = state(*(jnp.asarray(float(lane[f"end_{field}"])) for field in state._fields))
        for turns in TURNS:
            for more in MISCOUNTED:
                period = float(lane.duration) * turns / (float(lane["count"]) + more)
                yield k3, OrbitGuess(y, period)


def as_table(
    families: list[Family], models: tuple[str, ...], parameters: Mapping[str, Any]
) -> xr.Dataset:
    """Orbits of all branches along `orbit`, special points along `special`."""
    orbits: dict[str, list[Any]] = {key: [] for key in ORBIT}
    specials: dict[str, list[Any]] = {key: [] for key in SPECIAL}
    number = 0
    for index, one in enumerate(families):
        for branch, level in zip(one.branches, one.doublings, strict=True):
            points = section_points(branch.system, branch.orbits, branch.values, parameters)
            multipliers = np.asarray(branch.orbits.multipliers)
            for i in range(len(branch)):
                row = (
                    index, number, level, branch.values[i], float(branch.orbits.period[i]),
                    bool(np.asarray(branch.orbits.stable)[i]), multipliers[i], points[i],
                )  # fmt: skip
                for key, value in zip(ORBIT, row, strict=True):
                    orbits[key].append(value)
            marks = branch.specials
            if not marks:
                number += 1
                continue
            at = jax.tree.map(lambda *leaves: np.stack(leaves), *(m.orbit for m in marks))
            places = section_points(branch.system, at, np.array([m.value for m in marks]), parameters)
            for mark, place in zip(marks, places, strict=True):
                row = (
                    index, number, level, mark.value, float(mark.orbit.period), mark.label, mark.words,
                    float(np.max(np.abs(mark.orbit.multipliers))), place,
                )  # fmt: skip
                for key, value in zip(SPECIAL, row, strict=True):
                    specials[key].append(value)
            number += 1
    return xr.Dataset({
        **{f"orbit_{k}": _column("orbit", k, v) for k, v in orbits.items()},
        **{f"special_{k}": _column("special", k, v) for k, v in specials.items()},
    })  # fmt: skip


ORBIT = ("model", "branch", "doublings", "k3", "period", "stable", "multiplier", "x")
SPECIAL = ("model", "branch", "doublings", "k3", "period", "label", "words", "largest", "x")
UNITS = {"k3": "N/m", "period": "s", "x": "m"}


def _column(axis: str, key: str, values: list[Any]) -> tuple:
    label = {"units": UNITS[key]} if key in UNITS else {}
    if key == "x":
        return (axis, "crossing"), np.stack(values), label
    if key == "multiplier":
        most = max(v.size for v in values)
        filled = [np.pad(np.abs(v), (0, most - v.size), constant_values=np.nan) for v in values]
        return (axis, "multiplier"), np.stack(filled), {"long_name": "size of a multiplier"}
    return axis, np.asarray(values), label


def section_points(
    system: Any, orbits: PeriodicOrbit, k3: np.ndarray, parameters: Mapping[str, Any]
) -> np.ndarray:
    """x [m] where the acceleration of the block falls through zero, `[orbit, crossing]`, else NaN."""
    most = 4 * 2 ** parameters["doublings"]
    # Always as many orbits at once: another number of them is another program.
    rows = -(-k3.size // ROWS) * ROWS
    blocks = np.minimum(np.arange(rows), k3.size - 1).reshape(-1, ROWS)
    system = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), system)
    starts, periods = jax.tree.map(np.asarray, (orbits.y0, orbits.period))
    found = [
        _crossings(
            system, precise(parameters), k3[at], jax.tree.map(lambda a, at=at: a[at], starts),
            periods[at], most,
        )
        for at in blocks
    ]  # fmt: skip
    return np.concatenate([np.asarray(part) for part in found])[: k3.size]


@eqx.filter_jit
def _crossings(system, integrator, k3, starts, periods, most):
    def lane(k3, y0, period):
        there = eqx.tree_at(lambda s: s.k3, system, k3)
        found = ss.simulate(
            there, 0.0, period, y0, integrator=integrator,
            saveat=ss.SaveAt(
                sections=there.zero_acceleration_section(), max_events=None, max_crossings=most,
            ),
            throw=False,
        )  # fmt: skip
        return jnp.where(found.successful, found.crossings[0].y.x, jnp.nan)

    return jax.vmap(lane)(k3, starts, periods)
