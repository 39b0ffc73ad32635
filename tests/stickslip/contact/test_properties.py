"""Laws of the problem that hold for every solution, on problems with many ties."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.oracle import resolve
from tests.stickslip.contact._problems import Problem, batch, random_problem, random_problems

N_VELOCITIES, N_CONTACTS = 3, 5
SOLVE = jax.jit(resolve)

eighths = st.integers(-16, 16).map(lambda i: i / 8)


def arrays(element, *shape):
    size = int(np.prod(shape))
    return st.lists(element, min_size=size, max_size=size).map(
        lambda values: np.array(values, dtype=float).reshape(shape)
    )


@st.composite
def problems(draw):
    """Small exact numbers: zero, repeated and dependent normals, loads on borders of regimes."""
    root = draw(arrays(eighths, N_VELOCITIES, N_VELOCITIES))
    return Problem(
        root @ root.T + 0.5 * np.eye(N_VELOCITIES),
        draw(arrays(eighths, N_VELOCITIES)),
        draw(arrays(st.integers(-1, 1), N_CONTACTS, N_VELOCITIES)),
        draw(arrays(st.integers(0, 8).map(lambda i: i / 4), N_CONTACTS)),
    )


def weight(problem):
    """Norm of a force in the metric of the inverse mass matrix."""
    return lambda force: np.sqrt(force @ np.linalg.solve(problem.mass_matrix, force))


@pytest.mark.more
@given(problems())
def test_power_is_balanced(problem):
    """What the load supplies beyond friction accelerates: `a'Ma - a'F + sum R |n . a| = 0`."""
    M, F, N, R = problem
    a = np.asarray(SOLVE(*problem).acceleration)
    supplied, dissipated = a @ F, R @ np.abs(N @ a)
    assert abs(a @ M @ a - supplied + dissipated) <= 1e-13 * (1 + 2 * problem.energy)


@pytest.mark.more
@given(problems())
def test_friction_opposes_motion_within_its_limit(problem):
    found = SOLVE(*problem)
    friction, state = np.asarray(found.contact_force), np.asarray(found.contact_state)
    assert found.converged
    assert np.all(np.abs(friction) <= problem.limits * (1 + 1e-14))
    assert np.all(friction * np.asarray(found.contact_acceleration) <= 0)
    np.testing.assert_array_equal(friction[state != 0], -(state * problem.limits)[state != 0])
    balance = problem.mass_matrix @ found.acceleration - problem.force - problem.normals.T @ friction
    assert np.abs(balance).max() <= 1e-12 * (1 + np.abs(problem.force).max())


@pytest.mark.more
@given(problems(), arrays(eighths, N_VELOCITIES))
def test_motion_changes_no_more_than_the_load(problem, change):
    """Nonexpansive, hence continuous over all changes of regime; and monotone."""
    other = problem._replace(force=problem.force + change / 64)
    moved = np.asarray(SOLVE(*other).acceleration) - np.asarray(SOLVE(*problem).acceleration)
    norm = weight(problem)
    assert norm(problem.mass_matrix @ moved) <= norm(change / 64) + 1e-13 * (1 + norm(problem.force))
    power = moved @ change / 64
    assert power >= moved @ problem.mass_matrix @ moved - 1e-12 * (1 + problem.energy)


@given(problems(), arrays(st.integers(0, 8).map(lambda i: i / 8), N_CONTACTS))
def test_more_friction_moves_less(problem, more):
    norm = weight(problem)
    less = problem.mass_matrix @ SOLVE(*problem).acceleration
    stiffer = problem._replace(limits=problem.limits + more)
    after = problem.mass_matrix @ SOLVE(*stiffer).acceleration
    assert norm(after) <= norm(less) + 1e-12 * (1 + norm(problem.force))


@given(problems(), st.sampled_from([1e-12, 0.3, 7.0, 1e9]))
def test_scales_of_force_mass_and_normals(problem, factor):
    M, F, N, R = problem
    a = np.asarray(SOLVE(*problem).acceleration)
    size = 1e-12 * problem.scale
    np.testing.assert_allclose(
        SOLVE(M, factor * F, N, factor * R).acceleration, factor * a, atol=factor * size
    )
    np.testing.assert_allclose(SOLVE(factor * M, factor * F, N, factor * R).acceleration, a, atol=size)
    np.testing.assert_allclose(SOLVE(M, F, -factor * N, R / factor).acceleration, a, atol=size)


def test_other_coordinates_and_order():
    rng = np.random.default_rng(1)
    for problem in random_problems(1, 40, N_VELOCITIES, N_CONTACTS):
        M, F, N, R = problem
        found = SOLVE(*problem)
        T = rng.normal(size=(N_VELOCITIES, N_VELOCITIES)) + 3 * np.eye(N_VELOCITIES)
        mass = T.T @ M @ T
        other = SOLVE((mass + mass.T) / 2, T.T @ F, N @ T, R)
        np.testing.assert_allclose(
            T @ other.acceleration, found.acceleration, atol=1e-10 * problem.scale
        )
        order = rng.permutation(N_CONTACTS)
        shuffled = SOLVE(M, F, N[order], R[order])
        np.testing.assert_allclose(
            shuffled.acceleration, found.acceleration, atol=1e-12 * problem.scale
        )


def test_contacts_along_one_normal_add_their_limits():
    rng = np.random.default_rng(2)
    for _ in range(20):
        M, F, N, R = random_problem(rng, 3, 5, "generic")
        split = SOLVE(
            M, F, N[[0, 0, 1, 2, 2]], np.array([0.25, 0.75, 1, 0.5, 0.5]) * R[[0, 0, 1, 2, 2]]
        )
        whole = SOLVE(M, F, N, R * [1, 1, 1, 0, 0])
        np.testing.assert_allclose(split.acceleration, whole.acceleration, atol=1e-13)


def test_acceleration_is_continuous_along_a_path_through_many_regimes():
    M, _, N, R = random_problem(np.random.default_rng(3), N_VELOCITIES, N_CONTACTS, "dependent")
    times = np.linspace(0, 2 * np.pi, 2001)
    forces = 4 * np.stack([np.sin(times), np.cos(2 * times), np.sin(3 * times + 1)], axis=1)
    path = jax.jit(jax.vmap(lambda F: resolve(M, F, N, R)))(jnp.asarray(forces))
    factor = np.linalg.cholesky(M)
    moved = np.linalg.norm(np.diff(path.acceleration, axis=0) @ factor, axis=1)
    loaded = np.linalg.norm(np.linalg.solve(factor, np.diff(forces, axis=0).T), axis=0)
    assert np.all(moved <= loaded * (1 + 1e-10))
    assert len(np.unique(path.contact_state, axis=0)) > 8


def test_batch_helper_keeps_the_arguments():
    several = random_problems(5, 3, 2, 3)
    for i, problem in enumerate(several):
        for array, stacked in zip(problem, batch(several), strict=True):
            np.testing.assert_array_equal(array, stacked[i])
