"""Concrete mistakes raise before compilation; traced ones end in a code in their own lane."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tests.oracle._resolve
from stickslip.contact import vector_dead_zone, zonotope_vertices
from tests.oracle import RESULTS, dead_zone_gauge, hold, in_dead_zone, resolve

M = np.array([[2.0, 0.5], [0.5, 1.0]])
F = np.array([1.0, -2.0])
N = np.array([[1.0, 0], [0, 1], [1, 1]])
R = np.array([0.5, 0.25, 1.0])
ARGUMENTS = {"mass_matrix": M, "force": F, "normals": N, "limits": R}

MISTAKES = [
    ("mass_matrix", np.eye(3)[:2], "of shape (2, 3): it must be of shape (n, n)"),
    ("mass_matrix", np.ones((4, 2, 2)), "batch with jax.vmap"),
    (
        "mass_matrix",
        np.array([[1.0, 2], [0, 1]]),
        "mass_matrix[0, 1] = 2.0: it must be mass_matrix[1, 0] = 0.0",
    ),
    ("mass_matrix", np.diag([1.0, -3]), "the eigenvalue -3.0: it must be positive definite"),
    ("mass_matrix", np.diag([1.0, 0]), "the eigenvalue 0.0: it must be positive definite"),
    ("mass_matrix", np.diag([1.0, np.nan]), "mass_matrix[1, 1] = nan: it must be finite"),
    ("force", np.ones(3), "of shape (3,): it must be of shape (2,), one value per velocity"),
    ("force", np.array([1.0, np.inf]), "force[1] = inf: it must be finite"),
    ("normals", np.ones((3, 3)), "of shape (3, 3): it must be of shape (m, 2)"),
    ("normals", np.ones((0, 2)), "of shape (0, 2)"),
    ("normals", np.full((3, 2), np.nan), "normals[0, 0] = nan: it must be finite"),
    ("limits", np.ones(2), "of shape (2,): it must be of shape (3,), one value per contact"),
    ("limits", np.array([1.0, -0.5, 1]), "limits[1] = -0.5: it must be finite and not negative"),
    ("limits", np.array([1.0, np.inf, 1]), "limits[1] = inf: it must be finite and not negative"),
    ("active", np.ones(3), "of shape (3,) and type float64: it must be booleans"),
    ("active", np.ones(2, bool), "of shape (2,) and type bool: it must be booleans"),
]


@pytest.mark.parametrize(("name", "value", "message"), MISTAKES)
def test_vector_dead_zone_names_argument_value_and_what_is_allowed(name, value, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        vector_dead_zone(**(ARGUMENTS | {name: value}))


def test_mistakes_of_the_other_functions():
    with pytest.raises(ValueError, match=r"force = .*, of shape \(3,\): it must be of shape \(2,\)"):
        vector_dead_zone(np.eye(3), np.ones(3), np.ones((2, 3)), np.ones(2))
    with pytest.raises(ValueError, match=r"of shape \(3, 3\): it must be of shape \(m, 2\)"):
        zonotope_vertices(np.ones((3, 3)), R)


def test_integers_are_numbers():
    found = resolve(
        np.eye(2, dtype=int), np.array([0, 4]), np.array([[1, 0], [0, 1]]), np.array([2, 1])
    )
    np.testing.assert_array_equal(found.acceleration, [0, 3])


def test_lanes_fail_alone():
    lanes = {
        "successful": (M, F, R),
        "mass_matrix_not_positive_definite": (np.diag([1.0, -1]), F, R),
        "nonfinite": (M, np.array([np.nan, 0]), R),
        "negative_limit": (M, F, -R),
    }
    masses, forces, limits = (jnp.asarray(np.stack(x)) for x in zip(*lanes.values(), strict=True))
    found = jax.jit(jax.vmap(lambda M, F, R: resolve(M, F, N, R)))(masses, forces, limits)
    for i, name in enumerate(lanes):
        code = jax.tree.map(lambda x, i=i: x[i], found.result)
        assert bool(code == getattr(RESULTS, name)), name
        finite = np.all(np.isfinite(found.acceleration[i]))
        assert finite == (name == "successful")
        np.testing.assert_array_equal(np.isnan(found.contact_force[i]), not finite)
        assert found.converged[i] == finite
    alone = resolve(M, F, N, R)
    np.testing.assert_allclose(found.acceleration[0], alone.acceleration, atol=1e-15)


def test_search_cut_short_says_so():
    found = resolve(np.eye(2), np.array([0.4, 4.0]), N, np.array([2.0, 1, 1]), max_steps=1)
    assert bool(found.result == RESULTS.max_steps_reached)
    assert not found.converged
    assert "max_steps" in RESULTS[found.result]


def test_lanes_of_the_other_functions_fail_alone():
    forces = jnp.array([[0.1, 0.1], [jnp.nan, 0.0]])
    gauges = jax.jit(jax.vmap(lambda F: dead_zone_gauge(F, N, R)))(forces)
    np.testing.assert_array_equal(np.isnan(gauges), [False, True])
    assert np.all(jax.vmap(lambda F: in_dead_zone(F, N, R))(forces) == np.array([True, False]))
    motions = jax.vmap(lambda F: hold(M, F, N, np.ones(3, bool)).constraint_force)(forces)
    np.testing.assert_array_equal(np.isnan(motions).any(axis=1), [False, True])


def test_violated_optimality_conditions_say_so(monkeypatch):
    # No problem is known that ends inaccurate, so the threshold comes to the rounding instead.
    monkeypatch.setattr(tests.oracle._resolve, "ACCURATE", -1.0)
    found = resolve(np.eye(2), np.ones(2), np.ones((7, 2)), np.ones(7))
    assert bool(found.result == RESULTS.inaccurate)
    assert not found.converged
