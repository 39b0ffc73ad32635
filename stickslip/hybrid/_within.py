r"""States inside a step, from the slopes of its stages: no further evaluation of the field.

$y(t + \theta h) \approx y + h\sum_i b_i(\theta)\,k_i$, where the slope at the end of the step counts as
one stage more. The weights meet the order conditions for $\theta$, of every rooted tree up to order 5
or, where the method does not allow it, 4, and as many as can be are zero. Source: Hairer, Nørsett &
Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., Springer 1993, sections II.2 and II.6.
"""

import functools

import numpy as np

from ._tableau import Tableau
from .accuracy import ACCURACY

Tree = tuple  # of its subtrees


@functools.cache
def weights_within(tableau: Tableau, points: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    r"""Weights $b_i(\theta)$, a row for each of the `points`; none where order 4 is out of reach."""
    n = tableau.stages
    a = np.zeros((n + 1, n + 1))
    for i, row in enumerate(tableau.a):
        a[i, : len(row)] = row
    a[n, :n] = tableau.b
    by_order = _trees(ACCURACY.inner_order)
    for order in range(ACCURACY.inner_order, 3, -1):
        trees = [tree for k in range(1, order + 1) for tree in by_order[k]]
        conditions = np.array([_weight(tree, a) for tree in trees])
        sizes = np.array([_size(tree) for tree in trees])
        densities = np.array([_density(tree) for tree in trees])
        wanted = np.array(points)[:, None] ** sizes / densities
        used = np.ones(n + 1, bool)
        rows = _weights_that_meet(conditions, wanted, used)
        if rows is None:
            continue
        # Every slope that is not needed is one addition less for each state.
        for i in np.argsort(np.abs(rows).max(0)):
            fewer = used & (np.arange(n + 1) != i)
            found = _weights_that_meet(conditions, wanted, fewer)
            if found is not None:
                rows, used = found, fewer
        return tuple(tuple(map(float, row)) for row in rows)
    return ()


def _weights_that_meet(
    conditions: np.ndarray, wanted: np.ndarray, used: np.ndarray
) -> np.ndarray | None:
    """Weights of the slopes in use that meet the conditions, zero for the others; None if none do."""
    rows = np.zeros((len(wanted), len(used)))
    rows[:, used] = np.linalg.lstsq(conditions[:, used], wanted.T, rcond=1e-12)[0].T
    missed = np.abs(rows @ conditions.T - wanted).max()
    return rows if missed < ACCURACY.slack and np.abs(rows).max() < ACCURACY.inner_weight else None


@functools.cache
def _trees(highest: int) -> dict[int, list[Tree]]:
    """Rooted trees by their number of nodes; each is the tuple of the subtrees at its root."""
    found: dict[int, list[Tree]] = {}

    def forests(nodes: int, largest: int) -> list[Tree]:
        if nodes == 0:
            return [()]
        return [
            (tree, *rest)
            for k in range(min(nodes, largest), 0, -1)
            for tree in found[k]
            for rest in forests(nodes - k, k)
        ]

    for n in range(1, highest + 1):
        found[n] = sorted(
            {tuple(sorted(forest, key=repr)) for forest in forests(n - 1, n - 1)}, key=repr
        )
    return found


def _size(tree: Tree) -> int:
    return 1 + sum(map(_size, tree))


def _density(tree: Tree) -> int:
    return _size(tree) * int(np.prod([_density(part) for part in tree]))


def _weight(tree: Tree, a: np.ndarray) -> np.ndarray:
    """Elementary weight of the tree in each stage."""
    weight = np.ones(len(a))
    for part in tree:
        weight = weight * (a @ _weight(part, a))
    return weight
