"""Branches as files: written whole or not at all, read back with all that continuation needs."""

import json
import os
import pathlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._netcdf import path_of, read_netcdf, write_netcdf
from .._types import Given
from .._validation import as_float64, check_type, refusal
from ..analysis.observable import with_parameters
from ..hybrid import RESULTS, AbstractHybridSystem, EventLog
from ..hybrid.arguments import the_system
from ._arguments import value_of
from ._branch import Branch, BranchPoint
from ._equilibrium import Equilibrium
from ._orbit import PeriodicOrbit
from ._outcome import ORBITS

if TYPE_CHECKING:
    import xarray as xr

FORMAT = "stickslip branch 2"
ORBITS_OF, SPECIALS_OF = "orbit", "special_orbit"


def save_branch(branch: Given[Branch], path: Given[str | os.PathLike]) -> pathlib.Path:
    """Write a branch to a netCDF file, from which `load_branch` makes it again.

    The file is `Branch.to_dataset()`, as `xarray.open_dataset` reads it, with all arrays of the orbits
    beside it. It is written whole: whoever interrupts this finds the old file, or none.

    **Returns** the path. **Errors** `TypeError` naming the argument; `OSError` of the file system.
    """
    check_type("branch", branch, Branch, "a Branch")
    path = path_of(path)
    dataset = branch.to_dataset().assign_attrs(
        parameters=json.dumps(branch.parameters), label=branch.label,
        sequences=json.dumps(branch.sequences), kind=type(branch.orbits).__name__,
    )  # fmt: skip
    dataset = _with_leaves(dataset, ORBITS_OF, "point", branch.orbits)
    if branch.specials:
        marks = branch.specials
        orbits = jax.tree.map(lambda *leaves: np.stack(leaves), *(m.orbit for m in marks))
        dataset = _with_leaves(dataset, SPECIALS_OF, "special", orbits)
        dataset["special_index"] = "special", np.array([m.index for m in marks])
        dataset["special_slope"] = ("special", "direction"), np.stack([m.slope for m in marks])
    return write_netcdf(dataset, path, FORMAT)


def load_branch(
    path: Given[str | os.PathLike], system: Given[AbstractHybridSystem], y0: PyTree
) -> Branch:
    """Read a branch that `save_branch` wrote; `continue_orbit` goes on from its points.

    - `system`: the one that was followed, with any values of the parameters that the branch is over.
    - `y0`: a state of the system, of any values: its structure.

    **Returns** the `Branch`, equal to the saved one to the last bit. A saved log of events has only
    as many rows as there are events.

    **Errors** `ValueError` naming the argument: a file that is not such a branch, or is damaged; a
    system without its parameter; a state of other components. `TypeError` for a path that is none.
    """
    path_of(path)
    the_system(system)
    data = read_netcdf(path, FORMAT, "save_branch")
    try:
        parameters = tuple(json.loads(data.attrs["parameters"]))
        kind = {"PeriodicOrbit": _orbit_like, "Equilibrium": _equilibrium_like}[data.attrs["kind"]]
    except (KeyError, ValueError) as error:
        raise refusal("path", str(path), "a file of save_branch") from error
    for parameter in parameters:
        value_of(system, parameter, "system")
    _check_state(data, "y0" if kind is _orbit_like else "y", as_float64("y0", y0), y0)
    try:
        template = kind(y0)
        orbits = _orbits(data, ORBITS_OF, template)
        columns = [np.asarray(data[_column(data, name)]) for name in parameters]
        values = columns[0] if len(columns) == 1 else np.stack(columns, axis=1)
        sequences = tuple(_tuples(s) for s in json.loads(data.attrs["sequences"]))
        found = _specials(data, parameters, template, system) if "special_index" in data else ()
        specials = tuple(found)
    except (KeyError, ValueError, TypeError) as error:
        raise refusal("path", str(path), f"a file of save_branch with this state: {error}") from error
    return Branch(parameters, values, orbits, sequences, specials, system, str(data.attrs["label"]))


def _column(data: "xr.Dataset", parameter: str) -> str:
    """Name of a parameter in a file."""
    other = f"parameter_{parameter}"
    return other if other in data.variables else parameter


def _check_state(data: "xr.Dataset", leaf: str, y0: PyTree, given: Any) -> None:
    """Raise for a state of other components than those in the file, or of other shapes."""
    found, _ = jax.tree_util.tree_flatten_with_path(y0)
    own = {jax.tree_util.keystr(path): np.shape(leaf) for path, leaf in found}
    head = f"{ORBITS_OF}.{leaf}"
    names = [str(name) for name in data.data_vars if str(name).startswith((head + ".", head + "["))]
    names += [head] if head in data.data_vars else []
    if not names:
        raise refusal("path", "a file", "a file of save_branch")
    known = {name.removeprefix(head): data[name].shape[1:] for name in names}
    if own != known:
        words = ", ".join(f"{name.lstrip('.')} {shape}" for name, shape in known.items())
        raise refusal("y0", given, f"a state with the components and shapes of the file: {words}")


