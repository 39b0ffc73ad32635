"""Orbit diagrams by brute force: the points of a section over one or two parameters."""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
import xarray as xr
from jaxtyping import PyTree

from .._types import Given, Mode, NamedRows
from .._validation import check_mapping, check_type, refusal
from ..hybrid import AbstractHybridSystem, Integrator, Section
from ..progress import Progress
from ..sweep import Carried, Labels, Variable, run_sweep
from ..sweep.evaluate import lanes_of, prepared
from ..sweep.grid import block_shape, check_grid
from ..sweep.settings import Settings, settings_of
from ._accuracy import ACCURACY
from ._arguments import an_integrator, start_of
from ._attractor import PERIOD_STATUS
from ._builder import builder_of, check_labels, labelled_parameters
from ._orbit_lane import STATUS, Numbers, OrbitPlan, finer_integrator, run_lane
from ._recording import Cut, Recording
from ._starts import Starts, check_shapes, labels_of_end, starts_of
from .observable import (
    Angle,
    Observable,
    as_observable,
    as_section,
    axes_of,
    named_observables,
    shape_of,
    whole_of,
)

RESULTS_OF_A_LANE = ("count", "status", "period", "period_status", "slow_transient", "flags")


def orbit_diagram(
    system: Given[AbstractHybridSystem | Callable[..., AbstractHybridSystem]],
    grid: NamedRows,
    y0: PyTree,
    record: Given[Recording],
    *,
    carried: Given[Carried | None] = None,
    mode0: Mode | None = None,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
    **sweep: Any,
) -> xr.Dataset:
    r"""Points at which the motion crosses a section, over one or two parameters of a system.

    Each lane runs for a transient that is dropped, then for the time recorded, and every crossing of
    the section gives a point. The diagram shows what a motion from the given initial state comes to:
    one attractor per parameter value, never an unstable one. This is not continuation.

    **Arguments**

    - `system`: a hybrid system; its parameters are the grid's names (`drive__U_in` for `U_in` of its
      part `drive`). Or a function `(**point) -> system`.
    - `grid`: parameter name to vector of values; with two names, all pairs.
    - `y0`: initial state. A component whose shape begins with the grid's has a value for each lane, any
      other is shared by all. Where the system can take it both ways (an array of as many numbers as the
      grid has values) this raises an error: an `xarray.DataArray` with the grid's names among its
      dimensions is per lane, with other dimensions shared.
    - `record`: `Recording(transient, duration, section, observables, ...)`: what is dropped, what is
      recorded and on which section, how many points, when they repeat, and how many lanes are checked.
    - `carried`: `Carried("upwards")` or `Carried("downwards")`: each lane starts from the end of its
      neighbour, which shows hysteresis. Sequential by nature: as many lanes at a time as the other
      parameter has values, one without another. A lane that failed hands on the state it was given. The
      clock starts at `record.t0` in every lane: give an explicit forcing its phase as a state, or let
      the time of a run be a multiple of its period.
    - `integrator`, `args`, `mode0`: as for `simulate`.
    - `store`, `labels`, `compute`, `part`: as for `run_sweep`, with 512 lanes per block on a CPU. By
      default a parameter has the unit that the system states.

    **Returns** an `xarray.Dataset` with the dimensions of the grid and `point`; with several sections
    observables, `count`, `period` and `period_status` have the dimension `section`, by name:

    - one variable per observable, NaN past `count` points; of a component that is an array with axes of
      its own at the end, `x_0`, `x_1`, ..., as in `Solution.to_dataset`;
    - `status`: 0 "ok", else what is to be known of the lane (`attrs["flag_meanings"]`): it came to
      rest (`at_rest`: the whole state keeps its place over the last quarter of the record, by
      `period.tolerance` of the way it went in the record; points are those of the way there), left the
      domain, never crossed a section, has more crossings than `max_points` (`buffer_full`) or
      fewer than `points` of all sections (`fewer_points`), its points are not yet those of the
      attractor although a transient was dropped (`not_settled`: the first are not, or all still come
      nearer to something or creep), they do not repeat and are too few to distinguish a transient
      from chaos (`too_few_points`), or the result code of its run (`max_steps_reached`: those of the
      `integrator`). Points of chaos that are many enough are "ok";
    - `period`: number of points after which the observables repeat; 0 if after none of 1 to
      `record.period.longest`; -1 where that is unknown. `period_status` says why, by number with words
      in `attrs["flag_meanings"]`: `repeats`; `none`; `lane_failed`; `too_few_points` (4 are needed for
      period one, twice the longest to say that there is none); `not_finite`; `not_settled` (the points
      still come nearer to something, or creep);
      `constant` (a lane at rest, or all that is observed is); `zero_on_section` (all that was observed
      is zero there, as a speed is at the maxima of its position); `below_rounding`. Points are the same
      if each observable differs by at most `period.tolerance` of its range along the whole motion, over
      the last quarter of the points. Time is left out, and components that are not observed do not
      count;
    - `slow_transient`: the first points are not yet those of the attractor, but the last are: drop
      more time. False too where that cannot be told;
    - `flags`: as in `Solution`, of transient and record;
    - `end_...`: the state at the end (`carry_...` if carried);
    - with `record.check`, along `checked`: `checked_<parameter>`, and per observable `error_<name>`,
      the largest difference over the points of the lane, NaN where their number differs. Lanes of a
      chaotic attractor differ by its size: look at those with a period (`checked_period`).

    **Errors** `ValueError`/`TypeError` naming the argument, before anything is compiled.
    """
    coords = check_grid(grid)
    given = settings_of(**sweep, name="orbit diagram")
    if len(coords) > 2:
        raise refusal("grid", grid, "of at most two parameters")
    build = builder_of(system, coords)
    first = build({key: float(v[0]) for key, v in coords.items()})
    check_type("record", record, Recording, "a Recording(transient, duration, section, observables)")
    shape = tuple(v.size for v in coords.values())
    reader = _Reader(first, record, args, shape)
    starts = starts_of(
        y0, coords, lambda state: check_shapes(first, record.t0, state, mode0, args), reader.read
    )
    one, mode = start_of(first, record.t0, starts.first, mode0, args)
    read = reader.read(one)
    _check_names(named_observables(record.observables), coords)
    check_type("carried", carried, Carried | None, "a Carried, or None")
    if carried is not None and starts.per_lane:
        raise refusal("y0", starts.y0, "one state for a carried diagram, not one per lane")
    own = reader.own_axes(read, one, mode)
    integrator = an_integrator(integrator)
    plan = _plan_of(build, record, read, None if mode0 is None else mode, args)
    variables = _labels(plan, read.observables, own, coords, given.labels.variables, system)
    prefix = "end" if carried is None else "carry"
    for key, (axes, unit) in labels_of_end(first, starts.first, prefix).items():
        variables[key] = Variable(axes, unit)
    told = {
        "system": system if isinstance(system, AbstractHybridSystem) else first,
        **_told(plan, record, starts, carried),
        "integrator": integrator,
        **(given.labels.settings or {}),
    }
    attrs = {
        **({"sections": list(plan.sections)} if plan.several else {}),
        **(given.labels.attrs or {}),
    }
    given = given._replace(labels=Labels(variables, told, attrs, given.name))
    if carried is None and jax.default_backend() == "cpu":
        given = given._replace(storage=given.storage.in_chunks(ACCURACY.side_by_side))
    # Numbers enter as inputs, so that other times and steps do not make another program.
    numbers, static = _numbers(integrator, record)

    @prepared
    def lane(numbers, start=None, **point):
        end, results = run_lane(plan, static, numbers, starts.y0 if start is None else start, point)
        return {**results, "end": end}

    def step(carry, **point):
        return run_lane(plan, static, numbers, carry, point)

    swept = functools.partial(
        run_sweep, store=given.storage, labels=given.labels, compute=given.compute, part=given.part
    )
    if carried is None:
        inputs = {
            "numbers": _spread(numbers, shape),
            **({"start": starts.y0} if starts.per_lane else {}),
        }
        dataset = swept(lane, coords, inputs=inputs)
    else:
        dataset = swept(step, coords, carry=starts.y0, carried=carried)
    if plan.several:
        dataset = dataset.assign_coords(section=list(plan.sections))
    if not record.check:
        return dataset
    if carried is None:
        begun = starts.flat(shape) if starts.per_lane else None
    else:
        begun = _handed_on(dataset, starts.y0, carried, coords)
    finer, _ = _numbers(finer_integrator(integrator), record)
    return dataset.assign(
        _check(lane, finer, coords, begun, record.check, dataset, read.observables, given)
    )


