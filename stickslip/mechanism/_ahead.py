"""Senses in which contacts will slide whose directions vanish or coincide at this very instant."""

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
from ._scalars import Factors, dot, is_zero


def sliding_ahead(now: Moment, states: Any, accelerations: Callable) -> Any:
    """`states`, where contacts that have neither direction nor speed slide as they will in an instant.

    Such a contact bears nothing and holds nothing: the first derivative of its speed that is not zero
    says which way it slides. Under loads that are yet to rise it is that of an acceleration of all
    coordinates: about a lever of zero the speed has the same sign whichever way one coordinate goes.

    `accelerations`: those of a moment in the mode of some states.
    """
    at, rows = now.at, _turning(now)
    lost = {c: _vanishes(at.directions[c]) & (at.speeds[c] == 0.0) for c in rows}
    found = list(states) if rows else states
    for c, sense in _senses(now, states, lost, accelerations).items():
        sense = where(sense == 0.0, 1.0, sense)
        found[c] = where(lost[c] & (found[c] != 2.0), sense, found[c])
    return found


def loosened_ahead(now: Moment, states: Any, accelerations: Callable) -> Any:
    """`states`, of which contacts at rest that others hold at this very instant alone begin to slide.

    The direction of such a contact depends on those of others at rest now and not in an instant, as two
    that coincide while one of them turns. The first derivative of its speed that is not zero says which
    way it slides; where there is none, it depends on the others for longer, and rests.
    """
    rows, lost = _turning(now), {}
    for group in now.structure.contact_groups:
        for c in group.rows if group.part.in_general_position and group.m > 1 else ():
            if c in rows:
                order = [*(d for d in group.rows if d != c), c]
                mass, J = now.at.mass.of(group.columns), now.at.directions
                lines = [[J[d][j] for j in group.columns] for d in order]
                mobility = [mass.solve(line) for line in lines]
                rest = [states[d] == 0.0 for d in order]
                A = [
                    [where(rest[i] & rest[k], dot(p, n), float(i == k)) for k, n in enumerate(lines)]
                    for i, p in enumerate(mobility)
                ]
                lost[c] = rest[-1] & Factors(A, semidefinite=True).depends[-1]
    found = list(states) if lost else states
    for c, sense in _senses(now, states, lost, accelerations).items():
        found[c] = where(lost[c], sense, found[c])
    return found


def _turning(now: Moment) -> list[int]:
    """Contacts whose direction varies."""
    return [c for c, row in enumerate(now.structure.directions) if np.isnan(row).any()]


def _senses(now: Moment, states: Any, lost: dict[int, Any], accelerations: Callable) -> dict[int, Any]:
    """Signs of the first derivatives that are not zero of the speeds of the contacts in `lost`."""
    if not lost:
        return {}
    at = now.at
    a = accelerations(now, [where(lost[c], 1.0, s) if c in lost else s for c, s in enumerate(states)])
    q, v = floats(at.q), floats(at.v)

    def ahead(time: Any, a: Any) -> Any:
        bends = (*a, *[0.0] * (len(q) - len(a)))
        places = (
            None if x is None else x + time * rate + 0.5 * time * time * bend
            for x, rate, bend in zip(q, at.q_rate, bends, strict=True)
        )
        speeds = (x + time * rate for x, rate in zip(v, a, strict=True))
        found = now.touching(now.t + time, type(q)(*places), type(v)(*speeds))[2]
        return jnp.stack([found[c] for c in lost])

    both = jax.tree.map(lambda x: jnp.stack([x, jnp.ones_like(x)]), floats(a))
    function, rates, zero = ahead, [], jnp.zeros((), jnp.float64)
    for _ in range(ACCURACY.highest_rate):
        function = _rate(function)
        rates.append(jax.vmap(function, (None, 0))(zero, both))
    senses = jnp.zeros(len(lost))
    for rate in reversed([*(r[0] for r in rates), rates[-1][1]]):
        senses = where(rate == 0.0, senses, jnp.sign(rate))
    return dict(zip(lost, senses, strict=True))


def _vanishes(direction: list[Any]) -> Any:
    return functools.reduce(operator.and_, (n == 0.0 for n in direction if not is_zero(n)))


def _rate(function: Any) -> Any:
    one = jnp.ones((), jnp.float64)
    return lambda time, a: jax.jvp(lambda time: function(time, a), (time,), (one,))[1]
