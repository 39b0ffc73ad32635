"""Floquet multipliers of a monodromy matrix that events have made of lower rank."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Int

from ..hybrid.accuracy import ACCURACY as ENGINE


def nonzero_first(multipliers: Complex[Array, " size"]) -> Complex[Array, " size"]:
    """Sorted, largest first; of a conjugate pair the one above the real axis first."""
    order = jnp.lexsort((-multipliers.imag, -jnp.abs(multipliers)))
    return multipliers[order]


def multipliers_of(matrix: Float[Array, "size size"], rank: Any) -> Complex[Array, " size"]:
    r"""Eigenvalues of a matrix of which at most `rank` are not zero; the others are exactly 0.

    Rounding moves a zero eigenvalue in a Jordan block of size $k$ by $\epsilon^{1/k}$, so that zeros
    cannot be told from the eigenvalues. They can from the rank: with $M = U_r\Sigma_r V_r^T$ the
    eigenvalues that are not zero are those of $\Sigma_r V_r^T U_r$, an $r \times r$ matrix; repeated
    until this one has full rank.
    """
    size = matrix.shape[0]
    index = jnp.arange(size, dtype=jnp.int32)
    rank = jnp.minimum(jnp.asarray(rank, jnp.int32), size)

    def once(state):
        # A direction that an event projects out leaves a singular value of rounding.
        matrix, rank, block, largest, _ = state
        left, strength, right = jnp.linalg.svd(matrix)
        largest = jnp.maximum(largest, strength[0])  # that of the first round
        kept = (index < rank) & (strength > ENGINE.slack * largest)
        small = (strength[:, None] * right) @ left
        matrix = jnp.where(kept[:, None] & kept[None, :], small, 0.0)
        rank = jnp.sum(kept, dtype=jnp.int32)
        return matrix, rank, rank, largest, rank < block

    if size:
        none = jnp.zeros((), matrix.dtype)
        begin = matrix, rank, jnp.asarray(size, jnp.int32), none, jnp.asarray(True)
        matrix, rank, *_ = jax.lax.while_loop(lambda state: state[-1], once, begin)
    found = jnp.linalg.eigvals(matrix)
    # The eigenvalues come in no order; those of the empty rows are zero, or rounding.
    found = nonzero_first(found)
    return jnp.where(index < rank, found, 0.0)


def with_ones(multipliers: Complex[Array, " size"], count: Int[Array, ""]) -> Complex[Array, " size"]:
    """The same with so many multipliers 1 instead of zeros, of shifts of the state."""
    first = jnp.sum(multipliers != 0.0, dtype=jnp.int32)
    index = jnp.arange(multipliers.shape[0], dtype=jnp.int32)
    return nonzero_first(jnp.where((index >= first) & (index < first + count), 1.0, multipliers))


def split_off(
    matrix: Float[Array, "size size"], along: Float[Array, " size"]
) -> tuple[Float[Array, ""], Float[Array, "rest rest"]]:
    r"""Multiplier of the direction `along`, which the matrix keeps, and what it does to the others.

    In an orthonormal basis that begins with `along` the matrix is block triangular.
    """
    size = along.shape[0]
    length = jnp.linalg.norm(along)
    unit = along / jnp.where(length > 0, length, 1.0)
    # Householder's reflection that takes the first axis to `unit`; its other columns span the rest.
    sign = jnp.where(unit[0] >= 0, 1.0, -1.0)
    mirror = unit.at[0].add(sign)
    basis = jnp.eye(size) - 2.0 * jnp.outer(mirror, mirror) / jnp.maximum(mirror @ mirror, 1e-300)
    turned = basis.T @ matrix @ basis
    return turned[0, 0], turned[1:, 1:]
