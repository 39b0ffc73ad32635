"""Which attractor a motion has come to: one judgement, for maps and for sweeps."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._jit_by_code import jit_by_code
from ..hybrid.components import numbers_of
from ._accuracy import ACCURACY
from ._attractor import Attractor
from ._lanes import Lanes, flat
from ._rests import still_between
from ._settle import Settle
from ._tube import Tube, distances_of_one, stack_of

NOT_SETTLED, LEFT, FAILED = -1, -2, -3
OTHERS = {NOT_SETTLED: "not settled", LEFT: "left the limits", FAILED: "failed"}


def meanings_of(names: Mapping[int, str]) -> dict[str, Any]:
    """Attributes of an array of codes: their words, as the CF conventions have them without blanks."""
    words = [name.replace(" ", "_") for name in names.values()]
    return {"flag_values": list(names), "flag_meanings": " ".join(words)}


class Known(NamedTuple):
    """The attractors that are known, and the limits, as arrays.

    - `tubes`, `radius`, `number`: of fixed points and orbits, and the numbers of these attractors.
    - `rest`, `mode`, `rest_number`: `[rest, ...]`, of each rest one state; `rests`: how many there are.
    - `low`, `high`: limits of each number of a state.
    """

    tubes: Tube
    radius: np.ndarray
    number: np.ndarray
    rest: np.ndarray
    mode: np.ndarray
    rest_number: np.ndarray
    rests: np.ndarray
    low: np.ndarray
    high: np.ndarray


def known_of(attractors: Sequence[Attractor], settle: Settle, lanes: Lanes) -> Known:
    """Attractors as arrays whose lengths are powers of two, so that few programs do for all."""
    size = lanes.size
    moving = [(a.tube, a.radius, k) for k, a in enumerate(attractors) if a.tube is not None]
    tubes = stack_of([tube for tube, *_ in moving], size)
    more = len(tubes.mode) - len(moving)
    radius = np.array([radius for _, radius, _ in moving] + [1.0] * more)
    number = np.array([k for *_, k in moving] + [NOT_SETTLED] * more)
    # Under a force of the time what rests now need not rest for ever.
    free = settle.forcing_period is None
    held = [(flat(a.motion), a.mode, k) for k, a in enumerate(attractors) if free and a.kind == "rest"]
    more = (1 << max(len(held) - 1, 0).bit_length()) - len(held)
    rest, mode, rest_number = zip(*held, *[(np.zeros(size), -1, NOT_SETTLED)] * more, strict=True)
    names = numbers_of(lanes.unravel(np.zeros(size)))
    low, high = np.array([settle.limits.get(name, (-np.inf, np.inf)) for name in names]).T
    rows = np.array(rest), np.array(mode), np.array(rest_number), np.array(len(held))
    return Known(tubes, radius, number, *rows, low, high)


def code_of(system: Any, args: Any, unravel: Any, known: Known, t: Any, moved: Any) -> Any:
    """Number of the attractor that a motion has come to at a time [s], or one of `OTHERS`.

    `moved`: a `Moved` of one motion, whose `mode` has the type of the system's.
    """
    away = distances_of_one(known.tubes, moved.y, moved.mode.astype(jnp.int64)) / known.radius
    nearest = jnp.argmin(away)
    code = jnp.where(away[nearest] <= 1.0, known.number[nearest], NOT_SETTLED)

    def at_rest(k, code):
        given = system, args, unravel, t, moved.mode, known.rest[k], moved.y
        same = (moved.mode == known.mode[k].astype(moved.mode.dtype)) & still_between(*given)
        return jnp.where(same, known.rest_number[k], code)

    # No round for what moves: most motions do.
    rounds = jnp.where(moved.still & moved.successful, known.rests, 0)
    code = jax.lax.fori_loop(0, rounds, at_rest, code)
    code = jnp.where(moved.successful, code, FAILED)
    # Also where it has gone on to infinity, at which the run has failed.
    return jnp.where(jnp.any((moved.y < known.low) | (moved.y > known.high)), LEFT, code)


@jit_by_code
def _codes(system, args, unravel, known, t, moved, count):
    """Codes of the first `count` motions, part by part: mostly few are open in a block of one size."""
    size = ACCURACY.many

    def part(k, code):
        rows = jax.tree.map(lambda a: jax.lax.dynamic_slice_in_dim(a, k * size, size), moved)
        found = jax.vmap(lambda one: code_of(system, args, unravel, known, t, one))(rows)
        return jax.lax.dynamic_update_slice_in_dim(code, found, k * size, 0)

    none = jnp.full(moved.still.shape, NOT_SETTLED)
    return jax.lax.fori_loop(0, -(-count // size), part, none)


def codes(lanes: Lanes, known: Known, t: float, moved: Any) -> np.ndarray:
    """`code_of` of many motions, in blocks of one size."""
    count = len(moved.y)
    found = [np.zeros(0, int)]
    moved = moved._replace(mode=np.asarray(moved.mode, lanes.mode_type), result=None, t=None)
    for begin in range(0, count, lanes.block):
        rows = np.minimum(np.arange(begin, begin + lanes.block), count - 1)
        block = jax.tree.map(lambda a, rows=rows: a[rows], moved)
        given = lanes.system, lanes.args, lanes.unravel, known, jnp.asarray(t)
        kept = min(count - begin, lanes.block)
        found.append(np.asarray(_codes(*given, block, jnp.asarray(kept)))[:kept])
    return np.concatenate(found)
