"""Which attractor of a map the motion from a start comes to: a function for sweeps."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._types import Given, Numeric
from .._validation import check_count, check_type, one_number, refusal
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid.components import component_list, numbers_of
from ..sweep import Labels, Variable
from ._basins import Basins, check_start, starts_in
from ._codes import FAILED, NOT_SETTLED, OTHERS, code_of, known_of, meanings_of
from ._lanes import Lanes, flat
from ._settle import Settle


class Judge:
    """Which of the attractors of a map the motion from a start comes to: a function for sweeps.

    A map of a thousand starts finds the attractors; this says of a million where they go, on all cores
    or a cluster, in a store that goes on where it was interrupted, or only where neighbours differ:

    ```python
    judge = Judge(system, found, settle)
    run_sweep(judge, judge.grid((1000, 1000)), store="basins.zarr", labels=judge.labels)
    refine_sweep(judge, judge.grid((32, 32)), {"code": 0}, levels=6, labels=judge.labels)
    run_sweep(judge, {"start": np.arange(10**6)}, inputs=judge.spread(10**6), labels=judge.labels)
    ```

    A motion that comes to an attractor that the map has not found is "not settled".

    **Arguments** `found`: the `Basins` of this system, whose box and other components of the state are
    taken; `settle`, `integrator`, `args`: as of `basins`.

    **Returns**, called with the components of the box by name, `code`, the number of the attractor or
    -1, -2, -3 as in `Basins`, and `entry` [s] as there. More components may be given; others are
    those of the map. `start` numbers the lanes, and nothing depends on it.

    **Errors** `ValueError`/`TypeError` naming the argument.
    """

    def __init__(
        self,
        system: Given[AbstractHybridSystem],
        found: Given[Basins],
        settle: Given[Settle],
        *,
        integrator: Given[Integrator | None] = None,
        args: PyTree = None,
    ):
        check_type("found", found, Basins, "a Basins")
        check_type("settle", settle, Settle, "a Settle(duration)")
        if integrator is not None:
            check_type("integrator", integrator, Integrator, "an Integrator or None")
        first = jax.tree.map(lambda leaf: leaf[(0,) * found.code.ndim], found.starts)
        self._y0, self._box = check_start(system, first, found.box, settle, args)
        self._names = numbers_of(self._y0)
        self._lanes = Lanes(system, args, integrator, self._y0)
        self._known = jax.tree.map(jnp.asarray, known_of(found.attractors, settle, self._lanes))
        self._times = np.concatenate([[0.0], settle.times])
        words = {k: attractor.name for k, attractor in enumerate(found.attractors)} | OTHERS
        code = Variable(long_name="attractor", attrs=meanings_of(words))
        entry = Variable(long_name="time of entry", units="s")
        self.labels = Labels({"code": code, "entry": entry}, name="basins")

    def grid(self, points: Given[tuple[int, ...]]) -> dict[str, np.ndarray]:
        """Middles of the cells of a grid over the box, by component: how many along each."""
        y, shape = starts_in(self._y0, self._box, check_type("points", points, tuple, "a tuple"))
        rows = y.reshape(*shape, -1)
        return {
            name: np.moveaxis(rows[..., self._names.index(name)], axis, 0).reshape(shape[axis], -1)[
                :, 0
            ]
            for axis, name in enumerate(self._box)
        }

    def spread(self, points: Given[int]) -> dict[str, np.ndarray]:
        """Points spread evenly over the box after Sobol, by component, one entry for each."""
        y, _ = starts_in(self._y0, self._box, check_count("points", points, 1))
        return {name: y[:, self._names.index(name)] for name in self._box}

    def __call__(self, **place: Numeric) -> dict[str, Any]:
        """Code and time of entry of the motion from a start."""
        y = jnp.asarray(flat(self._y0))
        if not set(self._box) <= set(place):
            raise refusal("place", list(place), f"all components of the box: {', '.join(self._box)}")
        for name, value in place.items():
            if name in self._names:
                at = self._names.index(name)
                y = y.at[at].set(jnp.asarray(one_number(f"place[{name!r}]", value), y.dtype))
            elif name != "start":
                allowed = f"numbers of the state, {component_list(self._y0)}, or start"
                raise refusal("place", name, allowed)
        lanes, times = self._lanes, jnp.asarray(self._times)
        system, args = eqx.combine(lanes.numbers, lanes.rest)

        def on(state):
            number, y, mode, *_ = state
            t = times[number + 1]
            moved = lanes.run(lanes.numbers, times[number], t, y, mode)
            code = code_of(system, args, lanes.unravel, self._known, t, moved)
            found = (code != NOT_SETTLED) & (code != FAILED)
            mode = moved.mode.astype(jnp.int64)
            return number + 1, moved.y, mode, code, jnp.where(found, t, jnp.nan)

        begin = jnp.asarray(0), y, jnp.asarray(-1), jnp.asarray(NOT_SETTLED), jnp.asarray(jnp.nan)
        *_, code, entry = jax.lax.while_loop(
            lambda state: (state[0] < times.size - 1) & (state[3] == NOT_SETTLED), on, begin
        )
        return {"code": code, "entry": entry}
