"""Random contact problems of every awkward kind, and an answer that shares nothing with the solver.

The reference tries every pattern of sliding senses in NumPy and takes the least objective.
"""

import itertools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np


class Problem(NamedTuple):
    """Arguments of `resolve`; with a leading axis, a batch of problems."""

    mass_matrix: np.ndarray
    force: np.ndarray
    normals: np.ndarray
    limits: np.ndarray

    @property
    def scale(self) -> float:
        """Size of the acceleration without friction."""
        return np.abs(np.linalg.solve(self.mass_matrix, self.force)).max() + 1e-300

    @property
    def energy(self) -> float:
        """Size of the objective without friction."""
        return self.force @ np.linalg.solve(self.mass_matrix, self.force) / 2


def objective(problem: Problem, a: np.ndarray) -> float:
    M, F, N, R = problem
    return 0.5 * a @ M @ a - a @ F + R @ np.abs(N @ a)


def null_space(rows: np.ndarray, size: int) -> np.ndarray:
    if len(rows) == 0:
        return np.eye(size)
    _, s, vt = np.linalg.svd(rows)
    return vt[np.sum(s > 1e-10 * max(1.0, s[0])) :].T


def enumerated(problem: Problem) -> np.ndarray:
    """The acceleration, by trying which contacts rest and all senses of the others."""
    M, F, N, R = problem
    best, answer = np.inf, None
    for resting in itertools.product((True, False), repeat=len(R)):
        rest = np.array(resting)
        basis = null_space(N[rest], len(F))
        senses = np.array(list(itertools.product((-1.0, 1.0), repeat=int(np.sum(~rest)))))
        load = F - (senses * R[~rest]) @ N[~rest]
        a = np.linalg.solve(basis.T @ M @ basis, (load @ basis).T).T @ basis.T
        value = 0.5 * np.sum(a @ M * a, axis=1) - a @ F + np.abs(a @ N.T) @ R
        if value.min() < best:
            best, answer = value.min(), a[value.argmin()]
    return answer


def random_normals(rng, n: int, m: int, kind: str) -> np.ndarray:
    if kind == "dependent":
        # Small integers: many exact linear relations, zero rows among them.
        return rng.integers(-1, 2, size=(m, n)).astype(float)
    normals = rng.normal(size=(m, n))
    if kind == "repeated":
        half = m - m // 2
        normals[half:] = rng.choice([-2.0, 1.0], size=(m // 2, 1)) * normals[: m // 2]
    if kind == "nearly dependent":
        half = m - m // 2
        normals[half:] = normals[: m // 2] + 10.0 ** rng.uniform(-13, -5) * normals[half:]
    return normals


KINDS = ("generic", "dependent", "repeated", "zero limits", "tie", "mixed scales", "nearly dependent")


def random_problem(rng, n: int, m: int, kind: str) -> Problem:
    root = rng.normal(size=(n, n))
    M = root @ root.T + 0.1 * np.eye(n)
    N = random_normals(rng, n, m, kind if kind != "tie" else rng.choice(["generic", "dependent"]))
    R = rng.uniform(0, 1, size=m) * rng.choice([0.03, 0.3, 1.0, 3.0])
    F = rng.normal(size=n)
    if kind == "zero limits":
        R = R * rng.integers(0, 2, size=m)
    if kind == "mixed scales":
        R = R * 10.0 ** rng.integers(-6, 7, size=m)
        scales = 10.0 ** rng.uniform(-1, 1, size=n)
        M = M * scales * scales[:, None]
    if kind == "tie":
        # On the border of the dead zone, or with contacts at their limit while others slide.
        basis = null_space(N[rng.permutation(m) < rng.integers(0, n)], n)
        sense = basis @ rng.normal(size=basis.shape[1])
        pace = N @ sense
        friction = np.where(np.abs(pace) > 1e-9, np.sign(pace), rng.choice([-1, 1], size=m)) * R
        F = M @ sense * rng.integers(0, 2) + N.T @ friction
    return Problem(M, F, N, R)


def random_problems(seed: int, count: int, n: int, m: int, kinds=KINDS) -> list[Problem]:
    rng = np.random.default_rng(seed)
    return [random_problem(rng, n, m, kinds[i % len(kinds)]) for i in range(count)]


def embedded(problem: Problem, n: int, m: int) -> Problem:
    """The same problem with idle velocities and contacts added: one shape, one compilation."""
    M, F, N, R = problem
    size, count = len(F), len(R)
    mass = np.eye(n)
    mass[:size, :size] = M
    normals = np.zeros((m, n))
    normals[:count, :size] = N
    return Problem(mass, np.pad(F, (0, n - size)), normals, np.pad(R, (0, m - count)))


def batch(problems: list[Problem]) -> Problem:
    return Problem(*(jnp.asarray(np.stack(arrays)) for arrays in zip(*problems, strict=True)))


def optimality_gap(problem: Problem, acceleration, contact_force) -> float:
    """Largest violation of the conditions that are necessary and sufficient, over the load.

    Balance `M a = F + N' lambda`; friction within its limit; a sliding contact at its limit, against
    its motion. All in the metric of the mass matrix, in which the load is `|F|`.
    """
    M, F, N, R = problem
    a, friction = np.asarray(acceleration), np.asarray(contact_force)
    weight = np.linalg.inv(np.linalg.cholesky(M))
    load = np.linalg.norm(weight @ F) + 1e-300
    lengths = np.linalg.norm(N @ weight.T, axis=1)
    balance = np.linalg.norm(weight @ (M @ a - F - N.T @ friction))
    excess = np.max((np.abs(friction) - R) * lengths, initial=0.0)
    # At its limit or at rest: the smaller of the two distances must vanish.
    slack = np.minimum(np.abs(friction + R * np.sign(N @ a)) * lengths, np.inf)
    pace = np.abs(N @ a) / np.where(lengths > 0, lengths, 1.0)
    sliding = np.max(np.minimum(slack, pace), initial=0.0)
    return max(balance, excess, sliding) / load
