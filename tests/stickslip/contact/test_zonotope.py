"""The dead zone as a set of forces: corners, gauge and membership against geometry and LP."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
import scipy.spatial

from stickslip.contact import zonotope_vertices
from tests.oracle import dead_zone_gauge, hold, in_dead_zone, resolve
from tests.stickslip.contact._problems import KINDS, random_problem, random_problems

COREXY = np.array([[1.0, 0], [0, 1], [1, 1], [1, -1]])


def gauge_by_linear_programming(F, N, R):
    """Least `t` with `N' lambda = F`, `|lambda_c| <= t R_c`; infinite where there is none."""
    m = len(R)
    found = scipy.optimize.linprog(
        np.append(np.zeros(m), 1.0),
        A_eq=np.column_stack([N.T, np.zeros(len(F))]),
        b_eq=F,
        A_ub=np.vstack([np.column_stack([s * np.eye(m), -R]) for s in (1, -1)]),
        b_ub=np.zeros(2 * m),
        bounds=[(None, None)] * m + [(0, None)],
    )
    return found.fun if found.status == 0 else np.inf


@pytest.mark.parametrize(("n", "m"), [(1, 3), (2, 4), (3, 2), (3, 6), (4, 8)])
def test_gauge_equals_linear_programming(n, m):
    kinds = ("generic", "repeated", "zero limits", "dependent")
    for problem in random_problems(10 * n + m, 24, n, m, kinds):
        _, F, N, R = problem
        expected = gauge_by_linear_programming(F, N, R)
        np.testing.assert_allclose(dead_zone_gauge(F, N, R), expected, rtol=1e-9)
        # Inside the span of the contacts, where the set may be flat.
        inside = N.T @ np.random.default_rng(m).normal(size=m)
        expected = gauge_by_linear_programming(inside, N[R > 0], R[R > 0])
        if np.any(R > 0) and np.isfinite(expected):
            np.testing.assert_allclose(dead_zone_gauge(inside, N, R), expected, rtol=1e-9)


def test_gauge_is_homogeneous_and_one_on_the_border():
    rng = np.random.default_rng(1)
    for _ in range(20):
        _, F, N, R = random_problem(rng, 3, 5, "generic")
        gauge = dead_zone_gauge(F, N, R)
        np.testing.assert_allclose(dead_zone_gauge(-3 * F, N, R), 3 * gauge, rtol=1e-12)
        np.testing.assert_allclose(dead_zone_gauge(F / gauge, N, R), 1, rtol=1e-12)
        np.testing.assert_allclose(dead_zone_gauge(F, N, 2 * R), gauge / 2, rtol=1e-12)


def test_gauge_of_no_force_and_of_no_friction():
    assert dead_zone_gauge(np.zeros(2), COREXY, np.ones(4)) == 0
    assert dead_zone_gauge(np.zeros(2), COREXY, np.zeros(4)) == 0
    assert np.isinf(dead_zone_gauge(np.ones(2), COREXY, np.zeros(4)))
    assert np.isinf(dead_zone_gauge(np.ones(2), COREXY[:1], np.ones(1)))
    slope = jax.grad(dead_zone_gauge)(jnp.zeros(2), jnp.asarray(COREXY), jnp.ones(4))
    np.testing.assert_array_equal(slope, 0)


@pytest.mark.parametrize("kind", KINDS[:4])
def test_rest_is_membership(kind):
    rng = np.random.default_rng(4)
    answers = set()
    for _ in range(40):
        problem = random_problem(rng, 3, 5, kind)
        rests = bool(np.all(resolve(*problem).acceleration == 0))
        assert bool(in_dead_zone(problem.force, problem.normals, problem.limits)) == rests
        answers.add(rests)
    assert answers == {True, False} or kind == "zero limits"


def test_membership_includes_the_border():
    R = np.array([0.5, 0.7, 0.3, 0.4])
    for corner in zonotope_vertices(COREXY, R):
        assert in_dead_zone(corner, COREXY, R)
        assert not in_dead_zone(corner * (1 + 1e-12), COREXY, R)
    active = np.array([True, True, False, False])
    assert in_dead_zone(np.array([0.5, 0.7]), COREXY, R, active=active)
    assert not in_dead_zone(np.array([0.5, 0.71]), COREXY, R, active=active)


def test_vertices_of_corexy():
    corners = np.asarray(zonotope_vertices(COREXY, np.ones(4)))
    expected = [[-1, -3], [1, -3], [3, -1], [3, 1], [1, 3], [-1, 3], [-3, 1], [-3, -1]]
    np.testing.assert_allclose(corners, expected)


@pytest.mark.parametrize("m", [2, 3, 4, 7])
def test_vertices_are_the_hull_in_order(m):
    rng = np.random.default_rng(m)
    for _ in range(10):
        N, R = rng.normal(size=(m, 2)), rng.uniform(0.1, 1, size=m)
        corners = np.asarray(zonotope_vertices(N, R))
        signs = np.array(np.meshgrid(*[[-1, 1]] * m)).reshape(m, -1).T
        hull = scipy.spatial.ConvexHull((signs * R) @ N)
        assert corners.shape == (2 * m, 2)
        distance = np.linalg.norm(corners[:, None] - hull.points[hull.vertices], axis=2)
        assert distance.min(axis=1).max() < 1e-12
        assert distance.min(axis=0).max() < 1e-12
        edges = np.roll(corners, -1, axis=0) - corners
        following = np.roll(edges, -1, axis=0)
        assert np.all(edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > 0)
        for corner in corners:
            np.testing.assert_allclose(dead_zone_gauge(corner, N, R), 1, rtol=1e-11)


def test_vertices_of_parallel_and_idle_contacts():
    corners = np.asarray(zonotope_vertices(np.array([[1.0, 0], [-2, 0], [0, 1]]), np.array([1, 1, 0])))
    assert np.all(corners[:, 1] == 0)
    assert (corners[:, 0].min(), corners[:, 0].max()) == (-3, 3)


def test_gauge_of_the_constraint_force_ends_a_regime():
    """While the held contacts can hold, `hold` is the motion; beyond, `resolve` moves one of them."""
    N = np.array([[1.0, 0], [0, 1], [1, 1]])
    M = np.array([[2.0, 0.5], [0.5, 1.0]])
    R = np.array([1.0, 0.5, 0.25])
    seen = set()
    for pull in np.linspace(0, 3, 31):
        F = np.array([pull, 3.0])
        found = resolve(M, F, N, R)
        sliding = np.where(found.contact_state != 0, found.contact_force, 0)
        held = np.array([True, False, False])
        sensed = F - R * [0, 1, 1] @ N
        motion = hold(M, sensed, N, held)
        gauge = dead_zone_gauge(motion.constraint_force, N, R, active=held)
        forward = bool(np.all(N[1:] @ motion.acceleration > 0))
        if gauge < 1 and forward:
            np.testing.assert_allclose(motion.acceleration, found.acceleration, atol=1e-14)
            np.testing.assert_allclose(motion.contact_force[0], found.contact_force[0], atol=1e-14)
            np.testing.assert_allclose(sliding[1:], -R[1:], atol=1e-14)
        else:
            assert np.any(np.abs(motion.acceleration - found.acceleration) > 1e-6)
        seen.add(bool(gauge < 1))
    assert seen == {True, False}
