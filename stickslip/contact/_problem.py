"""The arguments that all functions of the package share, checked and as arrays."""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from stickslip._validation import (
    as_parameter,
    check_finite,
    check_nonnegative,
    is_concrete,
    refusal,
    shape_refusal,
)


def _as_vector(name: str, value: Any, size: int, of: str) -> Float[Array, " size"]:
    array = as_parameter(check_finite(name, value))
    if array.shape != (size,):
        raise shape_refusal(name, value, f"of shape ({size},), one value per {of}, as the normals have")
    return array


def as_normals(normals: Any, size: int | None = None) -> Float[Array, "m n"]:
    """Rows `n_c`; at least one, and as long as the velocity if its size is given."""
    array = as_parameter(check_finite("normals", normals))
    if array.ndim != 2 or 0 in array.shape or (size is not None and array.shape[1] != size):
        columns = "n" if size is None else size
        allowed = f"of shape (m, {columns}), one row per contact, m at least 1; batch with jax.vmap"
        raise shape_refusal("normals", normals, allowed)
    return array


def as_limits(limits: Any, normals: Float[Array, "m n"]) -> Float[Array, " m"]:
    """Greatest friction forces `R_c`."""
    return _as_vector("limits", check_nonnegative("limits", limits), len(normals), "contact")


def as_force(force: Any, size: int) -> Float[Array, " n"]:
    """Generalised force `F`."""
    return _as_vector("force", force, size, "velocity")


def as_active(active: Any, normals: Float[Array, "m n"]) -> Bool[Array, " m"]:
    """Mask of contacts; all if not given."""
    if active is None:
        return jnp.ones(len(normals), bool)
    allowed = f"booleans of shape ({len(normals)},), one per contact, a row of the normals"
    array: Any = active
    if isinstance(active, list | tuple) and all(isinstance(a, bool | np.bool_) for a in active):
        array = np.asarray(active, bool)
    if not isinstance(array, np.ndarray | jax.Array) or isinstance(array, np.ma.MaskedArray):
        raise refusal("active", active, allowed, TypeError)
    if array.dtype != bool or array.shape != (len(normals),):
        raise refusal("active", active, allowed, but=f"of shape {array.shape} and type {array.dtype}")
    return jnp.asarray(array)


def as_mass_matrix(mass_matrix: Any) -> Float[Array, "n n"]:
    """Symmetric positive definite matrix; traced ones are made symmetric and not looked at."""
    array = as_parameter(check_finite("mass_matrix", mass_matrix))
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.shape[0] == 0:
        allowed = "of shape (n, n), n at least 1; batch with jax.vmap"
        raise shape_refusal("mass_matrix", mass_matrix, allowed)
    if is_concrete(array):
        matrix = np.asarray(array)
        uneven = np.abs(matrix - matrix.T)
        if uneven.max() > 1e-10 * np.abs(matrix).max():
            i, j = map(int, np.unravel_index(uneven.argmax(), matrix.shape))
            symmetric = f"mass_matrix[{j}, {i}] = {matrix[j, i]}: the matrix must be symmetric"
            raise refusal(f"mass_matrix[{i}, {j}]", float(matrix[i, j]), symmetric)
        smallest = np.linalg.eigvalsh(matrix)[0]
        if smallest <= 0:
            with_it = f"with the eigenvalue {smallest}"
            raise refusal("mass_matrix", mass_matrix, "positive definite", but=with_it)
    return (array + array.T) / 2


@dataclass(frozen=True)
class Problem:
    """`M`, `F`, the normals, the limits and the mask, of fitting shapes."""

    mass_matrix: Float[Array, "n n"]
    force: Float[Array, " n"]
    normals: Float[Array, "m n"]
    limits: Float[Array, " m"]
    active: Bool[Array, " m"]


def as_problem(mass_matrix: Any, force: Any, normals: Any, limits: Any, active: Any) -> Problem:
    """Check all of a problem."""
    matrix = as_mass_matrix(mass_matrix)
    rows = as_normals(normals, len(matrix))
    return Problem(
        matrix,
        as_force(force, len(matrix)),
        rows,
        as_limits(limits, rows),
        as_active(active, rows),
    )