def _leaves_by_name(orbit: PeriodicOrbit | Equilibrium) -> list[tuple[str, Any]]:
    """Leaves of an orbit by name, such as `events.y_before.x`."""
    found, _ = jax.tree_util.tree_flatten_with_path(orbit)
    return [(jax.tree_util.keystr(path).lstrip(".").replace("_value", "code"), a) for path, a in found]


def _with_leaves(
    dataset: "xr.Dataset", prefix: str, axis: str, orbits: PeriodicOrbit | Equilibrium
) -> "xr.Dataset":
    """With all arrays of orbits beside the columns; of a log of events as many rows as there are."""
    log, new = getattr(orbits, "events", None), {}
    events = 0 if log is None else int(np.max(np.asarray(log.count), initial=0))
    for name, leaf in _leaves_by_name(orbits):
        array = np.asarray(leaf)
        if name.startswith("events.") and name != "events.count":
            array = array[:, :events]
        for part, values in _real(array):
            key = f"{prefix}.{name}{part}"
            axes = [axis, *(f"{key}.{k}" for k in range(1, array.ndim))]
            new[key] = axes, values
    return dataset.assign(new)


def _real(array: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Files hold no complex numbers."""
    if np.iscomplexobj(array):
        yield ".real", np.real(array)
        yield ".imag", np.imag(array)
    else:
        yield "", array.astype(np.int8) if array.dtype == bool else array


def _orbits(data: "xr.Dataset", prefix: str, template: Any) -> Any:
    """Orbits with a leading axis. Raises `KeyError` for what is missing, `ValueError` for a shape."""
    known = {str(name) for name in data.data_vars if str(name).startswith(f"{prefix}.")}
    leaves, structure = [], jax.tree.structure(template)
    for name, leaf in _leaves_by_name(template):
        key = f"{prefix}.{name}"
        if np.iscomplexobj(leaf):
            array = np.asarray(data[f"{key}.real"]) + 1j * np.asarray(data[f"{key}.imag"])
            known -= {f"{key}.real", f"{key}.imag"}
        else:
            array = np.asarray(data[key])
            known.discard(key)
        row = "events." in name and name != "events.count"
        own = array.shape[2 if row else 1 :]
        if ("y" in name or name in ("lowest", "highest")) and own != np.shape(leaf):
            raise ValueError(f"{name} has the shape {own}, in the state {np.shape(leaf)}")
        leaves.append(jnp.asarray(array, jnp.result_type(leaf)))
    if known:
        raise ValueError(f"the state has not {min(known).removeprefix(prefix + '.')}")
    return jax.tree.unflatten(structure, leaves)


def _equilibrium_like(y0: PyTree) -> Equilibrium:
    """An equilibrium of the right structure and types."""
    size = sum(int(np.size(leaf)) for leaf in jax.tree.leaves(y0))
    state = jax.tree.map(lambda leaf: np.zeros(np.shape(leaf)), y0)
    return Equilibrium(state, np.zeros((), int), np.zeros(size, complex), np.zeros(()), np.zeros(size))


def _orbit_like(y0: PyTree) -> PeriodicOrbit:
    """An orbit of the right structure and types."""
    size = sum(int(np.size(leaf)) for leaf in jax.tree.leaves(y0))
    state = jax.tree.map(lambda leaf: jnp.zeros(np.shape(leaf)), y0)
    square = jnp.zeros((size, size))
    one, whole, number = jnp.zeros(()), jnp.zeros((), jnp.int32), jnp.zeros((), jnp.uint32)
    codes = jnp.zeros(1, jnp.int32)
    log = EventLog(whole, jnp.zeros(1), codes, codes, codes, state, state)
    return PeriodicOrbit(
        t0=one, y0=state, mode0=whole, period=one, multipliers=jnp.zeros(size, complex), trivial=one,
        rank=whole, repeats=whole, monodromy=square, determinant=one,
        determinant_by_events=one, residual=one, closing_error=one, steps=whole, lowest=state,
        highest=state, events=log, sequence=number, flags=whole, result=ORBITS.successful,
        simulation=RESULTS.successful, neutral=square, drift=state,
        turns=jax.tree.map(lambda leaf: leaf.astype(jnp.int32), state),
    )  # fmt: skip


def _specials(
    data: "xr.Dataset", parameters: tuple[str, ...], template: Any, system: AbstractHybridSystem
) -> Iterator[BranchPoint]:
    orbits = _orbits(data, SPECIALS_OF, template)
    columns = [np.asarray(data[f"special_{_column(data, name)}"], float) for name in parameters]
    names = ("label", "special_words", "special_index", "special_slope")
    for k, row in enumerate(zip(*(np.asarray(data[name]) for name in names), strict=True)):
        label, words, index, slope = row
        orbit = jax.tree.map(lambda leaf, k=k: leaf[k], orbits)
        values = np.array([column[k] for column in columns])
        there = with_parameters(system, dict(zip(parameters, map(np.float64, values), strict=True)))
        yield BranchPoint(str(label), values, orbit, str(words), int(index), np.asarray(slope), there)


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
