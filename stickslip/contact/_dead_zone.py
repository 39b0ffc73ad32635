"""The dead zone of contacts of two velocities in closed form: no search, only arithmetic."""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from stickslip._validation import shape_refusal

from ._problem import as_problem

EPSILON = float(jnp.finfo(jnp.float64).eps)


def _cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def _inner(a, b):
    return a[0] * b[0] + a[1] * b[1]


def vector_dead_zone(
    mass_matrix: ArrayLike,
    force: ArrayLike,
    normals: ArrayLike,
    limits: ArrayLike,
    *,
    active: ArrayLike | None = None,
) -> Float[Array, "2"]:
    r"""Acceleration of a body with two velocities on any number of dry contacts at rest.

    $$a = \arg\min_a \; \tfrac12 a^T M a - a^T F + \sum_{c\ \text{active}} R_c\, |n_c \cdot a|$$

    This is Gauss' principle of least constraint with Coulomb's set of static forces. The friction
    forces fill a polygon with edges along the normals. Inside it `a = 0`. Outside, `a` belongs to
    an edge or a corner of it. Edge `c` has all other contacts sliding in the sense `sgn(n_k ·
    d_c)`, `d_c` perpendicular to `n_c`; the force of contact `c` that stops it, cut to its
    interval, makes the edge and its two corners one candidate. Among the edges that `F` lies outside
    of, the one whose candidate agrees best with the signs it supposes is taken. Choosing by the
    signs, which are linear in `a`, and not by the least objective, which is quadratic, keeps the
    result exact to rounding at the borders between the candidates.

    **Arguments:**

    - `mass_matrix`: `M`, symmetric positive definite, shape `[2, 2]` (kg, kg m²).
    - `force`: `F`, applied forces and kinetic friction of the moving contacts, shape `[2]` (N, N
      m).
    - `normals`: `n_c`, shape `[m, 2]`; may be parallel, repeated or zero.
    - `limits`: greatest static friction `R_c = mu_s N_c >= 0`, shape `[m]` (N, N m).
    - `active`: which contacts are at rest, booleans of shape `[m]`; all if not given.

    **Returns:** `a`, shape `[2]`; exactly zero in the dead zone. Differentiable almost everywhere.

    **Raises:** `ValueError` naming the argument, its value and what is allowed, before anything is
    compiled: wrong shapes, values not finite, a mass matrix that is not symmetric positive definite,
    negative limits. A traced mass matrix that is not positive definite is not noticed.

    Source: C. F. Gauss (1829); J. J. Moreau (1966, 1988); C. Glocker (2001), "Set-Valued Force Laws";
    in one dimension Eq. (30) of the paper on the CoreXY mechanism.
    """
    problem = as_problem(mass_matrix, force, normals, limits, active)
    if problem.force.shape != (2,):
        raise shape_refusal("force", force, "of shape (2,)")
    limits = jnp.where(problem.active, problem.limits, 0.0)
    return _project(problem.mass_matrix, problem.force, problem.normals, limits)


@eqx.filter_jit
def _project(
    mass_matrix: Float[Array, "2 2"],
    force: Float[Array, "2"],
    normals: Float[Array, "m 2"],
    limits: Float[Array, " m"],
) -> Float[Array, "2"]:
    # Scalars throughout: under vmap every operation is then one pass over the lanes, all in one
    # kernel.
    (m_xx, m_xy), (_, m_yy) = mass_matrix
    determinant = m_xx * m_yy - m_xy * m_xy
    load = (force[0], force[1])
    normal = [(row[0], row[1]) for row in normals]
    limit = list(limits)

    def accelerate(force):
        x, y = force
        return (m_yy * x - m_xy * y) / determinant, (m_xx * y - m_xy * x) / determinant

    length = [jnp.abs(n[0]) + jnp.abs(n[1]) for n in normal]
    total = sum(r * size for r, size in zip(limit, length, strict=True))
    free = accelerate(load)
    best = [jnp.where(total > 0, 0.0, component) for component in free]
    least = jnp.full_like(total, jnp.inf)
    # Half of the pairs: the others differ in sign.
    pairs = {}
    for c, n in enumerate(normal):
        for k, other in enumerate(normal[: c + 1]):
            pairs[c, k] = _cross(n, other)
            pairs[k, c] = -pairs[c, k]
    # Products of parallel normals cancel to rounding; their contacts share the line.
    together = {
        (c, k): jnp.abs(product) <= 4 * EPSILON * length[c] * length[k]
        for (c, k), product in pairs.items()
    }
    for c, n in enumerate(normal):
        present = length[c] > 0
        n = (jnp.where(present, n[0], 1.0), n[1])
        line = (-n[1], n[0])
        along = [pairs[c, k] for k in range(len(normal))]
        parallel = [together[c, k] for k in range(len(normal))]
        push = _inner(line, load)
        sense = jnp.sign(push)
        resisting = push * 0.0
        sliding = (push * 0.0, push * 0.0)
        own = push * 0.0
        signs = []
        for k, other in enumerate(normal):
            sign = jnp.where(parallel[k], 0.0, sense * jnp.sign(along[k]))
            signs.append(sign)
            friction = sign * limit[k]
            resisting = resisting + jnp.where(parallel[k], 0.0, limit[k] * jnp.abs(along[k]))
            sliding = (sliding[0] + friction * other[0], sliding[1] + friction * other[1])
            share = jnp.where(parallel[k], limit[k] * length[k], 0.0)
            own = own + share / (jnp.abs(n[0]) + jnp.abs(n[1]))

        left = (load[0] - sliding[0], load[1] - sliding[1])
        needed = _inner(n, accelerate(left)) / _inner(n, accelerate(n))
        used = jnp.clip(needed, -own, own)
        slides = accelerate((left[0] - used * n[0], left[1] - used * n[1]))
        inertia = m_xx * line[0] ** 2 + 2 * m_xy * line[0] * line[1] + m_yy * line[1] ** 2
        pace = sense * (jnp.abs(push) - resisting) / inertia
        holds = jnp.abs(needed) < own
        motion = [jnp.where(holds, pace * line[i], slides[i]) for i in range(2)]

        against = push * 0.0
        for k, other in enumerate(normal):
            size = jnp.where(length[k] > 0, length[k], 1.0)
            moves = jnp.where(limit[k] > 0, signs[k], 0.0) * _inner(other, motion) / size
            against = jnp.maximum(against, -moves)
        # Without resistance there are no other contacts, and the candidate is the whole answer.
        outside = present & ((jnp.abs(push) > resisting) | (resisting == 0))
        better = outside & (against < least)
        least = jnp.where(better, against, least)
        best = [jnp.where(better, new, old) for new, old in zip(motion, best, strict=True)]
    # No comparison with NaN holds, so that NaN would look like the dead zone.
    bad = jnp.isnan(determinant + free[0] + free[1] + total)
    return jnp.where(bad, jnp.nan, jnp.stack(best))
