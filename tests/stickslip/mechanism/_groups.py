"""Random instants of a group of contacts, and the law of all by trying every pattern in NumPy."""

import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from stickslip.mechanism._dependent import DependentContacts, motion_in_rows
from stickslip.mechanism._group import AbstractContactGroup
from stickslip.mechanism._kinds import group_of
from stickslip.mechanism._laws import Bounds
from stickslip.mechanism._local import Part
from stickslip.mechanism._motion import Motion
from stickslip.mechanism._scalars import Mass
from stickslip.mechanism._search import Problem

STRUCTURES = {
    "one contact of two velocities": [[1.0, -1.0]],
    "chain, absolute": np.eye(3),
    "chain, relative": np.tril(np.ones((3, 3))),
    "general": [[1.0, 0.3, -2.0], [0.0, 1.0, 0.5], [-1.0, 1.0, 1.5]],
    "fewer contacts than velocities": [[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]],
    "between two belts": [[1.0], [1.0]],
    "carriage": [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]],
    "carriage on four skew rails": [[1.0, 0.0], [0.6, 0.8], [-0.8, 0.6], [0.3, 1.0]],
    "opposite senses": [[1.0, 0.0], [-2.0, 0.0], [1.0, 1.0]],
    "five in space": [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 1, 1]],
    "dependent, of fewer than all velocities": [[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
}
DEPENDENT = [name for name, J in STRUCTURES.items() if np.linalg.matrix_rank(J) < len(J)]
# Those of one velocity are a kind of their own, without tables of what holds what.
OF_SEVERAL_VELOCITIES = [name for name in DEPENDENT if len(STRUCTURES[name][0]) > 1]


class Instants(NamedTuple):
    """Numbers of a `Problem`, one instant a row."""

    M: np.ndarray
    F: np.ndarray
    gamma: np.ndarray
    low: np.ndarray
    high: np.ndarray


def group(J, inertia=None, stops: int = 0) -> AbstractContactGroup:
    """The group of contacts with these directions."""
    J = np.array(J, float)
    found = group_of(Part(tuple(range(J.shape[1])), tuple(range(len(J))), J, inertia, stops))
    assert found is not None
    return found


def named(name: str) -> AbstractContactGroup:
    return group(STRUCTURES[name])


def instants(name: str, count: int, seed: int = 0) -> Instants:
    """Loads below, above and on the limits; some limits zero or asymmetric, masses of mixed scales."""
    J = np.array(STRUCTURES[name], float)
    (m, n), rng = J.shape, np.random.default_rng([seed, len(name)])
    M = np.empty((count, n, n))
    for i in range(count):
        root = rng.normal(size=(n, n))
        # Skew directions as coordinates cost digits where masses differ, by their ratio.
        wide = 3.0 if name in DEPENDENT or (J == np.eye(n)[:m]).all() else 1.0
        scales = 10.0 ** rng.uniform(-wide, wide, n) if i % 3 == 0 else np.ones(n)
        M[i] = (root @ root.T + 0.1 * np.eye(n)) * np.outer(scales, scales)
        M[i] *= 10.0 ** rng.uniform(-6, 6) if i % 2 else 1.0
    size = rng.choice([0.03, 0.3, 1.0, 3.0], (count, 1))
    low, high = -size * rng.uniform(0, 1, (count, m)), size * rng.uniform(0, 1, (count, m))
    odd = rng.random(count) < 0.5
    low[odd] = -high[odd]
    none = (rng.random((count, m)) < 0.3) & (rng.random((count, 1)) < 0.3)
    low, high = np.where(none, 0.0, low), np.where(none, 0.0, high)
    F = rng.normal(size=(count, n))
    for i in np.flatnonzero(rng.random(count) < 0.2):
        # At the limit of some contacts, to the last digits.
        F[i] = -J.T @ np.where(rng.random(m) < 0.5, low[i], high[i])
    gamma = np.zeros((count, m))
    if name not in DEPENDENT:
        gamma = rng.normal(size=(count, m)) * rng.choice([0.0, 1.0, 1e3], (count, 1))
    return Instants(M, F, gamma, low, high)


def states_by_law(
    of: AbstractContactGroup, mass, force, gamma, static: Bounds, kinetic: Bounds, lines=None
):
    """States of contacts at rest under these forces by the law of all, and whether it has an answer."""
    rest, no = of.row([jnp.zeros(())] * of.m), of.row([jnp.zeros((), bool)] * of.m)
    lines = of.directions.tolist() if lines is None else lines
    motion = in_rows(of) if isinstance(of, DependentContacts) else of.motion
    limits = gamma, static, kinetic, motion, rest, no, jnp.ones((), bool)
    states, ended = of.law(Problem(mass, of.row(force), lines, *limits))
    return list(states), ended


def in_rows(of: AbstractContactGroup):
    """Motion of dependent contacts as a machine without a closed form has it."""
    return lambda M, F, J, rest, gamma: Motion(*motion_in_rows(of, M, F, rest), None)


def found(of: AbstractContactGroup, given: Instants, static: float = 1.0) -> tuple[np.ndarray, ...]:
    """States, accelerations, and whether the search ended; `static` limits are so much larger."""
    J = of.directions.tolist()

    def one(M, F, gamma, low, high):
        mass = Mass(full=[list(row) for row in M])
        kinetic = Bounds(of.row(list(low)), of.row(list(high)))
        limits = Bounds(of.row(list(static * low)), of.row(list(static * high)))
        states, ended = states_by_law(of, mass, list(F), list(gamma), limits, kinetic)
        friction = [jnp.where(s > 0, lo, jnp.where(s < 0, hi, 0.0))
                    for s, lo, hi in zip(states, low, high, strict=True)]  # fmt: skip
        load = tuple(f + sum(J[c][j] * friction[c] for c in range(of.m)) for j, f in enumerate(F))
        motion = of.motion(mass, load, J, tuple(s == 0.0 for s in states), list(gamma))
        return jnp.stack(states), jnp.stack(list(motion.acceleration)), ended

    return tuple(np.asarray(x) for x in jax.jit(jax.vmap(one))(*map(jnp.asarray, given)))


def null_space(rows: np.ndarray, n: int) -> np.ndarray:
    if not len(rows):
        return np.eye(n)
    _, s, vt = np.linalg.svd(rows)
    return vt[np.sum(s > 1e-10 * s[0]) :].T


def gauss(J: np.ndarray, given: Instants, a: np.ndarray) -> np.ndarray:
    """The function whose minimum the acceleration is."""
    speeds = a @ J.T - given.gamma
    friction = np.maximum(-given.low * speeds, -given.high * speeds).sum(-1)
    return 0.5 * np.einsum("bi,bij,bj->b", a, given.M, a) - np.sum(a * given.F, -1) + friction


def enumerated(J: np.ndarray, given: Instants) -> np.ndarray:
    """Accelerations: of all patterns of rest and senses the one with the least of Gauss' function."""
    m, n = J.shape
    best, answer = np.full(len(given.F), np.inf), np.zeros_like(given.F)
    for pattern in itertools.product((-1, 0, 1), repeat=m):
        s = np.array(pattern)
        rest = J[s == 0]
        Z = null_space(rest, n)
        a = given.gamma[:, s == 0] @ np.linalg.pinv(rest).T if len(rest) else np.zeros_like(given.F)
        if Z.shape[1]:
            friction = np.where(s > 0, given.low, np.where(s < 0, given.high, 0.0))
            load = given.F + friction @ J - np.einsum("bij,bj->bi", given.M, a)
            inner = np.einsum("ik,bij,jl->bkl", Z, given.M, Z)
            a = a + np.linalg.solve(inner, (load @ Z)[..., None])[..., 0] @ Z.T
        value = gauss(J, given, a)
        better = value < best
        best, answer = np.where(better, value, best), np.where(better[:, None], a, answer)
    return answer


def distance(given: Instants, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two accelerations, in the metric of the mass, beside the size of the loads in it."""
    d = a - b
    friction = np.maximum(-given.low, given.high).sum(-1)
    inverse = np.linalg.inv(given.M)
    loads = np.sqrt(np.einsum("bi,bij,bj->b", given.F, inverse, given.F))
    slip = np.sqrt(np.einsum("bi,bij,bj->b", a, given.M, a))
    most = loads + slip + friction * np.sqrt(np.abs(inverse).max((1, 2))) + 1e-300
    return np.sqrt(np.einsum("bi,bij,bj->b", d, given.M, d)) / most
