"""Least and greatest values of a motion: where a component's rate is zero, or at an event or an end.

Between two recorded steps a motion is smooth. The quintic through both states, their rates and the
rates of these says which component may have an extreme there, and the motion itself, by a shorter step
of the method, how large it is.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..hybrid import AbstractHybridSystem, Integrator, Solution, StateLog
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.executor import COMPACT
from ..hybrid.stepper import as_stepper
from ._accuracy import ACCURACY

ROWS = 1 + ACCURACY.samples * ACCURACY.block  # of the log of steps
INSIDE = np.arange(1, 8) / 8  # of a step: where the quintic is looked at first


def _hermite(order: int) -> np.ndarray:
    """Coefficients by powers of the place in [0, 1], of values and `order` derivatives at both ends."""
    count = 2 * (order + 1)
    rows = np.zeros((count, count))
    powers = np.arange(count)
    for k in range(order + 1):
        factor = np.prod([powers - i for i in range(k)], axis=0) if k else np.ones(count)
        rows[2 * k + 1] = factor
        rows[2 * k] = np.where(powers == k, factor, 0.0)
    return np.linalg.inv(rows)


CUBIC, QUINTIC = _hermite(1), _hermite(2)


def run_with_extremes(
    run: Callable, begin: Any, span: Any, state: Any, mode: Any, system: AbstractHybridSystem,
    args: Any, integrator: Integrator, y: Callable,
) -> tuple[Solution, Float[Array, " size"], Float[Array, " size"]]:  # fmt: skip
    """A motion, with the least and the greatest value of each number of the state.

    `run(begin, span, state, mode)`: its solution, with `ROWS` of a log of steps. A motion that takes
    more of them is run again from the last of these on. `y`: the state of the system as a function of
    the logged one.
    """
    # The motion is most of the program: traced once, compiled once.
    run = eqx.filter_closure_convert(run, begin, span, state, mode)
    shapes = eqx.filter_eval_shape(run, begin, span, state, mode)
    kept = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), _without_steps(shapes))
    end, count = begin + span, 2 * ravel_pytree(y(state))[0].size

    def going(carry):
        return carry[-1]

    def body(carry):
        kept, best, first, begin, span, state, mode, _ = carry
        found = run(begin, span, state, mode)
        steps = found.steps
        best = _greatest(system, args, integrator, steps, y, best)
        kept = jax.tree.map(lambda a, b: jnp.where(first, a, b), _without_steps(found), kept)
        full = steps.count >= ROWS
        # Not from before an event: the last row may be that, unless two are of one instant.
        at = ROWS - 2 + (steps.t[ROWS - 1] == steps.t[ROWS - 2]).astype(jnp.int32)
        state, mode = jax.tree.map(
            lambda row, old: jnp.where(full, row[at], old[-1]).astype(row.dtype),
            (steps.y, steps.mode),
            (jax.tree.map(lambda a: a[None], found.y1), found.mode1[None]),
        )
        later = jnp.where(full, steps.t[at], begin + span)
        span = jnp.minimum(ACCURACY.strays * (later - begin), end - later)
        more = (later > begin) & (span > 0) & found.successful
        return kept, best, jnp.zeros((), bool), later, span, state, mode, more

    yes, best = jnp.ones((), bool), jnp.full(count, -jnp.inf)
    mode = jnp.asarray(mode)
    start = kept, best, yes, jnp.asarray(begin), jnp.asarray(span), state, mode, yes
    kept, best, *_ = jax.lax.while_loop(going, body, start)
    return kept, -best[count // 2 :], best[: count // 2]


def _without_steps(solution: Solution) -> Solution:
    return eqx.tree_at(lambda s: s.steps, solution, None)


def _greatest(
    system: AbstractHybridSystem, args: Any, integrator: Integrator, steps: StateLog, y: Callable,
    best: Array,
) -> Array:  # fmt: skip
    """The greatest value of each number of the state, and of its negative, in a log of steps."""
    stepper = as_stepper(integrator.method)
    unravel = ravel_pytree(jax.tree.map(lambda a: a[0], y(steps.y)))[1]
    flat = jax.vmap(lambda state: ravel_pytree(y(state))[0])(steps.y)
    known = (jnp.arange(ROWS, dtype=jnp.int32) < steps.count)[:, None] & jnp.isfinite(flat)
    both, size = jnp.concatenate([flat, -flat], axis=1), flat.shape[1]
    best = jnp.maximum(best, jnp.max(jnp.where(jnp.tile(known, (1, 2)), both, -jnp.inf), axis=0))
    least = ENGINE.some_roundings * jnp.tile(jnp.maximum(jnp.abs(best[:size]), jnp.abs(best[size:])), 2)
    modes = jnp.maximum(steps.mode, 0)

    def field(t, state, mode):
        return ravel_pytree(system.vector_field(t, unravel(state), mode, args))[0]

    def rates(t, state, mode):
        """Rates of the state and their rates."""
        one = jnp.ones_like(t)
        dy = field(t, state, mode)
        return dy, jax.jvp(lambda t, y: field(t, y, mode), (t, state), (one, dy))[1]

    def looked_at(index):
        """Bounds of the values of a step from a row, and where; of numbers and their negatives."""
        mode = modes[index + 1]  # of the step that ends there
        h = steps.t[index + 1] - steps.t[index]
        ends = [(flat[i], *rates(steps.t[i], flat[i], mode)) for i in (index, index + 1)]
        data = [h**k * end[k] for k in range(3) for end in ends]
        five, three = jnp.asarray(QUINTIC) @ jnp.stack(data), jnp.asarray(CUBIC) @ jnp.stack(data[:4])
        value, slope, bend = (jnp.asarray(_powers(k, 6)) @ five for k in range(3))
        other = jnp.asarray(_powers(0, 4)) @ three
        # At a top near the place that is looked at, and as much higher as the quintic is uncertain.
        top = 0.5 * slope**2 / jnp.maximum(jnp.abs(bend), 1e-300)
        top = jnp.minimum(top, jnp.abs(slope) * (INSIDE[1] - INSIDE[0]))
        above = top + jnp.abs(value - other)
        both = jnp.concatenate([value, -value], axis=1)
        most = jnp.max(both + jnp.tile(above, (1, 2)), axis=0)
        good = (h > 0) & (index + 1 < steps.count) & jnp.isfinite(most)
        return jnp.where(good, most, -jnp.inf), jnp.argmax(both, axis=0)

    def next_ones(before):
        """Of all steps the largest values below those `before`: values, rows, places."""

        def block(k, found):
            index = k * ACCURACY.block + jnp.arange(ACCURACY.block, dtype=jnp.int32)
            values, places = jax.vmap(looked_at)(index)
            values = jnp.where(values < before[None, :], values, -jnp.inf)
            row = jnp.argmax(values, axis=0)
            new = (jnp.max(values, axis=0), index[row], jnp.take_along_axis(places, row[None], 0)[0])
            return jax.tree.map(lambda a, b: jnp.where(new[0] > found[0], a, b), new, found)

        none = jnp.zeros(2 * size, jnp.int32)
        begun = (jnp.full(2 * size, -jnp.inf), none, none.astype(jnp.argmax(best).dtype))
        return jax.lax.fori_loop(0, -(-steps.count // ACCURACY.block), block, begun)

    def greatest_near(number, row, place):
        """Greatest value of one number near a place inside a step."""
        part, sign = number % size, jnp.where(number < size, 1.0, -1.0)
        t0, start, mode = steps.t[row], flat[row], modes[row + 1]
        h = steps.t[row + 1] - t0
        slope = unravel(field(t0, start, mode))

        def there(t, y):
            return system.vector_field(t, y, mode, args)

        def body(_, carry):
            at, low, high, highest = carry
            state, _, _ = stepper.step(there, t0, unravel(start), slope, at, COMPACT)
            state = ravel_pytree(state)[0]
            dy, ddy = (sign * a[part] for a in rates(t0 + at, state, mode))
            highest = jnp.fmax(highest, sign * state[part])
            low, high = jnp.where(dy > 0, at, low), jnp.where(dy > 0, high, at)
            new = at - dy / jnp.where(ddy < 0, ddy, -1e-300)
            return jnp.where((new > low) & (new < high), new, 0.5 * (low + high)), low, high, highest

        at = jnp.asarray(INSIDE)[place] * h
        gap = (INSIDE[1] - INSIDE[0]) * h
        begun = (at, at - gap, at + gap, jnp.asarray(-jnp.inf))
        return jax.lax.fori_loop(0, ACCURACY.rounds, body, begun)[-1]

    def going(carry):
        return jnp.any(carry[-1])

    def body(carry):
        best, before, _ = carry
        values, rows, places = next_ones(before)
        wanted = values > best + least

        def one(number, best):
            def look(best):
                return best.at[number].max(greatest_near(number, rows[number], places[number]))

            return jax.lax.cond(wanted[number], look, lambda best: best, best)

        return jax.lax.fori_loop(0, 2 * size, one, best), values, wanted

    begun = best, jnp.full(2 * size, jnp.inf), jnp.ones(2 * size, bool)
    return jax.lax.while_loop(going, body, begun)[0]


def _powers(order: int, count: int) -> np.ndarray:
    """Derivatives of the first powers at the places inside a step, `[place, power]`."""
    degrees = np.arange(count)
    factors = np.prod([degrees - i for i in range(order)], axis=0) if order else np.ones(count)
    return factors * INSIDE[:, None] ** np.maximum(degrees - order, 0)
