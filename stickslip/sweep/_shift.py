"""Whether XLA shifts a buffer within itself rightly: openxla/xla issue 49176, wrong without a word.

Nothing in this package is written in that way, but a delay line or a history in a user's equations
may be, and its numbers are plausible. So the compiler is asked, once for each jaxlib and machine,
with the trial of the fused executor.
"""

import warnings

import jax
import jax.numpy as jnp
import jaxlib.version


def shift_is_right() -> bool:
    """Whether a shift by one under `jit` gives what the same operations give one by one."""

    def shift(y):
        buffer = y + 1.0
        return buffer.at[1:].set(buffer[:-1])[None]

    with jax.ensure_compile_time_eval():
        y = jnp.arange(16.0)
        return bool(jnp.all(jax.jit(shift)(y) == shift(y)))


def warn_of_wrong_shifts() -> None:
    """`RuntimeWarning` with what to write instead, if this compiler gets the shift wrong."""
    if not shift_is_right():
        warnings.warn(
            f"jaxlib {jaxlib.version.__version__} shifts an array within itself wrongly under jit on "
            "a CPU, without an error: b.at[1:].set(b[:-1]) can hold b[0] everywhere (openxla/xla issue "
            "49176). stickslip does not write this; if your own equations do, write jnp.roll or "
            "jnp.concatenate instead. This is said once for each jaxlib on a machine.",
            RuntimeWarning,
            stacklevel=2,
        )
