"""Multipliers of matrices whose eigenvalues are known, zeros in Jordan blocks among them."""

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.continuation._floquet import multipliers_of


@pytest.mark.parametrize(
    ("blocks", "others"),
    [
        ((4,), ()),
        ((3,), (-2.0,)),
        ((2, 1), (0.5,)),
        ((2,), (1.5, 1.0)),
        ((1,), (2.0, -1.0, 0.5)),
        ((), ()),
    ],
)
def test_zeros_in_jordan_blocks_are_exact(blocks, others):
    """Rounding would move those of a block of size k by the k-th root of 1e-16."""
    matrix, at = np.zeros((4, 4)), 0
    for size in blocks:
        matrix[at : at + size, at : at + size] = np.eye(size, k=1)
        at += size
    matrix[range(at, at + len(others)), range(at, at + len(others))] = others
    if not blocks:  # a pair, and another one
        angle = 0.3 * np.array([[0.0, -1.0], [1.0, 0.0]])
        matrix[:2, :2], matrix[2:, 2:] = 0.9 * np.eye(2) + angle, 0.2 * np.eye(2) - angle
        others = np.linalg.eigvals(matrix)
    turned = np.linalg.qr(np.random.default_rng(1).standard_normal((4, 4)))[0]
    found = np.asarray(multipliers_of(jnp.asarray(turned @ matrix @ turned.T), 4))
    assert np.count_nonzero(found) == len(others)
    right = sorted(others, key=lambda value: (-abs(value), -np.imag(value)))
    np.testing.assert_allclose(found[: len(others)], right, atol=1e-13)
