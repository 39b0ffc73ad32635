"""The same fit from many starts at once."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from ..sweep import map_lanes
from ._fit import Fit
from ._least_squares import least_squares
from ._unknowns import checked


def many_starts(
    residual: Callable[..., Any],
    starts: Any,
    *shared: Any,
    fit: Callable[..., Fit] = least_squares,
    chunk_size: int | None = None,
    **options: Any,
) -> Fit:
    """`fit` from every start, in chunks; `best` picks the best of them.

    **Arguments:** `residual(values, *shared)` and `options` as for `fit`, which is `least_squares` or
    `gradient_descent`; `starts`, one row of positive numbers for each name; `shared`, arrays that are
    the same for all starts: handed over like this, other data of the same shape use the program that
    is compiled already; `chunk_size` as for `stickslip.map_lanes`. **Returns** a `Fit` with the starts
    in front. **Raises** as they do.
    """
    starts = checked("starts", starts)
    count = next(iter(starts.values())).shape[:1]
    if count == () or any(a.shape != count for a in starts.values()):
        shapes = {name: a.shape for name, a in starts.items()}
        raise ValueError(f"starts has the shapes {shapes}: they must be rows of one length.")
    # One worker: the linear solver refuses arrays that are spread over devices, and two threads whose
    # programs hold linear algebra were seen to wait for each other for ever on a CPU.

    def one(start, shared):
        return fit(lambda values: residual(values, *shared), start, **options)

    run = map_lanes(one, executor="portable", chunk_size=chunk_size, workers=1)
    shared = jax.tree.map(lambda a: jnp.broadcast_to(a, count + jnp.shape(a)), shared)
    return run(starts, shared)
