"""Programs of single runs, compiled in half the time."""

from collections.abc import Callable
from types import FunctionType
from typing import Any

import jax
import jax.extend

from .._jit_by_code import compiled_by_code
from .._types import Given
from .._validation import check_type, is_concrete
from .executor import current_executor
from .one_call import OLDER

# XLA's emitters of fused kernels take half of the time to compile a run, which is a loop over scalars
# and no faster with them. Newer compilers have no others, and reject the option.
OPTIONS = {"xla_cpu_use_fusion_emitters": False}


_OUTSIDE = jax.extend.core.get_opaque_trace_state()  # of all transformations, where this is imported


def plain_options() -> dict[str, Any] | None:
    """Options of the compiler for a program that stands alone; None where they are not known."""
    plainly = OLDER and jax.default_backend() == "cpu" and not current_executor().fused
    return OPTIONS if plainly else None


def jit_plainly(function: Given[Callable]) -> Callable:
    """`jit_by_code` for a function that computes one run, or a few, not a batch of thousands.

    On a CPU it is compiled with fewer optimisations that such runs do not gain from. Within another
    program, where its arguments are batched or differentiated, and under the fused executor, it is
    compiled as usual.

    >>> import stickslip as ss
    >>> from stickslip.systems import CoulombOscillator, Motion
    >>> @jit_plainly
    ... def reach(speed):
    ...     block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, speed)
    ...     return ss.simulate(block, 0.0, 30.0, Motion(x=0.0, v=speed), "stick").y1.x
    >>> print(f"{reach(0.2):.6f}")
    0.658437

    **Errors** `TypeError` unless `function` is a function.
    """
    check_type("function", function, FunctionType, "a function")

    def options_of(operands: list) -> dict[str, Any] | None:
        outside = jax.extend.core.get_opaque_trace_state() == _OUTSIDE
        return plain_options() if outside and is_concrete(operands) else None

    return compiled_by_code(function, options_of)
