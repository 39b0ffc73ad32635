"""Which contacts hold, which slide: the search, for many lanes at once.

In the metric of the mass matrix (`M = L L'`, `b = L' a`, `f = L^-1 F`, `p_c = L^-1 n_c`) the
problem of `resolve` is the projection of `f` on the zonotope of the friction forces,

    min 1/2 |b|^2   with   b = f + sum_c lambda_c p_c ,   |lambda_c| <= R_c ,

a least-squares problem with bounds. It is solved by the active-set method of Stark and Parker
(1995), "Bounded-variable least-squares", the bounded form of Lawson and Hanson's NNLS. A contact is
*free* (holds, `lambda_c` to be found), at a *bound* (slides), or *parked* (not needed so far,
`lambda_c = 0`):

1. Solve for the free contacts. If one leaves its interval, go as far as allowed and put it at its
   bound.
2. Otherwise release the contact, parked or bound, that moves most with its friction; end if none
   does.

A released contact is never a combination of the free ones, for these do not move: the free normals
stay linearly independent, so dependent or repeated normals need no special case. The objective
falls strictly between two sets of bounds, so none returns and the search ends; what is left is one
linear problem, solved directly. Lengths are relative to `|f|`, the forces enter only through sums
that stay of that order, and the free part is eliminated by an orthogonal basis, so the result is
good to rounding.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from tests.oracle._linear_algebra import (
    cholesky,
    combine,
    dots,
    gram_schmidt,
    reject,
    safe_norm,
    solve_lower,
    solve_upper,
)

EPSILON = float(jnp.finfo(jnp.float64).eps)
# A contact that moves less than this, relative to the acceleration without friction, is not
# released.
RELEASE = 64 * EPSILON
# At rest, for the reported states: above the errors that an ill-conditioned mass matrix leaves.
REST = 1024 * EPSILON
# Distances below this are rounding, not a direction.
ROUNDING = 4 * EPSILON
# Normals closer to dependence than this (sine of the angle) count as dependent.
DEPENDENT = EPSILON ** (2 / 3)


class ActiveSet(NamedTuple):
    """Solution of one problem, or of many with the lanes on the trailing axes."""

    acceleration: Float[Array, "n *lanes"]
    force: Float[Array, "m *lanes"]  # lambda
    held: Bool[Array, "m *lanes"]  # independent contacts whose force is found by the constraint
    side: Int[Array, "m *lanes"]  # the bound, -1 or 1, that the force of another contact has reached
    at_rest: Bool[Array, "m *lanes"]
    on_kink: Bool[Array, "*lanes"]
    residual: Float[Array, "*lanes"]
    steps: Int[Array, "*lanes"]
    settled: Bool[Array, "*lanes"]


class _Search(NamedTuple):
    basis: Float[Array, "m n lane"]  # orthonormal, of the contacts that were free
    force: Float[Array, "m lane"]
    side: Float[Array, "m lane"]
    free: Bool[Array, "m lane"]
    steps: Int[Array, " lane"]
    settled: Bool[Array, " lane"]


def _sweep(pull, rows, limits) -> _Search:
    """First guess: one pass over the contacts, each taking what it can; the sliding ones stay."""
    rest, force, side = pull, [], []
    for row, limit in zip(rows, limits, strict=True):
        moved = jnp.sum(row * rest, axis=0)
        taken = -jnp.clip(moved, -limit, limit)
        rest = rest + taken[None] * row
        slides = (jnp.abs(moved) >= limit) & (limit > 0)
        force.append(jnp.where(slides, taken, 0.0))
        side.append(jnp.where(slides, jnp.sign(taken), 0.0))
    lanes = limits.shape[1:]
    return _Search(
        jnp.zeros_like(rows),
        jnp.stack(force),
        jnp.stack(side),
        jnp.zeros(limits.shape, bool),
        jnp.zeros(lanes, jnp.int32),
        jnp.zeros(lanes, bool),
    )


def _advance(now: _Search, pull, rows, limits) -> _Search:
    """One step of the search in every lane that has not settled."""
    contact = jnp.arange(rows.shape[0])[:, None]
    basis = gram_schmidt(rows, now.free, ROUNDING)
    loaded = pull + combine(rows, jnp.where(now.free, 0.0, now.force))
    target = jnp.where(now.free, -basis.weights(dots(basis.q, loaded)), now.force)

    change = target - now.force
    # A target within rounding of its bound counts as there: a free contact is strictly inside.
    leaves = now.free & (jnp.abs(target) >= limits - ROUNDING * (1 + limits))
    bound = jnp.where(target > 0, limits, -limits)
    share = (bound - now.force) / jnp.where(change == 0, 1.0, change)
    share = jnp.where(leaves, jnp.clip(share, 0.0, 1.0), 2.0)
    smallest = jnp.min(share, axis=0)
    blocked = smallest <= 1.0
    stopped = (contact == jnp.argmin(share, axis=0, keepdims=True)) & blocked[None]
    force = now.force + jnp.where(now.free, jnp.minimum(smallest, 1.0)[None] * change, 0.0)
    force = jnp.where(stopped, bound, force)
    side = jnp.where(stopped, jnp.sign(bound), now.side)
    free = now.free & ~stopped

    moved = dots(rows, reject(basis.q, loaded))
    # At a bound friction must oppose the motion; a parked contact must not move at all.
    against = jnp.where(now.side == 0, jnp.abs(moved), now.side * moved)
    against = jnp.where(now.free | (limits <= 0), -1.0, against)
    release = ~blocked & (jnp.max(against, axis=0) > RELEASE)
    released = (contact == jnp.argmax(against, axis=0, keepdims=True)) & release[None]

    active = ~now.settled
    return _Search(
        jnp.where(active[None, None], basis.q, now.basis),
        jnp.where(active[None], force, now.force),
        jnp.where(active[None], jnp.where(released, 0.0, side), now.side),
        jnp.where(active[None], free | released, now.free),
        now.steps + active.astype(jnp.int32),
        now.settled | ~(blocked | release),
    )


def _apart(rows, basis):
    """Parts of the rows outside a basis; once, since only their rough size counts."""
    return jnp.stack([row - combine(basis, dots(basis, row)) for row in rows])


def _complete(basis, rows, parked):
    """Parked contacts that make the free ones a basis of all that hold; parts of `rows` outside it.

    A parked contact is at rest without force, well inside its limits: it holds, too. That changes
    no value, but the derivative has to know. In most problems every parked contact is a combination
    of free ones, and the loop ends before its first step.
    """
    contact = jnp.arange(rows.shape[0])[:, None]

    def distances(state):
        added, outside = state
        return jnp.where(parked & ~added, safe_norm(outside, axis=1), 0.0)

    def add(state):
        added, outside = state
        distance = distances(state)
        largest = jnp.max(distance, axis=0)
        hit = (contact == jnp.argmax(distance, axis=0, keepdims=True)) & (largest > DEPENDENT)[None]
        direction = jnp.sum(jnp.where(hit[:, None], outside, 0.0), axis=0)
        direction = direction / jnp.where(largest > DEPENDENT, largest, 1.0)[None]
        return added | hit, _apart(outside, direction[None])

    def incomplete(state):
        return jnp.any(distances(state) > DEPENDENT)

    return jax.lax.while_loop(incomplete, add, (jnp.zeros_like(parked), _apart(rows, basis)))


def search(
    mass_matrix: Float[Array, "n n lane"],
    force: Float[Array, "n lane"],
    normals: Float[Array, "m n lane"],
    limits: Float[Array, "m lane"],
    max_steps: int,
) -> ActiveSet:
    """Solve the problem of `resolve` in every lane."""
    size = force.shape[0]
    factor = cholesky(mass_matrix)
    reduced = solve_lower(factor, jnp.concatenate([force[:, None], normals.swapaxes(0, 1)], axis=1))
    pull, normal = reduced[:, 0], reduced[:, 1:].swapaxes(0, 1)
    length = safe_norm(normal, axis=1)
    length = jnp.where(length > 0, length, 1.0)
    scale = safe_norm(pull, axis=0)
    scale = jnp.where(scale > 0, scale, 1.0)
    pull, rows = pull / scale[None], normal / length[:, None]
    present = (limits > 0) & jnp.any(normals != 0, axis=1)
    bounds = jnp.where(present, limits * length / scale[None], 0.0)

    def unfinished(state):
        number, found = state
        return (number < max_steps) & ~jnp.all(found.settled)

    def step(state):
        number, found = state
        return number + 1, _advance(found, pull, rows, bounds)

    _, found = jax.lax.while_loop(unfinished, step, (0, _sweep(pull, rows, bounds)))

    parked = present & ~found.free & (found.side == 0)
    added, outside = _complete(found.basis, rows, parked)
    held = found.free | added
    moved_body = reject(found.basis, pull + combine(rows, jnp.where(found.free, 0.0, found.force)))
    moved_body = jnp.where((jnp.sum(held, axis=0) >= size)[None], 0.0, moved_body)
    moved = dots(rows, moved_body)
    at_rest = held | (jnp.abs(moved) <= REST)
    about_to_slide = present & ~held & (found.side != 0) & at_rest
    on_kink = jnp.any(about_to_slide & (safe_norm(outside, axis=1) > DEPENDENT), axis=0)

    acceleration = solve_upper(factor, moved_body * scale[None])
    natural = found.force - jnp.clip(found.force - moved, -bounds, bounds)
    balance = moved_body - pull - combine(rows, found.force)
    residual = jnp.maximum(jnp.max(jnp.abs(natural), axis=0), safe_norm(balance, axis=0))
    # Nearly dependent contacts can press against each other with forces far above the load.
    residual = residual / jnp.maximum(1.0, jnp.max(jnp.abs(found.force), axis=0))
    return ActiveSet(
        acceleration,
        # A sliding contact has its limit exactly.
        jnp.where(held, found.force * scale[None] / length, found.side * limits),
        held,
        jnp.where(held, 0.0, found.side).astype(jnp.int32),
        at_rest,
        on_kink,
        residual,
        found.steps,
        found.settled,
    )
