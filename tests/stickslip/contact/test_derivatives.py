"""Derivatives of `resolve` and of the closed forms: forward = reverse = central differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.contact import vector_dead_zone
from tests.oracle import dead_zone_gauge, hold, resolve
from tests.stickslip.contact._problems import random_problem, random_problems

STEP = 1e-6
SOLVE = jax.jit(resolve)


def central(function, point, argument):
    """Central differences of a function of several arrays by one of them."""
    point = [np.asarray(x) for x in point]
    base = point[argument]
    columns = []
    for index in np.ndindex(base.shape):
        ends = []
        for sign in (1, -1):
            moved = base.copy()
            moved[index] += sign * STEP
            ends.append(np.asarray(function(*point[:argument], moved, *point[argument + 1 :])))
        columns.append((ends[0] - ends[1]) / (2 * STEP))
    return np.stack(columns, axis=-1).reshape(*columns[0].shape, *base.shape)


def well_inside_its_regime(problem) -> bool:
    """Whether every state survives small changes of the load and of the limits."""
    rng = np.random.default_rng(0)
    state = np.asarray(SOLVE(*problem).contact_state)
    for _ in range(12):
        moved = problem._replace(
            force=problem.force + 1e-4 * rng.normal(size=problem.force.shape),
            limits=problem.limits * (1 + 1e-4 * rng.normal(size=problem.limits.shape)),
        )
        if np.any(np.asarray(SOLVE(*moved).contact_state) != state):
            return False
    return True


def regular_problems(seed, count, n, m, kinds):
    """Problems away from kinks, those with resting and sliding contacts first."""
    problems = [p for p in random_problems(seed, 60, n, m, kinds) if well_inside_its_regime(p)]

    def resting(problem):
        return np.mean(np.asarray(SOLVE(*problem).contact_state) == 0)

    assert len(problems) >= count
    return sorted(problems, key=lambda problem: resting(problem) in (0, 1))[:count]


def symmetrised(problem_function):
    """Differences of single elements of `M` would break its symmetry, which is refused."""
    return lambda M, *rest: problem_function((M + M.T) / 2, *rest)


def outputs(M, F, N, R):
    found = resolve(M, F, N, R)
    return jnp.concatenate([found.acceleration, found.contact_acceleration, found.contact_force])


def both_modes(function, arguments):
    """Jacobians by every argument, forward and reverse, each compiled once."""
    return [jax.jit(mode(function, argnums=arguments)) for mode in (jax.jacfwd, jax.jacrev)]


def check_derivatives(function, modes, point, arguments):
    point = tuple(map(jnp.asarray, point))
    forward, reverse = (mode(*point) for mode in modes)
    for argument, ahead, back in zip(arguments, forward, reverse, strict=True):
        expected = central(function, point, argument)
        size = 1 + np.abs(expected).max()
        np.testing.assert_allclose(ahead, expected, atol=1e-7 * size)
        np.testing.assert_allclose(back, ahead, atol=1e-12 * size)


@pytest.mark.more
def test_accelerations_and_forces():
    """Where all contacts at rest are independent, the forces are unique, too."""
    function = jax.jit(symmetrised(outputs))
    arguments = (0, 1, 2, 3)
    modes = both_modes(function, arguments)
    mixed = 0
    for problem in regular_problems(1, 10, 4, 3, ("generic",)):
        check_derivatives(function, modes, problem, arguments)
        state = np.asarray(SOLVE(*problem).contact_state)
        mixed += bool(np.any(state == 0) and np.any(state != 0))
    assert mixed >= 5


@pytest.mark.more
@pytest.mark.parametrize(
    "kind", [pytest.param("generic", marks=pytest.mark.slow), "dependent", "repeated"]
)
def test_more_contacts_than_velocities(kind):
    """The held set must span all that rests, also contacts that carry nothing."""

    def acceleration(*problem):
        return resolve(*problem).acceleration

    derivatives = {i: jax.jit(jax.jacrev(acceleration, argnums=i)) for i in (1, 3)}
    function = jax.jit(acceleration)
    for problem in regular_problems(3, 12, 3, 5, (kind,)):
        for argument, derivative in derivatives.items():
            expected = central(function, problem, argument)
            size = 1 + np.abs(expected).max()
            np.testing.assert_allclose(derivative(*problem), expected, atol=1e-8 * size)


@pytest.mark.parametrize("force", [(0.0, 0.0), (0.5, 0.0), (0.0, -0.5), (3.0, 0.0), (0.0, 3.0)])
def test_unloaded_contacts_hold_against_perturbations(force):
    """No force is on a contact, yet it stays at rest under a small one: the derivative has to know."""
    M = np.array([[2.0, 0.3], [0.3, 1.0]])
    N = np.array([[1.0, 0], [0, 1]])
    F = M @ np.array([1.0, 0]) + [1, 0] if force == (3.0, 0.0) else np.array(force)
    F = M @ np.array([0, 1.0]) + [0, 1] if force == (0.0, 3.0) else F

    def acceleration(F):
        return resolve(M, F, N, np.ones(2)).acceleration

    expected = central(acceleration, (F,), 0)
    np.testing.assert_allclose(jax.jacfwd(acceleration)(jnp.asarray(F)), expected, atol=1e-8)


@pytest.mark.slow
def test_second_derivatives():
    problem = regular_problems(4, 1, 3, 2, ("generic",))[0]

    def kinetic(M, F):
        a = resolve((M + M.T) / 2, F, *problem[2:]).acceleration
        return jnp.sum(a**4)

    gradient = jax.jit(jax.grad(kinetic, argnums=1))
    second = jax.jit(jax.jacfwd(jax.grad(kinetic, argnums=1), argnums=(0, 1)))
    for argument, exact in enumerate(second(*map(jnp.asarray, problem[:2]))):
        expected = central(gradient, problem[:2], argument)
        np.testing.assert_allclose(exact, expected, atol=1e-6 * (1 + np.abs(expected).max()))


@pytest.mark.slow
def test_derivatives_in_a_batch():
    problems = regular_problems(5, 6, 3, 5, ("generic",))

    def kinetic(F, M, N, R):
        return jnp.sum(resolve(M, F, N, R).acceleration ** 2)

    stacked = [jnp.stack([jnp.asarray(p[i]) for p in problems]) for i in (1, 0, 2, 3)]
    together = jax.jit(jax.vmap(jax.grad(kinetic)))(*stacked)
    for i, problem in enumerate(problems):
        alone = jax.grad(kinetic)(jnp.asarray(problem.force), *(problem[k] for k in (0, 2, 3)))
        np.testing.assert_allclose(together[i], alone, atol=1e-12)


@pytest.mark.slow
def test_vector_dead_zone():
    function = jax.jit(symmetrised(vector_dead_zone))
    arguments = (0, 1, 2, 3)
    modes = both_modes(function, arguments)
    general = jax.jit(jax.jacrev(symmetrised(lambda *p: resolve(*p).acceleration), argnums=arguments))
    for problem in regular_problems(6, 15, 2, 4, ("generic",)):
        check_derivatives(function, modes, problem, arguments)
        for closed, searched in zip(modes[1](*problem), general(*problem), strict=True):
            size = 1 + np.abs(searched).max()
            np.testing.assert_allclose(closed, searched, atol=1e-11 * size)


def test_gauge():
    rng = np.random.default_rng(8)
    arguments = (0, 1, 2)
    modes = both_modes(dead_zone_gauge, arguments)
    for _ in range(5):
        _, *point = random_problem(rng, 3, 5, "generic")
        check_derivatives(dead_zone_gauge, modes, point, arguments)


@pytest.mark.more
def test_hold():
    M, F, N, _ = random_problem(np.random.default_rng(9), 4, 3, "generic")
    held = np.array([True, False, True])

    def motion(M, F, N, prescribed):
        found = hold((M + M.T) / 2, F, N, held, prescribed)
        return jnp.concatenate([found.acceleration, found.contact_force])

    arguments = (0, 1, 2, 3)
    function = jax.jit(motion)
    point = (M, F, N, np.array([0.3, 0.0, -0.2]))
    check_derivatives(function, both_modes(function, arguments), point, arguments)