class _Read(NamedTuple):
    """All that is read off a motion: observables with their units, sections, borders of the domain."""

    observables: dict[str, tuple[Observable, str | None]]
    sections: dict[str, Section]
    domain: tuple[Observable, ...]


class _Reader(NamedTuple):
    """Reads off a state what the recording asks of it."""

    system: AbstractHybridSystem  # of the first point
    record: Recording
    args: PyTree
    shape: tuple[int, ...]  # of the grid

    def read(self, state: PyTree) -> _Read:
        """Observables, sections and borders, all of a state of these shapes."""
        section, domain = self.record.section, []
        found = {
            key: as_observable(f"observables[{key!r}]", what, self.system, state)
            for key, what in named_observables(self.record.observables).items()
        }
        cuts = _sections(section, self.system, state)
        for what in self.record.domain:
            border = whole_of(as_observable("domain", what, self.system, state)[0])
            shape_of("domain", what, border, self.system, state, 0, self.args, single=True)
            domain.append(border)
        for name, cut in cuts.items():
            argument = "section" if isinstance(section, Cut) else f"section[{name!r}]"
            if shape_of(argument, cut.name, cut.function, self.system, state, 0, self.args):
                shapes = sorted({np.shape(a) for a in jax.tree.leaves(state)})
                beside = f"a y0 of shapes {shapes} beside the grid's shape {self.shape}"
                raise refusal(
                    argument, cut.name, "of one number", but=f"which gives an array of {beside}"
                )
        return _Read(found, cuts, tuple(domain))

    def own_axes(self, read: _Read, state: PyTree, mode: Any) -> dict[str, tuple[str, ...]]:
        """Names of the axes that an observable has of its own."""
        observed = named_observables(self.record.observables)
        found = {}
        for key, (f, _) in read.observables.items():
            argument, what = f"observables[{key!r}]", observed[key]
            rank = len(shape_of(argument, what, f, self.system, state, mode, self.args))
            found[key] = axes_of(key, f, rank)
        return found


