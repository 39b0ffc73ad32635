"""Lyapunov exponents of maps."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from .._compiled_once import compiled_once
from .._types import Given
from .._validation import as_float64, check_callable, check_count, refusal
from ._growth import LyapunovSpectrum, accumulate, check_exponents, first_frame, spectrum_of_rates


def lyapunov_spectrum_of_map(
    function: Callable[[PyTree], PyTree],
    z0: PyTree,
    *,
    iterations: Given[int],
    transient: Given[int] = 0,
    warm_up: Given[int | None] = None,
    exponents: Given[int | None] = None,
    blocks: Given[int] = 10,
) -> LyapunovSpectrum:
    r"""Lyapunov exponents of $z_{n+1} = F(z_n)$, per iteration.

    $$\lambda_i = \lim_{n \to \infty} \frac1n \sum_k \ln R^{(k)}_{ii}, \qquad
      DF(z_k)\,Q^{(k-1)} = Q^{(k)} R^{(k)}$$

    **Arguments**

    - `function(z) -> z`: the map, differentiable where the orbit goes; `z` is a pytree of floats. A
      Poincaré map by `simulate` with a terminal section is one.
    - `z0`: start. `transient`: iterations dropped.
    - `iterations`: how many are averaged, `blocks` of them for the error, after `warm_up` (default: a
      tenth).
    - `exponents`: how many, greatest first (default: all).

    **Returns** a `LyapunovSpectrum` with `time` counted in iterations; the exponents of an orbit that
    leaves the finite numbers are NaN, with `status` "failed".

    **Errors** `ValueError`/`TypeError` naming the argument.
    """
    check_callable("function", function, "f(z)", z0)
    z0 = as_float64("z0", z0)
    if not sum(a.size for a in jax.tree.leaves(z0)):
        raise refusal("z0", z0, "a state with at least one component")
    image = jax.eval_shape(function, z0)
    if jax.tree.structure(image) != jax.tree.structure(z0) or not all(
        a.shape == b.shape and jnp.issubdtype(b.dtype, jnp.floating)
        for a, b in zip(jax.tree.leaves(z0), jax.tree.leaves(image), strict=True)
    ):
        raise refusal("function(z)", image, "of floats, with the structure and the shapes of z")
    flat, unravel = ravel_pytree(z0)
    check_count("transient", transient, 0)
    if isinstance(iterations, int) and warm_up is None:
        warm_up = iterations // 10
    count = flat.size if exponents is None else exponents
    check_count("iterations", iterations, 4)
    check_count("warm_up", warm_up, 0)
    check_count("blocks", blocks, 2)
    check_exponents(count, flat.size)
    if iterations < 2 * blocks:
        allowed = f"at least 2 blocks = {2 * blocks}, with blocks = {blocks}"
        raise refusal("iterations", iterations, allowed)

    def flow(flat):
        return ravel_pytree(function(unravel(flat)))[0]

    def step(flat, frame):
        return flow(flat), jax.vmap(lambda c: jax.jvp(flow, (flat,), (c,))[1], 1, 1)(frame)

    def run(flat, transient):
        flat = jax.lax.fori_loop(0, transient, lambda _, flat: flow(flat), flat)
        frame = first_frame(flat.size, count)
        return accumulate(step, flat, frame, count=iterations, warm_up=warm_up)

    flat, local = compiled_once(run, flat, jnp.asarray(transient, jnp.int32))
    # A fixed point of a map is not stick: the exponents of the identity are zero.
    mean, error, status = spectrum_of_rates(local, jnp.zeros((), bool), blocks)
    assert warm_up is not None
    return LyapunovSpectrum(
        exponents=mean,
        error=error,
        local=local,
        time=jnp.arange(1.0, iterations + 1),
        lost=jnp.sum(jnp.isneginf(local), axis=0, dtype=jnp.int32),
        t1=jnp.asarray(float(iterations + warm_up)) + transient,
        y1=unravel(flat),
        status=status,
    )
