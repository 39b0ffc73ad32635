"""Solvers with a planted fault must not pass the check that the right one passes."""

import numpy as np
import pytest

from tests.oracle import resolve
from tests.stickslip.contact._problems import enumerated, optimality_gap, random_problems


def check_solver(solve):
    """Agreement with enumeration and with the optimality conditions, over all kinds of problems."""
    kinds = ("generic", "dependent", "repeated", "zero limits", "tie")
    for problem in random_problems(17, 40, 3, 4, kinds):
        acceleration, friction = (np.asarray(x) for x in solve(*problem))
        np.testing.assert_allclose(acceleration, enumerated(problem), atol=1e-10 * problem.scale)
        assert optimality_gap(problem, acceleration, friction) <= 1e-12


def right(M, F, N, R):
    found = resolve(M, F, N, R)
    return found.acceleration, found.contact_force


def kinetic_instead_of_static(M, F, N, R):
    return right(M, F, N, 0.8 * R)


def one_contact_dropped(M, F, N, R):
    found = resolve(M, F, N, R, active=np.arange(len(R)) != 2)
    return found.acceleration, found.contact_force


def friction_along_the_load(M, F, N, R):
    """The circular definition of the paper, A8: static friction by the sign of the ideal motion."""
    friction = -R * np.sign(N @ np.linalg.solve(M, F))
    return np.linalg.solve(M, F + N.T @ friction), friction


def one_dead_zone_per_contact(M, F, N, R):
    """Each contact takes what it can from what is left, once: right on one axis only."""
    friction = np.zeros(len(R))
    for c, n in enumerate(N):
        inertia = n @ np.linalg.solve(M, n)
        if inertia > 0:
            left = n @ np.linalg.solve(M, F + N.T @ friction) / inertia
            friction[c] = -np.clip(left, -R[c], R[c])
    return np.linalg.solve(M, F + N.T @ friction), friction


def friction_reversed(M, F, N, R):
    acceleration, friction = right(M, F, N, R)
    return acceleration, -friction


def loose(M, F, N, R):
    acceleration, friction = right(M, F, N, R)
    return acceleration * (1 + 1e-9), friction


def test_the_right_solver_passes():
    check_solver(right)


@pytest.mark.parametrize(
    "solve",
    [
        kinetic_instead_of_static,
        one_contact_dropped,
        friction_along_the_load,
        one_dead_zone_per_contact,
        friction_reversed,
        loose,
    ],
)
def test_a_wrong_solver_fails(solve):
    with pytest.raises(AssertionError):
        check_solver(solve)
