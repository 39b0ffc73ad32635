"""`resolve` against enumeration, against the optimality conditions, and against SciPy."""

import doctest

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

import stickslip.contact
import tests.oracle._resolve
from tests.oracle import resolve
from tests.stickslip.contact._problems import (
    Problem,
    batch,
    embedded,
    enumerated,
    objective,
    optimality_gap,
    random_problem,
    random_problems,
)

LARGEST = (6, 8)


def solve_all(problems):
    """One result per problem; all of one shape."""
    found = jax.jit(jax.vmap(lambda *p: resolve(*p)))(*batch(problems))
    return [jax.tree.map(lambda x, i=i: np.asarray(x)[i], found) for i in range(len(problems))]


def check_resolution(problem, found, reference=None, tolerance=1e-12):
    assert found.converged
    assert found.residual <= tolerance
    assert optimality_gap(problem, found.acceleration, found.contact_force) <= tolerance
    if reference is not None:
        # The reference picks by the objective, whose rounding hides differences of its square root.
        np.testing.assert_allclose(found.acceleration, reference, rtol=0, atol=1e-10 * problem.scale)
    relative = problem.normals @ found.acceleration
    moving = found.contact_state != 0
    np.testing.assert_array_equal(found.contact_state[moving], np.sign(relative[moving]))
    np.testing.assert_array_equal(found.contact_acceleration[~moving], 0)
    lengths = np.abs(problem.normals).sum(axis=1)
    assert np.all(np.abs(relative[~moving]) <= 1e-11 * problem.scale * lengths[~moving])


@pytest.mark.more
@pytest.mark.parametrize("m", range(1, 9))
def test_equals_enumeration_for_every_size(m):
    """Sizes from 1 to 6 in one shape, the rest idle: also a test of zero normals."""
    rng = np.random.default_rng(m)
    kinds = ["generic", "dependent", "repeated", "zero limits", "tie"]
    problems = [random_problem(rng, n, m, kind) for n in range(1, 7) for kind in kinds]
    whole = [embedded(problem, *LARGEST) for problem in problems]
    for problem, larger, found in zip(problems, whole, solve_all(whole), strict=True):
        reference = np.pad(enumerated(problem), (0, LARGEST[0] - len(problem.force)))
        check_resolution(larger, found, reference)
        np.testing.assert_array_equal(found.contact_state[m:], 0)


@pytest.mark.more
@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 4), (2, 4), (3, 2), (4, 5)])
def test_equals_enumeration(n, m):
    problems = random_problems(100 * n + m, 105, n, m)
    for problem, result in zip(problems, solve_all(problems), strict=True):
        # Enumeration has to decide on rank; the optimality conditions do not.
        check_resolution(problem, result)
        a = enumerated(problem)
        terms = problem.energy + problem.limits @ np.abs(problem.normals) @ np.abs(a)
        assert objective(problem, result.acceleration) <= objective(problem, a) + 1e-12 * terms


@pytest.mark.more
@pytest.mark.parametrize(("n", "m"), [(2, 4), (4, 8), LARGEST])
def test_optimality_conditions_of_thousands(n, m):
    problems = random_problems(n, 2100, n, m)
    results = solve_all(problems)
    for problem, result in zip(problems, results, strict=True):
        check_resolution(problem, result)
    assert max(result.num_steps for result in results) < 64


def test_equals_bounded_least_squares_of_scipy():
    for problem in random_problems(7, 12, 4, 8, kinds=("generic", "repeated")):
        M, F, N, R = problem
        weight = np.linalg.inv(np.linalg.cholesky(M))
        friction = scipy.optimize.lsq_linear(
            (N @ weight.T).T, -weight @ F, bounds=(-R - 1e-300, R), method="bvls", tol=1e-15
        ).x
        a = np.linalg.solve(M, F + N.T @ friction)
        np.testing.assert_allclose(resolve(*problem).acceleration, a, atol=1e-9 * problem.scale)


def test_start_of_motion_of_a_body_on_two_rails():
    """By hand: the second rail slides forward with 4 - 1 - 1 over unit mass, the first holds."""
    found = resolve(
        np.eye(2), np.array([0.5, 4.0]), np.array([[1.0, 0], [0, 1], [1, 1]]), np.array([2.0, 1, 1])
    )
    np.testing.assert_allclose(found.acceleration, [0, 2], atol=1e-15)
    np.testing.assert_array_equal(found.contact_state, [0, 1, 1])
    np.testing.assert_allclose(found.contact_force, [0.5, -1, -1], atol=1e-15)
    backward = resolve(
        np.eye(2), -np.array([0.5, 4.0]), np.array([[1.0, 0], [0, 1], [1, 1]]), np.array([2.0, 1, 1])
    )
    np.testing.assert_array_equal(backward.contact_state, [0, -1, -1])