def _check_names(observed: Mapping[str, Any], coords: Mapping[str, Any]) -> None:
    for key, what in observed.items():
        if key in coords or key in RESULTS_OF_A_LANE:
            allowed = "given another name: this one is taken"
            raise refusal(f"observables[{key!r}]", what, allowed)


def _plan_of(build: Callable, record: Recording, read: _Read, mode0: Any, args: PyTree) -> OrbitPlan:
    return OrbitPlan(
        build=build,
        sections=read.sections,
        several=not isinstance(record.section, Cut),
        observables={key: function for key, (function, _) in read.observables.items()},
        domain=read.domain,
        settles=bool(record.transient > 0),
        size=record.size,
        stops=record.points is not None,
        mode0=mode0,
        args=args,
        period=record.period,
    )


def _told(
    plan: OrbitPlan, record: Recording, starts: Starts, carried: Carried | None
) -> dict[str, Any]:
    """Settings that the store keeps of the diagram, and compares."""
    return {
        "section": {
            name: {"name": cut.name, "direction": cut.direction} for name, cut in plan.sections.items()
        },
        "transient": record.transient,
        "duration": record.duration,
        "points": record.points,
        "initial_state": None if starts.per_lane else starts.y0,
        "carried": None if carried is None else carried.direction,
    }


def _sections(section, system, y0) -> dict[str, Section]:
    """Sections by name; a single one has its own."""
    if isinstance(section, Mapping):
        given = check_mapping("section", section)
        if not given:
            raise refusal("section", section, "a section, or a mapping from names to some")
        return {name: as_section(cut, system, y0, f"section[{name!r}]") for name, cut in given.items()}
    cut = as_section(section, system, y0)
    return {cut.name: cut}


def _labels(plan: OrbitPlan, found, own, coords, labels, given_units) -> dict[str, Variable]:
    check_labels(labels, [*coords, *found])
    variables = labelled_parameters(given_units, coords, labels)
    each = ("section",) if plan.several else ()
    for key, (function, unit) in found.items():
        given = labels.get(key, Variable())
        more = {"period": function.period} if isinstance(function, Angle) else {}
        variables[key] = Variable(
            (*each, "point", *own[key]),
            given.units or unit,
            given.long_name or key,
            {**more, **given.attrs},
        )
    variables["count"] = Variable(each, long_name="number of points")
    variables["status"] = Variable(
        long_name="status of the run",
        attrs={"flag_values": list(range(len(STATUS))), "flag_meanings": " ".join(STATUS)},
    )
    variables["period"] = Variable(
        each,
        units="1",
        long_name="points after which the attractor repeats, 0 if none, -1 if unknown",
        attrs={"tolerance": plan.period.tolerance, "max_period": plan.period.longest},
    )
    variables["period_status"] = Variable(
        each,
        long_name="what the period is based on, or why it is unknown",
        attrs={
            "flag_values": list(range(len(PERIOD_STATUS))),
            "flag_meanings": " ".join(PERIOD_STATUS),
        },
    )
    variables["slow_transient"] = Variable(long_name="still approaching the attractor")
    variables["flags"] = Variable(long_name="where no derivative exists, as in Solution.flags")
    return variables


