"""Small dense factorisations, unrolled, with any lanes on the trailing axes.

XLA on CPU vectorises over the last axis. A batch of 6-by-6 problems is therefore fast with the
batch last, and slow with the batch first, which is where `vmap` puts it: measured 5 against 90
microseconds per problem for the search in `_active_set`. All loops run over static sizes of at most
a few.
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


def apart(
    vectors: Float[Array, "m n *lanes"], basis: Float[Array, "k n *lanes"]
) -> Float[Array, "m n *lanes"]:
    """`reject` for every one of several vectors."""
    for _ in range(2):
        products = jnp.sum(vectors[:, None] * basis[None], axis=2)
        vectors = vectors - jnp.sum(products[:, :, None] * basis[None], axis=1)
    return vectors


@dataclass(frozen=True)
class Basis:
    """Orthonormal rows `q`, and how the rows kept were made of them.

    Kept rows obey `rows[c] = sum_k table[c, k] q[k]`, `k <= c`. A row not kept has `q[c] = 0`.
    """

    q: Float[Array, "m n *lanes"]
    table: Float[Array, "m m *lanes"]
    kept: Bool[Array, "m *lanes"]

    def _height(self, c: int) -> Float[Array, "*lanes"]:
        return jnp.where(self.kept[c], self.table[c, c], 1.0)

    def weights(self, components: Float[Array, "m *lanes"]) -> Float[Array, "m *lanes"]:
        """Weights of the kept rows whose sum has these components along `q`; zero on the others."""
        rest = components
        result = []
        for c in reversed(range(len(self.q))):
            weight = jnp.where(self.kept[c], rest[c] / self._height(c), 0.0)
            rest = rest[:c] - self.table[c, :c] * weight[None]
            result.append(weight)
        return jnp.stack(result[::-1])

    def components(self, products: Float[Array, "m *lanes"]) -> Float[Array, "m *lanes"]:
        """Components along `q` of the vector in their span with these products with the rows."""
        rest = products
        result = []
        for c in range(len(self.q)):
            component = jnp.where(self.kept[c], rest[0] / self._height(c), 0.0)
            rest = rest[1:] - self.table[c + 1 :, c] * component[None]
            result.append(component)
        return jnp.stack(result)


def gram_schmidt(
    rows: Float[Array, "m n *lanes"],
    keep: Bool[Array, "m *lanes"],
    tolerance: Float[Array, "m *lanes"] | float,
) -> Basis:
    """Orthonormal basis of the rows to keep, in order.

    A row is left out where its distance to the span of the earlier ones is at most `tolerance`
    times its length. Every row is orthogonalised twice, which makes the result orthogonal to
    rounding for any angles between the rows.
    """
    rows = jnp.where(keep[:, None], rows, 0.0)
    least = tolerance * safe_norm(rows, axis=1)
    q, kept = [], []
    for c in range(len(rows)):
        rest = rows[c]
        if c:
            # Against all earlier rows at once: stacking makes XLA store them, where it would
            # otherwise compute each again for every later row.
            rest = reject(jnp.stack(q), rest)
        distance = safe_norm(rest, axis=0)
        # A NaN is kept, so that it is seen.
        kept.append(~(distance <= least[c]))
        direction = rest / jnp.where(kept[c], distance, 1.0)[None]
        q.append(jnp.where(kept[c][None], direction, 0.0))
    basis = jnp.stack(q)
    return Basis(basis, jnp.sum(rows[:, None] * basis[None], axis=2), jnp.stack(kept))
