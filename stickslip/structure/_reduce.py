"""From the matrices of a finite-element model to few: Craig-Bampton reduction, modal damping."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg
from jaxtyping import Array, Float

from .._types import Given, Numeric, Rows
from .._validation import (
    check_count,
    check_finite,
    check_known,
    check_nonnegative,
    numbers,
    refusal,
    shape_refusal,
)
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._linear_structure import square, symmetric

Sparse = Given[scipy.sparse.spmatrix | scipy.sparse.sparray | np.ndarray]
NODES = "one row of different numbers of nodes, integers from 0 on"


class Reduction(NamedTuple):
    """A reduced model: `mass` and `stiffness` `[reduced, reduced]`, and the `basis` `[node, reduced]`.

    The displacements of all nodes are `basis @ q`, a load on them is `basis.T @ load` on the reduced
    ones. The first of these are the boundary nodes in their order, the others amplitudes of modes.
    """

    mass: np.ndarray
    stiffness: np.ndarray
    basis: np.ndarray


def craig_bampton(
    mass: Sparse, stiffness: Sparse, boundary: Given[Sequence[int] | np.ndarray], modes: Given[int] = 20
) -> Reduction:
    r"""Reduction by Craig and Bampton: boundary nodes, and modes of the rest with these fixed.

    With the boundary $b$, on which friction and loads act, and the interior $i$,

    $$q_i = -K_{ii}^{-1}K_{ib}\,q_b + \Phi\,\eta, \qquad K_{ii}\Phi = M_{ii}\Phi\Omega^2$$

    Frequencies of the reduced model are never too low, and the lower ones converge fastest with the
    number of modes. A bar of 400 elements, of which the end is kept:

    >>> import numpy as np, scipy.sparse as sp
    >>> from stickslip.structure import craig_bampton, modal_damping, LinearStructure
    >>> n, ones = 400, np.ones(400)
    >>> K = n * sp.diags_array([-ones[1:], np.append(2 * ones[1:], 1.0), -ones[1:]], offsets=[-1, 0, 1])
    >>> M = sp.diags_array(np.append(ones[1:], 0.5)) / n
    >>> small = craig_bampton(M, K, boundary=[n - 1], modes=5)
    >>> damping = modal_damping(small.mass, small.stiffness, 0.01)
    >>> bar = LinearStructure(small.mass, damping, small.stiffness)
    >>> (bar.frequencies()[:2] / np.pi).round(3).tolist()  # of the continuous bar 0.5 and 1.5
    [0.5, 1.501]

    **Arguments:** `mass`, `stiffness`: symmetric matrices `[node, node]`, sparse ones of SciPy or
    arrays; those of the interior positive definite. `boundary`: numbers of the nodes that are kept.
    `modes`: how many modes of the interior, at most as many as it has nodes.
    **Returns** a `Reduction`. **Raises** `ValueError`, `TypeError` naming the argument.

    ??? cite "Reference"

        R. R. Craig, M. C. C. Bampton, *AIAA J.* 6(7):1313, 1968.
    """
    M, K = _sparse("mass", mass), _sparse("stiffness", stiffness)
    if K.shape != M.shape:
        raise shape_refusal("stiffness", stiffness, f"of shape {M.shape}, that of the mass")
    kept = _nodes(boundary, M.shape[0])
    inside = np.setdiff1d(np.arange(M.shape[0]), kept)
    check_count("modes", modes, 0)
    if modes > len(inside):
        raise refusal("modes", modes, f"at most {len(inside)}, the number of nodes of the interior")
    basis = np.zeros((M.shape[0], len(kept) + modes))
    basis[kept, : len(kept)] = np.eye(len(kept))
    if len(inside):
        K_ii, K_ib = K[inside][:, inside].tocsc(), K[inside][:, kept]
        solve = _factor("stiffness", K_ii)
        basis[inside, : len(kept)] = -solve.solve(K_ib.toarray())
        basis[inside, len(kept) :] = _lowest_modes(K_ii, M[inside][:, inside].tocsc(), modes)
    small_M, small_K = (basis.T @ (A @ basis) for A in (M, K))
    return Reduction(0.5 * (small_M + small_M.T), 0.5 * (small_K + small_K.T), basis)


def modal_damping(mass: Rows, stiffness: Rows, ratios: Numeric) -> Float[Array, "node node"]:
    r"""Damping matrix with the same modes as the undamped structure, from their damping ratios.

    $C = \sum_r 2\zeta_r\omega_r\,M\varphi_r\varphi_r^T M$ with $\varphi_r^T M\varphi_r = 1$.

    **Arguments:** `mass`, `stiffness`, symmetric and known; `ratios` $\zeta$ [-], one number or a row
    with one for each mode, lowest first. **Returns** the matrix [N s/m].
    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    M = symmetric("mass", square("mass", check_known("mass", mass)))
    K = square("stiffness", check_known("stiffness", stiffness), M.shape)
    symmetric("stiffness", K)
    check_nonnegative("ratios", ratios)
    if np.shape(ratios) not in ((), (M.shape[0],)):
        raise shape_refusal("ratios", ratios, f"one number, or a row of {M.shape[0]}")
    try:
        squares, shapes = scipy.linalg.eigh(np.asarray(K), np.asarray(M))
    except np.linalg.LinAlgError:
        raise refusal("mass", np.asarray(M).tolist(), "positive definite") from None
    carried = np.asarray(M) @ shapes
    rates = 2.0 * jnp.asarray(ratios, jnp.float64) * np.sqrt(np.maximum(squares, 0.0))
    return (carried * rates[None, :]) @ carried.T


def _sparse(name: str, value: Any) -> Any:
    if not scipy.sparse.issparse(value):
        return scipy.sparse.csr_array(np.asarray(symmetric(name, square(name, value))))
    if value.shape[0] != value.shape[1]:
        raise shape_refusal(name, value, "a square matrix")
    found = scipy.sparse.csr_array(value, dtype=float)
    check_finite(name, found.data if found.nnz else 0.0)
    away = abs(found - found.T)
    if away.nnz and away.max() > ENGINE.zero * abs(found).max():
        raise refusal(name, value, "symmetric")
    return found


def _nodes(boundary: Any, size: int) -> np.ndarray:
    nodes = numbers("boundary", boundary, NODES)
    if nodes.ndim != 1 or not nodes.size or nodes.dtype.kind not in "iu":
        raise refusal("boundary", boundary, NODES, TypeError)
    if nodes.min() < 0 or nodes.max() >= size or len(set(nodes.tolist())) < nodes.size:
        raise refusal("boundary", nodes.tolist(), f"{NODES} to {size - 1}")
    return nodes


def _factor(name: str, matrix: Any) -> Any:
    try:
        return scipy.sparse.linalg.splu(matrix)
    except RuntimeError:
        allowed = "regular where the boundary is fixed: keep nodes that leave no rigid motion"
        raise refusal(name, matrix, allowed) from None


def _lowest_modes(K: Any, M: Any, count: int) -> np.ndarray:
    """Shapes of the lowest modes, of modal mass 1."""
    if 2 * count >= K.shape[0] - 1:
        return scipy.linalg.eigh(K.toarray(), M.toarray())[1][:, :count]
    if not count:
        return np.zeros((K.shape[0], 0))
    # The same vector to begin with every time, so that the result is the same to the last digit.
    begin = np.cos(np.arange(K.shape[0]))
    squares, shapes = scipy.sparse.linalg.eigsh(K, count, M, sigma=0.0, v0=begin)
    return shapes[:, np.argsort(squares)]
