"""The search of `_active_set` under any number of `vmap`: lanes last, in small chunks."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Float

from tests.oracle._active_set import ActiveSet, search

# Lanes searched together on CPU. The working set of a chunk stays in the cache, and a chunk ends with
# its slowest lane, so that small ones waste fewer steps. Measured with 10,000 random problems of 4
# velocities and 8 contacts, chunks of 32, 64, 128, 256 and 10,000 lanes, one core: 9, 6, 8, 10 and 160
# microseconds per lane.
CHUNK = 64


def _in_chunks(max_steps: int, *problem: Float[Array, "..."]) -> ActiveSet:
    """`search` over chunks of lanes one after the other."""
    lanes = problem[0].shape[-1]
    if lanes <= CHUNK:
        return _together(max_steps, *problem)
    count = -(-lanes // CHUNK)

    def split(array):
        # Padded with the last lane: it is well posed and adds no iterations.
        widths = [(0, 0)] * (array.ndim - 1) + [(0, count * CHUNK - lanes)]
        padded = jnp.pad(array, widths, mode="edge")
        return jnp.moveaxis(padded.reshape(*array.shape[:-1], count, CHUNK), -2, 0)

    def join(array):
        array = jnp.moveaxis(array, 0, -2)
        return array.reshape(*array.shape[:-2], count * CHUNK)[..., :lanes]

    chunks = jax.lax.map(lambda chunk: _together(max_steps, *chunk), jax.tree.map(split, problem))
    return jax.tree.map(join, chunks)


def _together(max_steps: int, *problem: Float[Array, "..."]) -> ActiveSet:
    rows: Any = (*problem, max_steps)
    return search(*rows)


@functools.cache
def solver(max_steps: int) -> Callable[..., ActiveSet]:
    """`search` for `(mass_matrix, force, normals, limits)`, each with the lanes, if any, first.

    `vmap` of it is one search over all lanes, in the layout and order that suits the platform.
    """

    @custom_vmap
    def lanes_first(mass_matrix, force, normals, limits):
        lanes = force.shape[:-1]
        problem = [
            jnp.moveaxis(array.reshape(-1, *array.shape[len(lanes) :]), 0, -1)
            for array in (mass_matrix, force, normals, limits)
        ]
        found = jax.lax.platform_dependent(
            *problem,
            cpu=lambda *problem: _in_chunks(max_steps, *problem),
            default=lambda *problem: _together(max_steps, *problem),
        )
        return jax.tree.map(
            lambda array: jnp.moveaxis(array, -1, 0).reshape(*lanes, *array.shape[:-1]), found
        )

    @lanes_first.def_vmap
    def _(axis_size, in_batched, *problem):
        problem = [
            array if batched else jnp.broadcast_to(array, (axis_size, *array.shape))
            for array, batched in zip(problem, in_batched, strict=True)
        ]
        found = lanes_first(*problem)
        return found, jax.tree.map(lambda _: True, found)

    return lanes_first
