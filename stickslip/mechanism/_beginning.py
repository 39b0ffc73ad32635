"""The sense in which a contact will slide whose direction vanishes at this very instant."""

import functools
import operator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where

from ._instant import Instant, floats, touching
from ._scalars import Factors, dot, is_zero

if TYPE_CHECKING:
    from ._mechanism import AbstractMechanism

HIGHEST = 3  # a lever that is zero where the mechanism starts from rest: its speed grows as t^3


def begun(
    machine: "AbstractMechanism", t: Any, y: Any, at: Instant, states: list, args: Any
) -> list[Any]:
    """`states`, where contacts that have neither direction nor speed slide as they will in an instant.

    Such a contact bears nothing and holds nothing: the first derivative of its speed that is not zero
    says which way it slides. Under loads that are yet to rise it is that of an acceleration of all
    coordinates: about a lever of zero the speed has the same sign whichever way one coordinate goes.
    """
    lost = {c: _vanishes(at.directions[c]) & (at.speeds[c] == 0.0) for c in _turning(machine)}
    senses = _senses(machine, t, y, states, args, lost)
    states = list(states)
    for c, sense in senses.items():
        sense = where(sense == 0.0, 1.0, sense)
        states[c] = where(lost[c] & (states[c] != 2.0), sense, states[c])
    return states


def drifting(machine: "AbstractMechanism", t: Any, y: Any, at: Instant, states: Any, args: Any) -> Any:
    """`states`, of which contacts at rest that others hold at this very instant alone begin to slide.

    The direction of such a contact depends on those of others at rest now and not in an instant, as two
    that coincide while one of them turns. The first derivative of its speed that is not zero says which
    way it slides; where there is none, it depends on the others for longer, and rests.
    """
    rows = _turning(machine)
    if not rows:
        return states  # which may be an array
    states = list(states)
    lost: dict[int, Any] = {}
    for island in machine.islands:
        for c in island.rows if not island.dependent else ():
            if c in rows and len(island.rows) > 1:
                others = [d for d in island.rows if d != c]
                order = [*others, c]
                mass = at.mass.of(island.columns)
                J = [[at.directions[d][j] for j in island.columns] for d in order]
                mobility = [mass.solve(row) for row in J]
                rest = [states[d] == 0.0 for d in order]
                A = [
                    [where(rest[i] & rest[k], dot(p, row), float(i == k)) for k, row in enumerate(J)]
                    for i, p in enumerate(mobility)
                ]
                lost[c] = rest[-1] & Factors(A, semidefinite=True).depends[-1]
    for c, sense in _senses(machine, t, y, states, args, lost).items():
        states[c] = where(lost[c], sense, states[c])
    return states


def _turning(machine: "AbstractMechanism") -> list[int]:
    return [c for c, row in enumerate(machine.directions) if np.isnan(row).any()]


def _senses(
    machine: "AbstractMechanism", t: Any, y: Any, states: list, args: Any, lost: dict[int, Any]
) -> dict[int, Any]:
    """Signs of the first derivatives that are not zero of the speeds of the contacts in `lost`."""
    if not lost:
        return {}
    sliding = [where(lost[c], 1.0, s) if c in lost else s for c, s in enumerate(states)]
    slope = machine.vector_field(t, y, machine.mode_of(sliding), args)
    at_y = machine.to_coordinates(y)
    q_rate, a = machine.to_coordinates(slope)
    q, v = floats(at_y[0]), floats(at_y[1])

    def ahead(time: Any, a: Any) -> Any:
        bends = (*a, *[0.0] * (len(q) - len(a)))
        places = (
            None if x is None else x + time * rate + 0.5 * time * time * bend
            for x, rate, bend in zip(q, q_rate, bends, strict=True)
        )
        speeds = (x + time * rate for x, rate in zip(v, a, strict=True))
        found = touching(machine, t + time, type(q)(*places), type(v)(*speeds), args)[2]
        return jnp.stack([found[c] for c in lost])

    both = jax.tree.map(lambda x: jnp.stack([x, jnp.ones_like(x)]), floats(a))
    function, rates, zero = ahead, [], jnp.zeros((), jnp.float64)
    for _ in range(HIGHEST):
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
