"""The error of runs that fail, which keeps what they computed."""

from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._outcome import names_of, tally
from .._types import Given
from .._validation import is_concrete, refusal, shape_refusal

ResultT = TypeVar("ResultT")


class SimulationError(RuntimeError):
    """A run failed, or some runs of many.

    - `solution`: what was computed until then, as it is returned with `throw=False`.

    The message says what happened and what to do. Where numbers are traced, as within `jax.jit`, no
    solution is there to keep: `equinox.EquinoxRuntimeError` is raised when the program runs.
    """

    def __init__(self, message: Given[str], solution: Any = None):
        super().__init__(message)
        self.solution = solution


def raise_failures(solution: ResultT, successful: Given[bool | np.ndarray | jax.Array]) -> ResultT:
    """`solution`, or the error of its `result` where a lane of it was not `successful`.

    For functions that are built on `simulate`: to be called outside of its jit, with what
    was found inside. Under a transformation the error is raised when the program runs.

    Errors: `SimulationError` for a lane that failed; `TypeError` for a `solution` that has no
    `result`, and for flags that are not booleans; `ValueError` for flags of another shape.
    """
    if not isinstance(solution, eqx.Module) or not hasattr(solution, "result"):
        raise refusal("solution", solution, "a module with a field `result` of RESULTS", TypeError)
    array = isinstance(successful, np.ndarray | jax.Array) and successful.dtype == np.bool_
    if not (array or isinstance(successful, bool)):
        raise refusal("successful", successful, "True or False, or an array of them", TypeError)
    result: Any = solution
    lanes = np.shape(result.result._value)
    if np.shape(successful) not in ((), lanes):
        raise shape_refusal(
            "successful", successful, f"one flag, or of the shape of the results, {lanes}"
        )
    if is_concrete((successful, result.result)):
        if np.asarray(successful).all():
            return solution
        raise SimulationError(_message(result, np.asarray(successful)), solution)
    return result.result.error_if(solution, ~jnp.asarray(successful))


def _message(solution: Any, successful: np.ndarray) -> str:
    """Causes and times of failure of the run, or of the lanes that failed."""
    names = names_of(solution.result)
    names, successful = np.broadcast_arrays(names, successful)
    failed = names[~successful]
    enumeration = solution.result._enumeration
    texts = {name: enumeration[getattr(enumeration, name)] for name in tally(failed)}
    # The caller knows of a failure that the result does not.
    texts = {name: text or "the caller says that it failed" for name, text in texts.items()}
    if successful.ndim == 0:
        (name,) = texts
        end = getattr(solution, "t1", None)
        when = "" if end is None or np.ndim(end) else f" (the run got to t = {float(end):.6g} s)"
        return f"{name}{when}: {texts[name]}"
    counts = tally(failed)
    head = f"{failed.size:,} of {successful.size:,} runs failed"
    return "\n".join([f"{head}:", *(f"  {counts[k]:,} {k}: {text}" for k, text in texts.items())])
