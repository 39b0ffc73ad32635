"""The Illinois root search for the loops in numba, which cannot call one written for JAX.

A bracket is `(low, high, value at low, value at high, side)`, the value positive at `low` and not at
`high`; `side` tells which end moved last.
"""

import functools
from collections.abc import Callable

Bracket = tuple[float, float, float, float, int]


def secant(bracket: Bracket) -> float:
    """Where the line through both ends is zero."""
    low, high, at_low, at_high, _ = bracket
    return (low * at_high - high * at_low) / (at_high - at_low)


def narrow(bracket: Bracket, t: float, value: float) -> Bracket:
    """The bracket with `value` at `t`; an end that stays twice counts half, so that it moves too."""
    low, high, at_low, at_high, side = bracket
    if value <= 0.0:
        return low, t, 0.5 * at_low if side > 0 else at_low, value, 1
    return t, high, value, 0.5 * at_high if side < 0 else at_high, -1


@functools.cache
def compiled() -> tuple[Callable, Callable]:
    """`secant` and `narrow` for functions that numba compiles."""
    import numba  # pyright: ignore[reportMissingImports]

    jit = numba.njit(fastmath=True, inline="always", error_model="numpy")
    return jit(secant), jit(narrow)
