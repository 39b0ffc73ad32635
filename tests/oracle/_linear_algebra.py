"""Small dense factorisations, unrolled, with any lanes on the trailing axes.

XLA on CPU vectorises over the last axis. Small problems in batches are therefore fast with the batch
last, and an order of magnitude slower with the batch first, which is where `vmap` puts it. All loops
run over static sizes of at most a few.
"""

from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


def dots(
    rows: Float[Array, "m n *lanes"], vector: Float[Array, "n *lanes"]
) -> Float[Array, "m *lanes"]:
    """Scalar product of every row with the vector."""
    return jnp.sum(rows * vector[None], axis=1)


def combine(
    rows: Float[Array, "m n *lanes"], weights: Float[Array, "m *lanes"]
) -> Float[Array, "n *lanes"]:
    """Sum of the rows, each times its weight."""
    return jnp.sum(rows * weights[:, None], axis=0)


def safe_norm(vector: Float[Array, "*shape"], axis: int) -> Float[Array, "..."]:
    """Euclidean norm with derivative zero, not NaN, at zero."""
    square = jnp.sum(vector * vector, axis=axis)
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def cholesky(matrix: Float[Array, "n n *lanes"]) -> Float[Array, "n n *lanes"]:
    """Columns of the lower factor, `result[j, i] = L[i, j]`; NaN if not positive definite."""
    size = matrix.shape[0]
    row = jnp.arange(size).reshape((size,) + (1,) * (matrix.ndim - 2))
    columns = []
    for j in range(size):
        column = matrix[:, j]
        if j:
            earlier = jnp.stack(columns)
            column = column - combine(earlier, earlier[:, j])
        columns.append(jnp.where(row >= j, column / jnp.sqrt(column[j])[None], 0.0))
    return jnp.stack(columns)


def solve_lower(
    factor: Float[Array, "n n *lanes"], right: Float[Array, "n k *lanes"]
) -> Float[Array, "n k *lanes"]:
    """Solution of `L x = right`, the factor given by its columns."""
    solution = []
    for i in range(len(right)):
        rest = right[i]
        if i:
            rest = rest - combine(jnp.stack(solution), factor[:i, i])
        solution.append(rest / factor[i, i][None])
    return jnp.stack(solution)


def solve_upper(
    factor: Float[Array, "n n *lanes"], right: Float[Array, "n *lanes"]
) -> Float[Array, "n *lanes"]:
    """Solution of `L' x = right`, the factor given by the columns of `L`."""
    solution = []
    for i in reversed(range(len(right))):
        rest = right[i]
        if solution:
            rest = rest - jnp.sum(factor[i, i + 1 :] * jnp.stack(solution), axis=0)
        solution.insert(0, rest / factor[i, i])
    return jnp.stack(solution)


def reject(
    basis: Float[Array, "m n *lanes"], vector: Float[Array, "n *lanes"]
) -> Float[Array, "n *lanes"]:
    """Part of the vector orthogonal to an orthonormal basis; twice, because once loses digits."""
    for _ in range(2):
        vector = vector - combine(basis, dots(basis, vector))
    return vector


@dataclass(frozen=True)
class Basis:
    """Orthonormal rows `q`, and how the rows kept were made of them.

    Kept rows obey `rows[c] = sum_k earlier[c][k] q[k] + height[c] q[c]`, `k < c`. A row not kept has
    `q[c] = 0` and an infinite height.
    """

    q: Float[Array, "m n *lanes"]
    earlier: list[Float[Array, "_ *lanes"]]
    height: list[Float[Array, "*lanes"]]

    @property
    def kept(self) -> Bool[Array, "m *lanes"]:
        """Which rows span the basis."""
        return jnp.stack(self.height) < jnp.inf

    def weights(self, components: Float[Array, "m *lanes"]) -> Float[Array, "m *lanes"]:
        """Weights of the kept rows whose sum has these components along `q`; zero on the others."""
        rest, result = components, []
        for c in reversed(range(len(self.q))):
            result.append(rest[c] / self.height[c])
            rest = rest[:c] - self.earlier[c] * result[-1][None]
        return jnp.stack(result[::-1])

    def components(self, products: Float[Array, "m *lanes"]) -> Float[Array, "m *lanes"]:
        """Components along `q` of the vector in their span with these products with the rows."""
        result = jnp.zeros_like(products[:0])
        for c in range(len(self.q)):
            rest = products[c] - jnp.sum(self.earlier[c] * result, axis=0)
            result = jnp.concatenate([result, (rest / self.height[c])[None]])
        return result


def gram_schmidt(
    rows: Float[Array, "m n *lanes"],
    keep: Bool[Array, "m *lanes"],
    tolerance: Float[Array, "m *lanes"] | float,
) -> Basis:
    """Orthonormal basis of the rows to keep, in order.

    A row is left out where its distance to the span of the earlier ones is at most `tolerance` times
    its length. Every row is orthogonalised twice, which makes the result orthogonal to rounding for
    any angles between the rows.

    The form is chosen for XLA on CPU, which stores the results of reductions and divisions and
    computes everything else again for every use: three times faster than with a mask on all rows, or
    one on the quotients.
    """
    least = tolerance * safe_norm(rows, axis=1)
    q, earlier, height = rows[:0], [], []
    for c in range(len(rows)):
        rest, along = jnp.where(keep[c][None], rows[c], 0.0), jnp.zeros_like(q[:, 0])
        for _ in range(2 if c else 0):
            step = dots(q, rest)
            rest = rest - combine(q, step)
            along = along + step
        distance = safe_norm(rest, axis=0)
        # A NaN is kept, so that it is seen.
        height.append(jnp.where(distance <= least[c], jnp.inf, distance))
        earlier.append(along)
        q = jnp.concatenate([q, (rest / height[c][None])[None]])
    return Basis(q, earlier, height)
