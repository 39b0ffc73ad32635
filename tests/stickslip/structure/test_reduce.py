"""Craig-Bampton reduction against the full model and the continuous bar; modal damping."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import stickslip as ss
from stickslip.structure import LinearStructure, craig_bampton, modal_damping


def bar(n):
    """A bar of length 1, fixed at one end, in `n` linear elements: stiffness, consistent mass."""
    ones = np.ones(n)
    K = n * scipy.sparse.diags_array(
        [-ones[1:], np.append(2 * ones[1:], 1.0), -ones[1:]], offsets=[-1, 0, 1]
    )
    M = scipy.sparse.diags_array([ones[1:], np.append(4 * ones[1:], 2.0), ones[1:]], offsets=[-1, 0, 1])
    return M / (6 * n), K


def frequencies(M, K):
    return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True))


def test_frequencies_come_from_above_and_converge_with_the_modes():
    M, K = bar(300)
    full = frequencies(M.toarray(), K.toarray())
    errors = []
    for modes in (3, 6, 12):
        small = craig_bampton(M, K, [299], modes)
        assert small.mass.shape == (1 + modes,) * 2
        errors.append(frequencies(small.mass, small.stiffness)[:3] / full[:3] - 1.0)
    first = np.array(errors)[:, 0]
    # Measured 4.2e-4, 6.2e-5 and 8.6e-6: as the third power of the number of modes.
    assert np.all(np.array(errors) > 0.0)
    assert np.all(first < [5e-4, 7e-5, 1e-5])
    assert np.all(np.diff(np.array(errors), axis=0) < 0.0)
    assert full[0] == pytest.approx(np.pi / 2, rel=1e-5)


def test_all_modes_are_the_full_model_and_statics_are_exact():
    M, K = (A.toarray() for A in bar(12))
    small = craig_bampton(M, K, [11, 4], 10)
    np.testing.assert_allclose(frequencies(small.mass, small.stiffness), frequencies(M, K), rtol=1e-10)
    few = craig_bampton(M, K, [11, 4], 1)
    load = np.zeros(12)
    load[11], load[4] = 1.0, -0.3
    right = np.linalg.solve(K, load)
    found = few.basis @ np.linalg.solve(few.stiffness, few.basis.T @ load)
    np.testing.assert_allclose(found, right, atol=1e-12)
    np.testing.assert_allclose(few.basis[[11, 4]], np.eye(2, 3), atol=0.0)


def test_the_same_model_reduces_to_the_same_numbers():
    M, K = bar(200)
    one, other = (craig_bampton(M, K, [199], 6) for _ in range(2))
    np.testing.assert_array_equal(one.basis, other.basis)
    shifted = craig_bampton(M, K, np.array([199]), 6)
    np.testing.assert_array_equal(one.stiffness, shifted.stiffness)


def test_modal_damping_gives_each_mode_its_ratio():
    M, K = (A.toarray() for A in bar(6))
    ratios = np.array([0.01, 0.02, 0.005, 0.03, 0.1, 0.002])
    C = np.asarray(modal_damping(M, K, ratios))
    first = np.block([[np.zeros((6, 6)), np.eye(6)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    found = np.linalg.eigvals(first)
    found = found[found.imag > 0]
    found = found[np.argsort(np.abs(found))]
    np.testing.assert_allclose(np.abs(found), frequencies(M, K), rtol=1e-10)
    np.testing.assert_allclose(-found.real / np.abs(found), ratios, rtol=1e-8)


def test_a_reduced_structure_rings_with_its_frequency_and_ratio():
    M, K = bar(100)
    small = craig_bampton(M, K, [99], 3)
    structure = LinearStructure(
        small.mass, modal_damping(small.mass, small.stiffness, 0.01), small.stiffness
    )
    w, shapes = scipy.linalg.eigh(small.stiffness, small.mass)
    first = shapes[:, 0]
    period = 2 * np.pi / (np.sqrt(w[0]) * np.sqrt(1 - 1e-4))
    run = ss.simulate(structure, 0.0, 3 * period, structure.state(first))
    decay = np.exp(-0.01 * np.sqrt(w[0]) * 3 * period)
    np.testing.assert_allclose(run.y1.q, decay * first, atol=1e-9)
    assert structure.frequencies()[0] == pytest.approx(np.sqrt(w[0]), rel=1e-10)
