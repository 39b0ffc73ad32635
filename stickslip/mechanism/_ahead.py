"""The sense in which a contact will slide whose direction vanishes at this very instant."""

import functools
import operator
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where

from ._accuracy import ACCURACY
from ._instant import floats
from ._moment import Moment
from ._scalars import is_zero


def senses_ahead(now: Moment, states: Any, accelerations: Callable) -> Any:
    """`states`, where contacts that have neither direction nor speed slide as they will in an instant.

    Such a contact bears nothing and holds nothing: the first derivative of its speed that is not zero
    says which way it slides. Under loads that are yet to rise it is that of an acceleration of all
    coordinates: about a lever of zero the speed has the same sign whichever way one coordinate goes.

    `accelerations`: those of a moment in the mode of some states.
    """
    rows = [c for c, row in enumerate(now.structure.directions) if np.isnan(row).any()]
    if not rows:
        return states
    at, states = now.at, list(states)
    lost = {c: _vanishes(at.directions[c]) & (at.speeds[c] == 0.0) for c in rows}
    sliding = [where(lost[c], 1.0, s) if c in lost else s for c, s in enumerate(states)]
    a = accelerations(now, sliding)
    q, v = floats(at.q), floats(at.v)

    def ahead(time: Any, a: Any) -> Any:
        bends = (*a, *[0.0] * (len(q) - len(a)))
        places = (
            None if x is None else x + time * rate + 0.5 * time * time * bend
            for x, rate, bend in zip(q, at.q_rate, bends, strict=True)
        )
        speeds = (x + time * rate for x, rate in zip(v, a, strict=True))
        found = now.touching(now.t + time, type(q)(*places), type(v)(*speeds))[2]
        return jnp.stack([found[c] for c in rows])

    both = jax.tree.map(lambda x: jnp.stack([x, jnp.ones_like(x)]), floats(a))
    function, rates, zero = ahead, [], jnp.zeros((), jnp.float64)
    for _ in range(ACCURACY.highest_rate):
        function = _rate(function)
        rates.append(jax.vmap(function, (None, 0))(zero, both))
    senses = jnp.ones(len(rows))
    for rate in reversed([*(r[0] for r in rates), rates[-1][1]]):
        senses = where(rate == 0.0, senses, jnp.sign(rate))
    for i, c in enumerate(rows):
        states[c] = where(lost[c] & (states[c] != 2.0), senses[i], states[c])
    return states


def _vanishes(direction: list[Any]) -> Any:
    return functools.reduce(operator.and_, (n == 0.0 for n in direction if not is_zero(n)))


def _rate(function: Any) -> Any:
    one = jnp.ones((), jnp.float64)
    return lambda time, a: jax.jvp(lambda time: function(time, a), (time,), (one,))[1]