def _handed_on(dataset, y0, carried, coords):
    """State every lane of a carried diagram started from, flat over the grid."""
    axis = list(coords).index(carried.along) if carried.along else 0
    names = [
        "carry_" + jax.tree_util.keystr(path, simple=True, separator="_")
        for path, _ in jax.tree_util.tree_leaves_with_path(y0)
    ]
    leaves = []
    for name, given in zip(names, jax.tree.leaves(y0), strict=True):
        ends = np.moveaxis(np.asarray(dataset[name]), axis, 0)
        begin = np.full_like(ends[:1], given)
        ends = [ends[1:], begin] if carried.direction == "downwards" else [begin, ends[:-1]]
        leaves.append(np.moveaxis(np.concatenate(ends), 0, axis).reshape(-1, *np.shape(given)))
    return jax.tree.unflatten(jax.tree.structure(y0), leaves)


def _numbers(integrator, record):
    """The numbers of a run, and the integrator without its own."""
    step, rest = eqx.partition(integrator.step, eqx.is_inexact_array_like)
    static = eqx.tree_at(lambda i: i.step, integrator, rest)
    return Numbers(record.t0, record.transient, record.duration, step), static


def _spread(numbers, shape):
    return jax.tree.map(lambda a: np.broadcast_to(np.asarray(a, np.float64), shape), numbers)


def _check(lane, numbers, coords, starts, check, dataset, observed, settings: Settings):
    """Some lanes again, more accurately, and how far their points moved."""
    shape = tuple(v.size for v in coords.values())
    lanes = math.prod(shape)
    picked = np.unique(np.linspace(0, lanes - 1, min(check, lanes)).round().astype(int))
    place = np.unravel_index(picked, shape)
    # As many lanes as a block of the sweep has, so that its program serves, unless that is a lot more.
    block = math.prod(block_shape(shape, settings.storage.lanes))
    filled = np.resize(picked, block) if picked.size <= block <= ACCURACY.side_by_side else picked
    points = {
        key: v[i] for (key, v), i in zip(coords.items(), np.unravel_index(filled, shape), strict=True)
    }
    arguments = {**points, "numbers": _spread(numbers, filled.shape)}
    if starts is not None:
        arguments["start"] = jax.tree.map(lambda a: np.asarray(a)[filled], starts)
    program = lanes_of(lane, settings.compute.executor, settings.compute.threads)
    with Progress(f"{settings.name}, check", shown=settings.compute.progress):
        again = jax.tree.map(lambda a: np.asarray(a)[: picked.size], program(arguments))
    index = {key: xr.DataArray(i, dims="checked") for key, i in zip(coords, place, strict=True)}
    before = dataset[[*observed, "count", "period"]].isel(index)
    same = np.asarray(before["count"]) == np.asarray(again["count"])
    dims = before["period"].dims
    extra: dict[str, Any] = {
        f"checked_{key}": ("checked", points[key][: picked.size], dict(dataset[key].attrs))
        for key in coords
    }
    extra["checked_period"] = (dims, np.asarray(before["period"]), {})
    for key in observed:
        gap = np.abs(np.asarray(before[key]) - np.asarray(again[key]))
        axes = before[key].dims
        gap = np.where(np.isnan(gap), 0.0, gap).max(axis=axes.index("point"))
        told = same.reshape(*same.shape, *(1,) * (gap.ndim - same.ndim))
        attrs = {
            "long_name": f"error estimate of {key}: largest difference to a finer integration",
            **{k: v for k, v in dataset[key].attrs.items() if k == "units"},
        }
        axes = tuple(dim for dim in axes if dim != "point")
        extra[f"error_{key}"] = (axes, np.where(told, gap, np.nan), attrs)
    return extra