def test_everything_holds_exactly():
    problem = Problem(
        np.array([[2.0, 0.7], [0.7, 1.0]]),
        np.array([0.3, -0.2]),
        np.array([[1.0, 0], [0, 1], [1, 1], [1, -1]]),
        np.ones(4),
    )
    found = resolve(*problem)
    np.testing.assert_array_equal(found.acceleration, 0)
    np.testing.assert_array_equal(found.contact_state, 0)
    assert not found.on_kink
    unloaded = resolve(problem.mass_matrix, np.zeros(2), problem.normals, problem.limits)
    np.testing.assert_array_equal(unloaded.acceleration, 0)
    assert unloaded.converged


def test_forces_of_dependent_contacts_are_extreme():
    """Two equal contacts share a load of 1.5: one is at its limit, the other takes the rest."""
    found = resolve(np.eye(1), np.array([1.5]), np.ones((2, 1)), np.ones(2))
    np.testing.assert_allclose(np.sort(found.contact_force), [-1, -0.5], atol=1e-15)
    np.testing.assert_array_equal(found.contact_state, 0)


def test_inactive_contacts_contribute_nothing():
    for problem in random_problems(3, 20, 4, 8):
        active = np.random.default_rng(0).integers(0, 2, size=8).astype(bool)
        found = resolve(*problem, active=active)
        M, F, N, R = problem
        without = enumerated(Problem(M, F, N[active], R[active]))
        np.testing.assert_allclose(found.acceleration, without, atol=1e-10 * problem.scale)
        np.testing.assert_array_equal(found.contact_state[~active], 0)
        np.testing.assert_array_equal(found.contact_force[~active], 0)


def test_no_contact_slides_freely():
    M, F, N, _ = random_problems(11, 1, 3, 2)[0]
    found = resolve(M, F, N, np.zeros(2))
    np.testing.assert_allclose(found.acceleration, np.linalg.solve(M, F), rtol=1e-13)
    np.testing.assert_array_equal(found.contact_state, np.sign(N @ np.linalg.solve(M, F)))


def test_kink_is_flagged_where_a_contact_is_about_to_slide():
    at_limit = resolve(np.eye(1), np.array([1.0]), np.ones((1, 1)), np.ones(1))
    assert at_limit.on_kink
    np.testing.assert_array_equal(at_limit.acceleration, 0)
    for force in (0.0, 0.9, 1.1):
        assert not resolve(np.eye(1), np.array([force]), np.ones((1, 1)), np.ones(1)).on_kink
    # One of two equal contacts is at its limit, but both together are not.
    assert not resolve(np.eye(1), np.array([1.5]), np.ones((2, 1)), np.ones(2)).on_kink
    assert resolve(np.eye(1), np.array([2.0]), np.ones((2, 1)), np.ones(2)).on_kink


def test_ill_conditioned_mass():
    rng = np.random.default_rng(5)
    for _ in range(20):
        root = np.linalg.qr(rng.normal(size=(4, 4)))[0]
        M = root * np.logspace(-4, 4, 4) @ root.T
        M = (M + M.T) / 2
        _, F, N, R = random_problem(rng, 4, 8, "dependent")
        found = resolve(M, F, N, R)
        assert found.converged
        assert found.residual <= 1e-12


@pytest.mark.parametrize("module", [stickslip.contact, tests.oracle._resolve])
def test_examples_of_the_docstrings(module):
    failed, tried = doctest.testmod(module)
    assert (failed, tried > 0) == (0, True)


@pytest.mark.more
def test_batches_of_any_shape_give_the_same():
    """Lanes come in chunks, the last one padded: sizes around that, nested and shared arguments."""
    problems = batch(random_problems(21, 130, 2, 4))
    one = jax.jit(resolve)
    alone = [one(*(x[i] for x in problems)) for i in range(130)]
    states = np.stack([r.contact_state for r in alone])
    accelerations = np.stack([r.acceleration for r in alone])
    for lanes in (1, 64, 65, 130):
        found = jax.jit(jax.vmap(resolve))(*(x[:lanes] for x in problems))
        np.testing.assert_allclose(found.acceleration, accelerations[:lanes], rtol=0, atol=1e-13)
        np.testing.assert_array_equal(found.contact_state, states[:lanes])
    nested = jax.vmap(jax.vmap(resolve))(*(x.reshape(13, 10, *x.shape[1:]) for x in problems))
    np.testing.assert_allclose(nested.acceleration.reshape(130, 2), accelerations, rtol=0, atol=1e-13)
    M, _, N, R = (x[0] for x in problems)
    shared = jax.vmap(resolve, in_axes=(None, 0, None, None))(M, problems.force, N, R)
    for i in range(0, 130, 13):
        np.testing.assert_allclose(
            shared.acceleration[i], one(M, problems.force[i], N, R).acceleration, atol=1e-13
        )


def test_traces_once(monkeypatch):
    traced = []
    original = tests.oracle._resolve.solver

    def counting(max_steps):
        traced.append(max_steps)
        return original(max_steps)

    monkeypatch.setattr(tests.oracle._resolve, "solver", counting)
    for problem in random_problems(31, 5, 5, 2):
        resolve(*problem)
        resolve(*map(jnp.asarray, problem), active=np.array([True, False]))
    assert len(traced) == 1
