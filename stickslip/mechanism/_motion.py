"""Motion of velocities while some of the contacts on them rest, by the forces in these contacts."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import SMOOTH, where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._local import Part
from ._scalars import Factors, Mass, dot, is_zero, minus, over, times, total


class Motion(NamedTuple):
    """Motion while each contact rests or slides in a known sense.

    - `acceleration` of each velocity;
    - `reaction`: generalised force of all resting contacts together, unique even where theirs are not;
    - `force` of each resting contact, 0 where it slides. Of contacts with dependent directions, those
      that lead bear all of it; None where it is not asked for.
    """

    acceleration: Any
    reaction: Any
    force: Any


def resisting(share: Any) -> Any:
    """The acceleration that a force of 1 N in a contact changes along it [1/kg], never 0.

    Where its direction vanishes it changes nothing: to rest would take a force without bound.
    """
    with jax.named_scope(SMOOTH):
        return jnp.maximum(share, ENGINE.tiny)


def motion_by_forces(
    part: Part, M: Mass, F: Any, J: list[list], rest: Any, held: Any, gamma: list
) -> Motion:
    """Motion of a group whose directions vary or depend on each other.

    `held`: of the contacts in `rest` a largest independent part, which leads and bears all. Where
    directions vary it is all of them: which depend on others is found by elimination.
    """
    m, n, varies = len(part.rows), len(part.columns), part.varies
    free = M.solve(F)
    mobility = [M.solve(row) for row in J]
    gram = [[dot(p, row) for row in J] for p in mobility]
    # Stops bear before friction does, where directions that vary turn out to depend on each other.
    order = [*range(part.contacts, m), *range(part.contacts)]

    def entry(c: int, d: int) -> Any:
        if c == d:
            return where(held[c], resisting(gram[c][c]) if varies else gram[c][c], 1.0)
        return 0.0 if is_zero(gram[c][d]) else where(held[c] & held[d], gram[c][d], 0.0)

    sought = [minus(g, dot(row, free)) for g, row in zip(gamma, J, strict=True)]
    factors = Factors([[entry(c, d) for d in order] for c in order], semidefinite=varies)
    solved = factors.solve([where(held[c], sought[c], 0.0) for c in order])
    force = [solved[order.index(c)] for c in range(m)]
    a = [total((x, *(times(mobility[c][j], force[c]) for c in range(m)))) for j, x in enumerate(free)]
    for c in range(m):
        # A velocity that a resting contact alone decides has no rounding of a sum.
        own = [j for j in range(n) if not is_zero(J[c][j])]
        if len(own) == 1:
            (j,) = own
            decides = rest[c] & (J[c][j] != 0.0) if varies else rest[c]
            a[j] = where(decides, times(over(J[c][j]), gamma[c]), a[j])
        elif np.isnan(part.directions[c]).any():
            a = _with_decided_velocities(a, J[c], own, rest[c], gamma[c])
    reaction = [total(times(J[c][j], force[c]) for c in range(m)) for j in range(n)]
    if part.rank == n and all(map(is_zero, gamma)):
        leads = [held[c] & ~d for c, d in zip(order, factors.depends, strict=False)]
        every = total(where(h, 1, 0) for h in leads or held) == n
        a = [where(every, 0.0, x) for x in a]
        reaction = [where(every, times(-1.0, f), x) for f, x in zip(F, reaction, strict=True)]
    return Motion(tuple(a), tuple(reaction), tuple(force))


@jax.named_scope(SMOOTH)
def _with_decided_velocities(a: list, n: list, own: list[int], rests: Any, gamma: Any) -> list[Any]:
    """`a`, of which a contact that rests decides the velocity along its largest entry.

    A velocity that it holds alone as its other entries vanish then has no acceleration at all, where
    rounding of the forces that cancel would be the whole motion."""
    found, sizes = list(a), [jnp.abs(jnp.asarray(n[j])) for j in own]
    for place, j in enumerate(own):
        others = [i for i in own if i != j]
        leads = rests & (sizes[place] > 0.0)
        for other, size in enumerate(sizes):
            if other != place:
                leads &= sizes[place] > size if other < place else sizes[place] >= size
        rate = minus(gamma, dot([n[i] for i in others], [a[i] for i in others]))
        found[j] = where(leads, times(over(n[j]), rate), a[j])
    return found
