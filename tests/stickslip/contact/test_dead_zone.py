"""Closed forms in one and two dimensions: the paper's formula, enumeration and the general solver."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.contact import vector_dead_zone
from tests.oracle import dead_zone, dead_zone_gauge, resolve
from tests.stickslip.contact._problems import (
    Problem,
    batch,
    enumerated,
    optimality_gap,
    random_problem,
    random_problems,
)

COREXY = np.array([[1.0, 0], [0, 1], [1, 1], [1, -1]])


def printed_dead_zone(f_e, f_s):
    """Eq. (30) as the paper prints it, `f_s` being the static friction that opposes `f_e`."""
    return 0.0 if abs(f_e) < abs(f_s) else f_e + f_s


def test_one_axis_is_the_printed_formula():
    for force in (-2.0, -1.0, -0.5, 0.0, 0.3, 1.5):
        for limit in (0.0, 0.3, 1.0):
            printed = printed_dead_zone(force, -limit * np.sign(force))
            assert dead_zone(force, limit) == printed


def test_one_axis_is_the_general_solution():
    for force in (-2.0, -1.0, 0.0, 0.4, 1.5):
        found = resolve(np.array([[2.0]]), np.array([force]), np.ones((1, 1)), np.array([1.0]))
        np.testing.assert_allclose(found.acceleration[0], dead_zone(force, 1.0) / 2, rtol=1e-15)


def test_one_axis_broadcasts_and_differentiates():
    forces = jnp.array([-2.0, 0.5, 3.0])
    np.testing.assert_array_equal(dead_zone(forces, 1.0), [-1, 0, 2])
    slopes = jax.vmap(jax.grad(dead_zone, argnums=(0, 1)), in_axes=(0, None))(forces, 1.0)
    np.testing.assert_array_equal(slopes, [[1, 0, 1], [1, 0, -1]])


def check_plane(problem, a, tolerance=1e-12):
    found = resolve(*problem)
    np.testing.assert_allclose(a, found.acceleration, rtol=0, atol=tolerance * problem.scale)
    # The forces of the general solver are admissible for this acceleration, too.
    assert optimality_gap(problem, a, found.contact_force) <= 10 * tolerance


@pytest.mark.more
@pytest.mark.parametrize("m", [1, 2, 3, 4, pytest.param(8, marks=pytest.mark.slow)])
def test_plane_equals_general_solution(m):
    kinds = ("generic", "dependent", "repeated", "zero limits", "tie", "nearly dependent")
    problems = random_problems(m, 120, 2, m, kinds)
    accelerations = np.asarray(jax.jit(jax.vmap(vector_dead_zone))(*batch(problems)))
    for problem, a in zip(problems, accelerations, strict=True):
        check_plane(problem, a)


def test_plane_equals_enumeration_for_corexy_directions():
    rng = np.random.default_rng(0)
    regimes = set()
    problems = []
    for _ in range(300):
        M, _, _, R = random_problem(rng, 2, 4, "generic")
        problems.append(Problem(M, 2 * rng.normal(size=2), COREXY, R + 0.01))
    accelerations = np.asarray(jax.jit(jax.vmap(vector_dead_zone))(*batch(problems)))
    for problem, a in zip(problems, accelerations, strict=True):
        np.testing.assert_allclose(a, enumerated(problem), atol=1e-10 * problem.scale)
        regimes.add(tuple(np.sign(np.round(COREXY @ a, 9)).astype(int)))
    # Rest, the rays of four lines, and the eight of sixteen sign patterns that are possible.
    assert len(regimes) == 1 + 2 * 4 + 2 * 4


@pytest.mark.more
def test_plane_borders_of_regimes():
    """Loads on every border, exactly and one rounding off: continuous to rounding."""
    M = np.array([[2.0, 0.8], [0.8, 1.5]])
    R = np.array([0.5, 0.7, 0.3, 0.4])
    accelerate = jax.jit(lambda F: vector_dead_zone(M, F, COREXY, R))
    general = jax.jit(lambda F: resolve(M, F, COREXY, R).acceleration)
    for angle in np.arange(16) * np.pi / 8:
        a = np.array([np.cos(angle), np.sin(angle)])
        for line in COREXY:
            for share in (-1.0, -0.3, 0.0, 1.0):
                senses = np.sign(np.round(COREXY @ a, 12))
                senses = np.where(senses == 0, share, senses)
                for size in (0.0, 1e-12, 1.0):
                    F = M @ (size * a) + COREXY.T @ (senses * R)
                    for nudge in (0.0, 1e-15, -1e-15):
                        load = F + nudge * line
                        np.testing.assert_allclose(accelerate(load), size * a, atol=1e-14)
                        np.testing.assert_allclose(general(load), size * a, atol=1e-14)


def test_plane_rests_exactly_in_the_dead_zone():
    rng = np.random.default_rng(2)
    for _ in range(50):
        M, F, _, R = random_problem(rng, 2, 4, "generic")
        gauge = dead_zone_gauge(F, COREXY, R)
        np.testing.assert_array_equal(vector_dead_zone(M, 0.999 * F / gauge, COREXY, R), 0)
        assert np.any(vector_dead_zone(M, 1.001 * F / gauge, COREXY, R) != 0)


def test_plane_mask_and_no_contact():
    M, F, N, R = random_problem(np.random.default_rng(3), 2, 4, "generic")
    active = np.array([True, False, True, False])
    np.testing.assert_allclose(
        vector_dead_zone(M, F, N, R, active=active),
        vector_dead_zone(M, F, N[active], R[active]),
        rtol=1e-13,
    )
    free = np.linalg.solve(M, F)
    np.testing.assert_allclose(vector_dead_zone(M, F, N, np.zeros(4)), free, rtol=1e-13)
    np.testing.assert_allclose(vector_dead_zone(M, F, np.zeros((2, 2)), np.ones(2)), free, rtol=1e-13)


def test_traced_nan_is_not_taken_for_rest():
    bad = jax.jit(vector_dead_zone)(jnp.eye(2), jnp.array([jnp.nan, 0.0]), COREXY, jnp.ones(4))
    assert np.all(np.isnan(bad))
