"""Lyapunov exponents of maps."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from .._compiled_once import compiled_once
from .._types import Given
from .._validation import as_float64, check_callable, check_type, one_concrete, refusal
from ._growth import LyapunovSpectrum, accumulate, check_exponents, first_frame, spectrum_of_rates
from ._recording import Segments


def lyapunov_spectrum_of_map(
    function: Callable[[PyTree], PyTree],
    z0: PyTree,
    record: Given[Segments],
    *,
    exponents: Given[int | None] = None,
) -> LyapunovSpectrum:
    r"""Lyapunov exponents of $z_{n+1} = F(z_n)$, per iteration.

    $$\lambda_i = \lim_{n \to \infty} \frac1n \sum_k \ln R^{(k)}_{ii}, \qquad
      DF(z_k)\,Q^{(k-1)} = Q^{(k)} R^{(k)}$$

    **Arguments**

    - `function(z) -> z`: the map, differentiable where the orbit goes; `z` is a pytree of floats. A
      Poincaré map by `simulate` with a terminal section is one.
    - `z0`: start.
    - `record`: `Segments(length, count, transient, warm_up, blocks, t0)`, all times counted in
      iterations: `Segments(1, 4000)` averages 4,000 of them, with a factorisation after each.
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
    check_type("record", record, Segments, "a Segments(length, count)")
    length, transient, begin = (
        _iterations(f"record.{name}", getattr(record, name)) for name in ("length", "transient", "t0")
    )
    segments, warm_up = record.count, record.warm_up_count
    count = flat.size if exponents is None else exponents
    check_exponents(count, flat.size)

    def once(flat):
        return ravel_pytree(function(unravel(flat)))[0]

    def flow(flat):
        return once(flat) if length == 1 else jax.lax.fori_loop(0, length, lambda _, z: once(z), flat)

    def step(flat, frame):
        return flow(flat), jax.vmap(lambda c: jax.jvp(flow, (flat,), (c,))[1], 1, 1)(frame)

    def run(flat, transient):
        flat = jax.lax.fori_loop(0, transient, lambda _, flat: once(flat), flat)
        frame = first_frame(flat.size, count)
        return accumulate(step, flat, frame, count=segments, warm_up=warm_up)

    flat, growth = compiled_once(run, flat, jnp.asarray(transient, jnp.int32))
    local = growth / length
    # A fixed point of a map is not stick: the exponents of the identity are zero.
    mean, error, status = spectrum_of_rates(local, jnp.zeros((), bool), record.blocks)
    return LyapunovSpectrum(
        exponents=mean,
        error=error,
        local=local,
        time=length * jnp.arange(1.0, segments + 1),
        lost=jnp.sum(jnp.isneginf(local), axis=0, dtype=jnp.int32),
        t1=jnp.asarray(float(begin + transient + length * (segments + warm_up))),
        y1=unravel(flat),
        status=status,
    )


def _iterations(name: str, value: Any) -> int:
    """A time of a map, which is a number of iterations."""
    number = float(one_concrete(name, value))
    if number != int(number):
        raise refusal(name, value, "a whole number of iterations")
    return int(number)
