"""Several dry contacts at rest at once: which begin to slide, in which sense, how fast."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from stickslip._outcome import in_words
from stickslip._validation import check_count
from stickslip.contact._problem import as_problem
from tests.oracle._active_set import ActiveSet
from tests.oracle._batching import solver
from tests.oracle._constrained import constrained

# Far above the rounding of any well-posed problem, far below an error that matters.
ACCURATE = 1e-10


@in_words
class RESULTS(eqx.Enumeration):
    """Outcome of `resolve`, per lane."""

    successful = ""
    max_steps_reached = (
        "The search for sliding contacts took the `max_steps` of `resolve`; the acceleration is the "
        "last iterate. Give `resolve(max_steps=...)` more; should that not help, report the problem."
    )
    inaccurate = (
        "The search ended, but the acceleration violates the optimality conditions by more than "
        "rounding: see `residual`. Scale the velocities alike, or report the problem."
    )
    mass_matrix_not_positive_definite = (
        "The mass matrix is not positive definite in this lane. Check masses and inertias."
    )
    nonfinite = "The mass matrix, force, normals or limits hold NaN or infinity in this lane."
    negative_limit = "A friction limit is negative in this lane. Limits are mu_s N with mu_s, N >= 0."


class Resolution(eqx.Module):
    """Motion and forces of a body on dry contacts, from `resolve`.

    **Attributes:**

    - `acceleration`: generalised accelerations `a`, shape `[n]`.
    - `contact_acceleration`: `n_c · a`, shape `[m]`; exactly zero where a contact stays at rest.
    - `contact_state`: -1 begins to slide backward, 0 stays at rest, 1 begins to slide forward,
      shape `[m]`. A contact that is not active is already moving: 0, without meaning.
    - `contact_force`: friction `lambda_c` on the body along `n_c`, shape `[m]`: `M a = F + N'
      lambda`. It opposes the motion, `lambda_c = -R_c sign(n_c · a)` where the contact slides, and
      is in `[-R_c, R_c]` where it rests. Where the normals of resting contacts are dependent, many
      forces give the one acceleration; this is an extreme one: contacts strictly inside their
      interval have independent normals. Use `M a - F` where a unique value is needed.
    - `on_kink`: a contact rests with its force at its limit, so that it is about to slide: `a` is
      continuous there but has no derivative; autodiff gives the derivative of one side.
    - `residual`: largest violation of the optimality conditions, relative to `|F|` or to the largest
      friction, whichever is greater, in the metric of the mass matrix; mostly some 1e-16, up to
      1.4e-14 where normals are nearly dependent.
    - `num_steps`: steps of the search.
    - `result`: a [`RESULTS`][] code; where it is not `successful` because of bad input, all numbers
      are NaN.
    """

    acceleration: Float[Array, " n"]
    contact_acceleration: Float[Array, " m"]
    contact_state: Int[Array, " m"]
    contact_force: Float[Array, " m"]
    on_kink: Bool[Array, ""]
    residual: Float[Array, ""]
    num_steps: Int[Array, ""]
    result: RESULTS  # pyright: ignore[reportInvalidTypeForm]

    @property
    def converged(self) -> Bool[Array, "..."]:
        """Whether the result is `successful`."""
        return self.result == RESULTS.successful


def _flat(array: Array) -> Array | np.ndarray:
    """Zero tangent of an output that has no derivative."""
    if jnp.issubdtype(array.dtype, jnp.floating):
        return jnp.zeros_like(array)
    return np.zeros(array.shape, jax.dtypes.float0)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _solve(max_steps, mass_matrix, force, normals, limits) -> ActiveSet:
    return solver(max_steps)(mass_matrix, force, normals, limits)


@_solve.defjvp
def _solve_jvp(max_steps, problem, tangents):
    """The tangent solves the same problem with the active set fixed and the input tangents as forces.

    Differentiating `M a = F + N' lambda` and `n_c · a = 0` with the active set fixed, which it is
    almost everywhere, gives a problem for `da` and `dlambda` that `hold` solves; so it is linear,
    may be transposed, and may be differentiated again.
    """
    mass_matrix, force, normals, limits = problem
    d_mass_matrix, d_force, d_normals, d_limits = tangents
    found = _solve(max_steps, mass_matrix, force, normals, limits)
    a, friction = found.acceleration, found.force
    sliding = found.side.astype(limits.dtype) * d_limits
    load = (
        d_force
        - d_mass_matrix @ a
        + jnp.sum(d_normals * friction[:, None], axis=0)
        + jnp.sum(normals * sliding[:, None], axis=0)
    )
    motion = constrained(mass_matrix, load, normals, found.held, -(d_normals @ a))
    flat = jax.tree.map(_flat, found)
    return found, flat._replace(
        acceleration=motion.acceleration,
        force=jnp.where(found.held, motion.contact_force, sliding),
    )


@eqx.filter_jit
def _resolve(mass_matrix, force, normals, limits, active, max_steps: int) -> Resolution:
    bounds = jnp.where(active, limits, 0.0)
    found = _solve(max_steps, mass_matrix, force, normals, bounds)
    contact_acceleration = jnp.where(found.at_rest, 0.0, normals @ found.acceleration)
    state = jnp.where(active, jnp.sign(contact_acceleration), 0.0).astype(jnp.int32)

    inputs = (mass_matrix, force, normals, bounds)
    finite = jnp.all(jnp.array([jnp.all(jnp.isfinite(x)) for x in inputs]))
    positive = jnp.all(jnp.isfinite(found.acceleration))
    allowed = jnp.all(bounds >= 0)
    result = RESULTS.successful
    result = RESULTS.where(found.residual > ACCURATE, RESULTS.inaccurate, result)
    result = RESULTS.where(found.settled, result, RESULTS.max_steps_reached)
    result = RESULTS.where(positive, result, RESULTS.mass_matrix_not_positive_definite)
    result = RESULTS.where(allowed, result, RESULTS.negative_limit)
    result = RESULTS.where(finite, result, RESULTS.nonfinite)
    good = finite & positive & allowed

    def loud(value):
        return jnp.where(good, value, jnp.nan)

    return Resolution(
        loud(found.acceleration),
        loud(contact_acceleration),
        jnp.where(good, state, 0),
        loud(found.force),
        found.on_kink,
        loud(found.residual),
        found.steps,
        result,
    )


def resolve(
    mass_matrix: ArrayLike,
    force: ArrayLike,
    normals: ArrayLike,
    limits: ArrayLike,
    *,
    active: ArrayLike | None = None,
    max_steps: int = 128,
) -> Resolution:
    r"""Acceleration of a body on dry contacts at rest, and what each contact does.

    $$a = \arg\min_a \; \tfrac12 a^T M a - a^T F + \sum_{c\ \text{active}} R_c\, |n_c \cdot a|$$

    This is Gauss' principle of least constraint with Coulomb's set of static forces. The function
    is strictly convex, so `a` is unique for any normals, even where the friction forces are not; it
    is continuous and piecewise linear in `F` and `R`. One contact on one axis gives `dead_zone`.

    The answer is exact to rounding: an active-set search that ends after finitely many steps finds
    which contacts hold, and one linear problem gives the motion (`_active_set` says how). For a few
    velocities and contacts (say n <= 6, m <= 8), fixed shapes; one problem a call, batched by
    `jax.vmap`, which searches all lanes together. Derivatives, forward and reverse and of any
    order, are those of the linear problem; `on_kink` marks where there is none. Derivatives by
    `normals` presume that dependent normals at rest stay dependent.

    **Arguments:**

    - `mass_matrix`: `M`, symmetric positive definite, shape `[n, n]` (kg, kg m² ... by velocity). A
      traced one is made symmetric.
    - `force`: `F`, applied forces and kinetic friction of the moving contacts, shape `[n]` (N, N m
      ...).
    - `normals`: `n_c`, one row per contact, shape `[m, n]`; `n_c · v` is the sliding velocity. They
      may be dependent, repeated or zero.
    - `limits`: greatest static friction `R_c = mu_s N_c >= 0`, shape `[m]`, in the unit that goes
      with `n_c · a` (N, N m).
    - `active`: which contacts are at rest, booleans of shape `[m]`; all if not given. The others
      contribute nothing: put their kinetic friction into `force`.
    - `max_steps`: bound on the steps of the search, some three per contact in the worst random
      problems.

    **Returns:** a [`Resolution`][].

    **Raises:** `ValueError` naming the argument, its value and what is allowed, before anything is
    compiled: wrong shapes, values not finite, a mass matrix that is not symmetric positive
    definite, negative limits. Traced values pass unread and end in a code in `result`.

    !!! example

        Two rails and a diagonal contact; the load overcomes the second rail only:

        >>> import jax.numpy as jnp
        >>> from tests.oracle import resolve
        >>> normals = jnp.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
        >>> motion = resolve(jnp.eye(2), jnp.array([0.5, 4.0]), normals, jnp.array([2.0, 1.0, 1.0]))
        >>> print(motion.acceleration, motion.contact_state)
        [0. 2.] [0 1 1]

    Source: C. F. Gauss (1829); J. J. Moreau (1966, 1988), "Unilateral contact and dry friction in
    finite freedom dynamics"; C. Glocker (2001), "Set-Valued Force Laws", on the principle with such
    sets. On one axis: Eqs. (28)-(30) of the paper on the CoreXY mechanism.
    """
    check_count("max_steps", max_steps, 1)
    problem = as_problem(mass_matrix, force, normals, limits, active)
    return _resolve(
        problem.mass_matrix,
        problem.force,
        problem.normals,
        problem.limits,
        problem.active,
        max_steps,
    )
