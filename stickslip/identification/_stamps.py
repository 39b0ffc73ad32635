"""Whether the stamps of a record keep up with the model, or may be in another unit than seconds."""

import warnings
from typing import Any

import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._validation import is_concrete
from ..hybrid import jit_by_code
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._run import Data, Run, call_with_values
from ._unknown import Unknown
from ._unknowns import NamedValues


@jit_by_code
def _slopes(run: Run, values: NamedValues, data: Data) -> Float[Array, "mode size size"]:
    """Derivatives of the field by the state, where the first record begins, in each mode."""
    values, inputs = run.of_record(values, data, 0)
    begin = data.begin_of(0)
    system = call_with_values("system", run.system, values, inputs)
    row, form = jax.flatten_util.ravel_pytree(run.start(values, inputs))

    def of(mode):
        def field(row):
            return jax.flatten_util.ravel_pytree(system.vector_field(begin, form(row), mode, None))[0]

        return jax.jacfwd(field)(row)

    return jax.lax.map(of, jnp.arange(min(len(system.mode_names), ACCURACY.most_modes)))


def warn_of_wide_stamps(run: Run, unknowns: dict[str, Any], data: Data, times: np.ndarray) -> None:
    """Warn if the model swings `most_swings` times or more from one of `times` [s] to the next.

    Such a record does not show its motion, however right the model. The swing is that of the slowest
    oscillation in any mode, about where the first record begins.
    """
    values = {key: one.start if isinstance(one, Unknown) else one for key, one in unknowns.items()}
    if times.size < 2 or not is_concrete((values, data)):
        return
    found: Any = np.asarray(_slopes(run, values, data))
    found = found[np.all(np.isfinite(found), axis=(1, 2))]
    if not found.size:
        return
    rates = np.linalg.eigvals(found).ravel()
    turning = np.abs(rates.imag)[np.abs(rates.imag) > ENGINE.same * np.abs(rates)]
    spacing = float(np.median(np.diff(times)))
    if not turning.size or spacing * turning.min() < ACCURACY.most_swings * 2.0 * np.pi:
        return
    period = 2.0 * np.pi / turning.min()
    warnings.warn(
        f"records: their times lie {spacing:.3g} s apart, in which the model swings "
        f"{spacing / period:.3g} times at its slowest, {period:.3g} s each. They must be in seconds.",
        UserWarning,
        stacklevel=4,
    )
