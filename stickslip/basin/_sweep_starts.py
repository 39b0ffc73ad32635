"""Many starts, each judged by attractors that are known, in a store that survives interruption."""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._types import Given, Path
from .._validation import check_type
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid.components import numbers_of
from ..sweep import Compute, Labels, Storage, Variable, run_sweep
from ._basins import Basins, check_start, starts_in
from ._judged import FAILED, LEFT, NOT_SETTLED, OTHERS
from ._lanes import Lanes, flat
from ._rests import still_between
from ._settle import Settle
from ._tube import distances_of_one, stack_of

if TYPE_CHECKING:
    import xarray as xr


def sweep_starts(
    system: Given[AbstractHybridSystem],
    found: Given[Basins],
    settle: Given[Settle],
    points: Given[int | tuple[int, ...]],
    *,
    integrator: Given[Integrator | None] = None,
    args: PyTree = None,
    store: Path | Storage | None = None,
    compute: Given[Compute | None] = None,
    part: Given[tuple[int, int] | None] = None,
) -> "xr.Dataset":
    """Which of the attractors of a map each of many more starts of its box comes to: a sweep.

    A map of a thousand starts finds the attractors; this says of a million starts where they go, on all
    cores or a cluster, and goes on where it was interrupted. A motion that comes to an attractor that
    the map has not found is "not settled".

    **Arguments**

    - `found`: the `Basins` of this system; its box, and what else its starts have in common, are taken.
    - `settle`, `points`, `integrator`, `args`: as of `basins`.
    - `store`, `compute`, `part`: as of `run_sweep`.

    **Returns** a dataset of `code`, whose attributes name its values, and `entry` [s]: along the
    components of the box for a grid, otherwise along `start`.

    **Errors** as of `basins` and `run_sweep`.
    """
    check_type("found", found, Basins, "a Basins")
    check_type("settle", settle, Settle, "a Settle(duration)")
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator or None")
    first = jax.tree.map(lambda leaf: leaf[(0,) * found.code.ndim], found.starts)
    y0, box = check_start(system, first, found.box, settle, args)
    y, shape = starts_in(y0, box, points)
    names = {k: attractor.name for k, attractor in enumerate(found.attractors)} | OTHERS
    meanings = {"flag_values": list(names), "flag_meanings": ", ".join(names.values())}
    words = {
        "code": Variable(long_name="attractor", attrs=meanings),
        "entry": Variable(long_name="time of entry", units="s"),
    }
    grid = {"start": np.arange(len(y))}
    if isinstance(points, tuple):
        places = (y[:, numbers_of(y0).index(name)].reshape(shape) for name in box)
        grid = {
            name: np.moveaxis(place, axis, 0).reshape(shape[axis], -1)[:, 0]
            for axis, (name, place) in enumerate(zip(box, places, strict=True))
        }
    judge = _judge_by(found, settle, Lanes(system, args, integrator, y0))
    return run_sweep(
        lambda y, **_: judge(y), grid, inputs={"y": y.reshape(*shape, -1)}, store=store,
        labels=Labels(words, name="basins"), compute=compute, part=part,
    )  # fmt: skip


def _judge_by(found: Basins, settle: Settle, lanes: Lanes) -> Any:
    """A function that says of one start, a flat state, to which attractor it comes, and when."""
    times = jnp.asarray(np.concatenate([[0.0], settle.times]))
    names = numbers_of(lanes.unravel(jnp.zeros(len(flat(found.starts)) // found.code.size)))
    limits = [(names.index(name), *pair) for name, pair in settle.limits.items()]
    attractors = list(enumerate(found.attractors))
    tubes = {k: a.tube for k, a in attractors if a.tube is not None}
    stack = stack_of(list(tubes.values())) if tubes else None
    rests = [(k, a) for k, a in attractors if a.kind == "rest"] if settle.forcing_period is None else []

    def code_of(t, moved):
        code = jnp.asarray(NOT_SETTLED)
        if stack is not None:
            radius = np.array([found.attractors[k].radius for k in tubes])
            away = distances_of_one(stack, moved.y, moved.mode.astype(jnp.int64))[: len(tubes)] / radius
            near = jnp.asarray(list(tubes))[jnp.argmin(away)]
            code = jnp.where(jnp.min(away) <= 1.0, near, code)
        for k, rest in rests:
            there, mode = jnp.asarray(flat(rest.motion)), jnp.asarray(rest.mode, lanes.mode_type)
            given = lanes.system, lanes.args, lanes.unravel, t, mode, there, moved.y
            of_it = moved.still & (moved.mode == mode) & still_between(*given)
            code = jnp.where(of_it, k, code)
        for place, low, high in limits:
            code = jnp.where((low <= moved.y[place]) & (moved.y[place] <= high), code, LEFT)
        return jnp.where(moved.successful, code, FAILED)

    def judge(y):
        def on(state):
            number, y, mode, *_ = state
            moved = lanes.run(lanes.numbers, times[number], times[number + 1], y, mode)
            code, t = code_of(times[number + 1], moved), times[number + 1]
            known = (code != NOT_SETTLED) & (code != FAILED)
            mode = moved.mode.astype(jnp.int64)
            return number + 1, moved.y, mode, code, jnp.where(known, t, jnp.nan)

        begin = jnp.asarray(0), y, jnp.asarray(-1), jnp.asarray(NOT_SETTLED), jnp.asarray(jnp.nan)
        *_, code, entry = jax.lax.while_loop(
            lambda state: (state[0] < times.size - 1) & (state[3] == NOT_SETTLED), on, begin
        )
        return {"code": code, "entry": entry}

    return judge
