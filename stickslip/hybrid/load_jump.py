"""A jump of a load, which may violate guards of a system at once."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import PyTree

from .accuracy import ACCURACY
from .event_functions import guards_over_magnitudes
from .status import JUMP
from .system import AbstractHybridSystem, guard_directions, mode_type
from .tree import select


def state_after_jump(
    system: AbstractHybridSystem, before: tuple[Any, PyTree], t: Any, y: PyTree, mode: Any, args: PyTree
) -> tuple[Any, Any]:
    """State and mode of a system behind a jump of its load, which may violate guards at once.

    `before`: the last instant before the jump and the arguments there; `t`, `args`: those behind it. A
    guard that fires both ways has the sign that it had before, until it fires.
    """
    if system.answers_jumps:
        y, mode = system.transition(t, y, mode, JUMP, args)
        return y, jnp.asarray(mode, mode_type(system))
    if not system.guard_names:
        return y, mode
    directions = guard_directions(system)
    signs = jnp.asarray([-1.0 if d == "rising" else 1.0 for d in directions])
    both = jnp.asarray([d == "both" for d in directions])
    if "both" in directions:
        had = jnp.sign(guards_over_magnitudes(system, before[0], y, mode, before[1]))
        signs = jnp.where(both, had, signs)
    for _ in range(ACCURACY.guards_of_one_jump):
        falls = signs * guards_over_magnitudes(system, t, y, mode, args)
        lowest = jnp.argmin(falls).astype(jnp.int32)
        jumped = system.transition(t, y, mode, lowest, args)
        violated = (falls[lowest] < -ACCURACY.slack) & (mode >= 0)
        after = jumped[0], jnp.asarray(jumped[1], mode_type(system))
        y, mode = select(violated, after, (y, jnp.asarray(mode, mode_type(system))))
        if "both" in directions:
            signs = jnp.where(both & (jnp.arange(both.size, dtype=jnp.int32) == lowest), 0.0, signs)
    return y, mode
