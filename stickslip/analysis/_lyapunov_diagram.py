"""Lyapunov exponents over one or more parameters of a system."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import xarray as xr
from jaxtyping import PyTree

from .._types import Given, Named, NamedRows
from .._validation import check_mapping, check_type, refusal
from ..hybrid import AbstractHybridSystem
from ..sweep import Labels, Variable, run_sweep
from ..sweep.grid import check_grid
from ..sweep.settings import settings_of
from ._accuracy import ACCURACY
from ._builder import builder_of, check_labels, labelled_parameters
from ._growth import EXPONENT_STATUS
from ._lyapunov import lyapunov_spectrum
from ._orbit_lane import STATUS, engine_status
from ._recording import Segments


def lyapunov_diagram(
    system: Given[AbstractHybridSystem | Callable[..., AbstractHybridSystem]],
    grid: NamedRows,
    y0: PyTree,
    record: Given[Segments],
    *,
    scales: PyTree = None,
    spectrum: Named | None = None,
    **sweep: Any,
) -> xr.Dataset:
    r"""Lyapunov exponents over a grid of parameters: `lyapunov_spectrum` in every lane of a sweep.

    **Arguments**

    - `system`: a hybrid system; its parameters are the grid's names (`drive__U_in` for `U_in` of its
      part `drive`). Or a function `(**point) -> system`.
    - `grid`: parameter name to vector of values; all combinations.
    - `y0`, `scales`: as for `lyapunov_spectrum`, or functions of the system that return them.
    - `record`, and in `spectrum` the other options by name (`exponents`, `components`, `integrator`,
      ...): as for `lyapunov_spectrum`.
    - `store`, `labels`, `compute`, `part`: as for `run_sweep`, with 64 lanes per block: with a store
      an interrupted diagram goes on where it stopped.

    **Returns** an `xarray.Dataset` with the dimensions of the grid and `exponent`: `exponents` [1/s],
    greatest first, with their `error` [1/s] and the number of segments in which they were `lost`;
    `flags` as in `Solution`; `status`: 0 "ok", else why the lane has no exponents
    (`attrs["flag_meanings"]`); `exponent_status`: why an exponent is not a number, as
    `LyapunovSpectrum.status` (`attrs["flag_meanings"]`).

    **Errors** `ValueError`/`TypeError` naming the argument.
    """
    coords = check_grid(grid)
    given = settings_of(**sweep, name="Lyapunov exponents")
    build = builder_of(system, coords)
    options = check_mapping("spectrum", spectrum)
    own = given.labels.variables or {}
    check_labels(own, coords)
    check_type("record", record, Segments, "a Segments(length, count)")
    _check_options(options)

    def lane(**point):
        inner = build(point)
        found = lyapunov_spectrum(inner, _of(y0, inner), record, scales=_of(scales, inner), **options)
        return {
            "exponents": found.exponents,
            "error": found.error,
            "lost": found.lost,
            "flags": found.flags,
            "status": engine_status(found.result),
            "exponent_status": found.status,
        }

    per_time = "1" if getattr(build(_first(coords)), "is_dimensionless", False) else "1/s"
    row = ("exponent",)
    variables = {
        **own,
        **labelled_parameters(system, coords, own),
        "exponents": Variable(row, per_time, "Lyapunov exponents, greatest first"),
        "error": Variable(row, per_time, "error of the exponents"),
        "lost": Variable(row, "1", "segments in which the direction was lost"),
        "flags": Variable(long_name="where no derivative exists, as in Solution.flags"),
        "status": Variable(
            long_name="status of the run",
            attrs={"flag_values": list(range(len(STATUS))), "flag_meanings": " ".join(STATUS)},
        ),
    }
    variables["exponent_status"] = Variable(
        row,
        long_name="what the exponent is",
        attrs={
            "flag_values": list(range(len(EXPONENT_STATUS))),
            "flag_meanings": " ".join(EXPONENT_STATUS),
        },
    )
    settings = {"record": record, **(given.labels.settings or {})}
    store = given.storage.in_chunks(ACCURACY.with_tangents)
    return run_sweep(
        lane, coords, store=store, compute=given.compute, part=given.part,
        labels=Labels(variables, settings, given.labels.attrs, given.name),
    )  # fmt: skip


def _check_options(options: Mapping[str, Any]) -> None:
    """Raise for options that `lyapunov_spectrum` does not have, or that are given elsewhere."""
    own = ("system", "y0", "record", "scales")
    allowed = [name for name in inspect.signature(lyapunov_spectrum).parameters if name not in own]
    for name in options:
        if name not in allowed:
            raise refusal(f"spectrum[{name!r}]", options[name], f"one of {', '.join(allowed)}")


def _of(what: Any, system: AbstractHybridSystem) -> Any:
    return what(system) if callable(what) and not isinstance(what, type) else what


def _first(coords: Mapping[str, Any]) -> dict[str, float]:
    return {key: float(v[0]) for key, v in coords.items()}
