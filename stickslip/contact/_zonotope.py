"""The dead zone of several contacts as a set of forces: the zonotope spanned by `R_c n_c`."""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from ._problem import as_limits, as_normals


def zonotope_vertices(normals: ArrayLike, limits: ArrayLike) -> Float[Array, "corner 2"]:
    r"""Corners of the dead zone of contacts in the plane.

    $$Z = \Bigl\{ \sum_c \lambda_c n_c : |\lambda_c| \le R_c \Bigr\},$$

    the forces under which nothing moves, for any mass matrix.

    **Arguments:**

    - `normals`: `n_c`, shape `[m, 2]`.
    - `limits`: greatest static friction `R_c >= 0`, shape `[m]` (N, N m).

    **Returns:** `2 m` corners, counterclockwise, each edge twice a vector `R_c n_c`; the second
    half mirrors the first. Parallel normals and zero limits give corners on edges, or repeated
    ones.

    **Raises:** `ValueError` for wrong shapes, values not finite, negative limits.
    """
    rows = as_normals(normals, 2)
    return _vertices(as_limits(limits, rows)[:, None] * rows)


@eqx.filter_jit
def _vertices(edges: Float[Array, "m 2"]) -> Float[Array, "corner 2"]:
    # Turned into the half plane 0 <= angle < 180°, in the order of their angles, they bound the set.
    x, y = edges[:, 0], edges[:, 1]
    edges = jnp.where(((y < 0) | ((y == 0) & (x < 0)))[:, None], -edges, edges)
    edges = edges[jnp.argsort(jnp.arctan2(edges[:, 1], edges[:, 0]))]
    half = -jnp.sum(edges, axis=0)[None] + 2 * (jnp.cumsum(edges, axis=0) - edges)
    return jnp.concatenate([half, -half])
