"""The dead zone in one dimension, and how much of it a force uses in any number of them."""

import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from stickslip.contact._problem import as_active, as_force, as_limits, as_normals
from tests.oracle._active_set import DEPENDENT, EPSILON, ROUNDING
from tests.oracle._linear_algebra import gram_schmidt, reject, safe_norm


def dead_zone(force: ArrayLike, limit: ArrayLike) -> Float[Array, "..."]:
    r"""Net force on a body at rest under one dry contact.

    $$\mathrm{DZ}(F, R) = 0 \text{ if } |F| \le R, \qquad F - R\,\mathrm{sgn} F \text{ otherwise}.$$

    The acceleration is this over the mass.

    **Arguments:**

    - `force`: applied force `F` (N), any shape.
    - `limit`: greatest static friction `R = mu_s N >= 0` (N), of a shape that broadcasts with it.

    **Returns:** the net force (N); exactly zero in the dead zone.

    Source: Eqs. (28)-(30) of the paper on the CoreXY mechanism, there with `f_s = -R sgn F`.
    """
    force, limit = jnp.broadcast_arrays(jnp.asarray(force), jnp.asarray(limit))
    return jnp.where(jnp.abs(force) > limit, force - limit * jnp.sign(force), 0.0)


def dead_zone_gauge(
    force: ArrayLike, normals: ArrayLike, limits: ArrayLike, *, active: ArrayLike | None = None
) -> Float[Array, ""]:
    r"""Share of the dead zone a force uses: below one nothing moves, at one something is about to.

    $$\gamma(F) = \min \{ t \ge 0 : F \in t Z \}
    = \max_d \frac{d \cdot F}{\sum_c R_c |n_c \cdot d|}$$

    over the normals `d` of the facets of the zonotope `Z`. Its reciprocal is the factor by which
    the load may grow. It does not depend on the mass matrix, is unique where the single friction
    forces are not, positively homogeneous and piecewise smooth: the guard `1 - gauge` ends a regime
    of sticking.

    **Arguments:**

    - `force`: `F`, shape `[n]` (N, N m ...).
    - `normals`: `n_c`, shape `[m, n]`; may be dependent, repeated or zero.
    - `limits`: greatest static friction `R_c >= 0`, shape `[m]` (N, N m).
    - `active`: which contacts count, booleans of shape `[m]`; all if not given.

    The cost grows with the number of facets: at most 5 for 2 velocities and 4 contacts, 93 for 4 and
    8, 219 for 6 and 8.

    **Returns:** the gauge, a scalar without unit; infinite where no multiple of the set holds the
    force.

    **Raises:** `ValueError` for wrong shapes, values not finite, negative limits.
    """
    rows = as_normals(normals)
    load = as_force(force, rows.shape[1])
    mask = as_active(active, rows)
    return _gauge(load, rows, jnp.where(mask, as_limits(limits, rows), 0.0))


@eqx.filter_jit
def _gauge(
    load: Float[Array, " n"], rows: Float[Array, "m n"], bounds: Float[Array, " m"]
) -> Float[Array, ""]:
    # A facet is spanned by contacts, and the part of F orthogonal to these is its normal. The
    # maximum over all parts orthogonal to up to n - 1 contacts therefore is the gauge, also of a
    # flat zonotope.
    count, size = rows.shape
    most = min(size - 1, count)
    subsets = [
        chosen for order in range(most + 1) for chosen in itertools.combinations(range(count), order)
    ]
    member = np.array([chosen + (0,) * (most - len(chosen)) for chosen in subsets]).T.astype(int)
    used = np.arange(most)[:, None] < np.array([len(chosen) for chosen in subsets])
    spanning = jnp.moveaxis(rows[member], -1, 1)
    basis = gram_schmidt(spanning, jnp.asarray(used & (bounds > 0)[member]), ROUNDING)
    normal = reject(basis.q, jnp.broadcast_to(load[:, None], (size, len(subsets))))

    strength = safe_norm(load, axis=0)
    along = jnp.abs(jnp.sum(rows[:, :, None] * normal[None], axis=1))
    felt = along > 64 * EPSILON * strength * safe_norm(rows, axis=1)[:, None]
    resistance = jnp.sum(jnp.where(felt, bounds[:, None] * along, 0.0), axis=0)
    resists = resistance > 0
    share = jnp.sum(normal * normal, axis=0) / jnp.where(resists, resistance, 1.0)
    share = jnp.where(resists, share, jnp.inf)
    share = jnp.where(safe_norm(normal, axis=0) > DEPENDENT * strength, share, 0.0)
    # No comparison with NaN holds, so that NaN would look like no force.
    bad = jnp.isnan(jnp.sum(load) + jnp.sum(rows) + jnp.sum(bounds))
    return jnp.where(bad, jnp.nan, jnp.max(share))


def in_dead_zone(
    force: ArrayLike, normals: ArrayLike, limits: ArrayLike, *, active: ArrayLike | None = None
) -> Bool[Array, ""]:
    """Whether nothing moves under this force: `resolve` would give `a = 0`.

    The dead zone is closed: a force on its border, to rounding, belongs to it. Arguments and errors
    as for `dead_zone_gauge`.

    **Returns:** a boolean.
    """
    gauge = dead_zone_gauge(force, normals, limits, active=active)
    return gauge <= 1 + 64 * EPSILON
