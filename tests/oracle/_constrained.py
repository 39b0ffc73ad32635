"""The motion while a known set of contacts holds: one linear problem."""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from stickslip.contact._problem import as_problem
from tests.oracle._active_set import DEPENDENT, ROUNDING
from tests.oracle._linear_algebra import (
    cholesky,
    combine,
    dots,
    gram_schmidt,
    reject,
    solve_lower,
    solve_upper,
)


class Held(eqx.Module):
    """Motion and forces while contacts hold, from `hold`.

    **Attributes:**

    - `acceleration`: generalised accelerations `a`, shape `[n]`.
    - `constraint_force`: `M a - F`, the resultant of all holding forces, shape `[n]`. It is unique
      even where the single forces are not.
    - `contact_force`: forces `lambda` with `constraint_force = N' lambda`, shape `[m]`; where the
      held normals are dependent, later contacts that add nothing carry none.
    """

    acceleration: Float[Array, " n"]
    constraint_force: Float[Array, " n"]
    contact_force: Float[Array, " m"]


def constrained(
    mass_matrix: Float[Array, "n n"],
    force: Float[Array, " n"],
    normals: Float[Array, "m n"],
    held: Bool[Array, " m"],
    contact_acceleration: Float[Array, " m"],
    tolerance: Float[Array, " m"] | float = ROUNDING,
) -> Held:
    """`hold` for arrays that have been checked."""
    factor = cholesky(mass_matrix)
    # Two solves, not one: transposition needs the force, a tangent in the rule of `resolve`, kept
    # apart.
    pull = solve_lower(factor, force[:, None])[:, 0]
    rows = solve_lower(factor, normals.T).T
    basis = gram_schmidt(rows, held, tolerance)
    prescribed = basis.components(jnp.where(held, contact_acceleration, 0.0))
    motion = reject(basis.q, pull) + combine(basis.q, prescribed)
    contact_force = basis.weights(prescribed - dots(basis.q, pull))
    return Held(
        solve_upper(factor, motion),
        jnp.sum(contact_force[:, None] * normals, axis=0),
        contact_force,
    )


_hold = eqx.filter_jit(constrained)


def hold(
    mass_matrix: ArrayLike,
    force: ArrayLike,
    normals: ArrayLike,
    held: ArrayLike,
    contact_acceleration: ArrayLike | None = None,
) -> Held:
    r"""Acceleration of a body some of whose contacts hold, whatever force that takes.

    $$M a = F + \sum_{c\ \text{held}} \lambda_c n_c, \qquad
    n_c \cdot a = \gamma_c \ \text{for held } c.$$

    Within one regime of stick and slip this is the smooth field that `resolve` selects at its
    start: it costs no search, and the regime lasts while `dead_zone_gauge(constraint_force,
    normals, limits, active=held)` is below one.

    **Arguments:**

    - `mass_matrix`: `M`, symmetric positive definite, shape `[n, n]` (kg, kg m² ... by velocity).
    - `force`: `F`, applied forces and friction of the moving contacts, shape `[n]` (N, N m ...).
    - `normals`: `n_c`, one row per contact, shape `[m, n]`; `n_c · v` is the sliding velocity.
      Where the rows of held contacts are dependent, the prescribed values of the later ones are not
      looked at.
    - `held`: which contacts hold, booleans of shape `[m]`.
    - `contact_acceleration`: prescribed `gamma_c`, shape `[m]`; zero if not given.

    **Returns:** a [`Held`][].

    Source: Gauss (1829), "Über ein neues allgemeines Grundgesetz der Mechanik" (least constraint).
    """
    problem = as_problem(mass_matrix, force, normals, jnp.zeros(len(jnp.asarray(normals))), held)
    prescribed = problem.limits if contact_acceleration is None else jnp.asarray(contact_acceleration)
    return _hold(
        problem.mass_matrix, problem.force, problem.normals, problem.active, prescribed, DEPENDENT
    )
