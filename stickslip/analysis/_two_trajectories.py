"""The greatest Lyapunov exponent from the distance of two motions."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from .._compiled_once import compiled_once
from .._show import amount, number
from .._types import Given, Mode, Numeric
from .._validation import as_parameter, check_flag, check_type, is_concrete, one_number
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import a_time, the_system
from ..hybrid.longest_step import spanning
from ..hybrid.system import mode_type
from ._accuracy import ACCURACY
from ._arguments import an_integrator, start_of
from ._growth import mean_and_error
from ._lyapunov import moving_components
from ._recording import Segments

SEPARATION_STATUS = ("ok", "failed", "merged", "saturated")


class Separation(eqx.Module):
    r"""Distance of two motions and the exponent it gives.

    - `exponent` [1/s] and `error` [1/s] (see `LyapunovSpectrum.error`; NaN without renormalisation,
      which leaves one number and nothing to average). The exponent is NaN unless `status` is 0.
    - `time` [s] and `running` [1/s], `[segment]`: $\ln(\Delta(t)/\Delta(0))/t$ as it develops.
    - `distance`, `[segment]`: $\Delta(t)$ in the units of the state.
    - `successful`: whether both motions reached the end.
    - `status` and `words` for it: 0 "ok"; 1 "failed", a motion ended early or is not finite; 2
      "merged", the distance fell to zero or to rounding (64 units in the last place of the state),
      so that what is left is noise; 3 "saturated", it grew beyond a tenth of the size of the motion,
      where it is not small. `running` and `distance` are given as they came out.
    """

    exponent: Float[Array, "*batch"]
    error: Float[Array, "*batch"]
    time: Float[Array, "*batch segment"]
    running: Float[Array, "*batch segment"]
    distance: Float[Array, "*batch segment"]
    successful: Bool[Array, "*batch"]
    status: Int[Array, "*batch"]

    def __repr__(self) -> str:
        if not is_concrete(self):
            return f"Separation(traced, of shape {self.exponent.shape})"
        if np.ndim(self.exponent):
            return f"Separation: {amount(np.size(self.exponent), 'pair')} of motions"
        value = f"{float(self.exponent):+.6g} +- {float(self.error):.2g} 1/s"
        return f"Separation: {value} to {number(self.time[-1])} s ({self.words})"

    @property
    def words(self) -> Any:
        """`status` in words, as a NumPy array of texts."""
        return np.asarray(SEPARATION_STATUS)[np.asarray(self.status)]


def two_trajectory_exponent(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    record: Given[Segments],
    *,
    distance: Numeric = 1e-8,
    renormalise: Given[bool] = True,
    components: Given[Sequence[str] | None] = None,
    mode0: Mode | None = None,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
) -> Separation:
    r"""Greatest Lyapunov exponent by its definition with two motions,

    $$\Lambda = \lim_{t \to \infty}\lim_{\Delta(0) \to 0} \frac1t \ln\frac{\Delta(t)}{\Delta(0)}
      \tag{2.25}$$

    with the Euclidean distance $\Delta$ of the states. For comparison: `lyapunov_spectrum` takes the
    limit $\Delta(0) \to 0$ exactly and needs no small number.

    **Arguments** as for `lyapunov_spectrum`, and

    - `distance`: $\Delta(0)$, in the units of the state; spread evenly over `components`.
    - `renormalise`: set the distance back to $\Delta(0)$ after each segment (Benettin et al. 1976).
      With `False`, Eq. (2.25) to the letter: the distance saturates at the size of the attractor, so
      that any bounded motion comes out as $\Lambda \to 0$ from above as $t$ grows. The last value of
      `running` shows it; `exponent` is then NaN.

    **Returns** a `Separation`, whose `status` says whether the distance stayed where it is meaningful
    something. The size of the motion is the norm of the half ranges of its components, over the ends
    of all segments.
    **Errors** `ValueError`/`TypeError` naming the argument.

    ??? cite "Reference"

        *Non-linear Dynamics of Jointed Systems Under Dry Friction Forces*, Eq. (2.25).
    """
    the_system(system)
    integrator = an_integrator(integrator)
    check_type("record", record, Segments, "a Segments(length, count)")
    distance = as_parameter(one_number("distance", distance, "positive"))
    check_flag("renormalise", renormalise)
    if not renormalise and record.warm_up is None:
        # The distance is measured from the beginning.
        record = dataclasses.replace(record, warm_up=0)
    segment, segments, warm_up = as_parameter(record.length), record.count, record.warm_up_count
    transient, t0 = record.transient, a_time("t0", record.t0)
    y0, mode = start_of(system, t0, y0, mode0, args)
    moving = moving_components(y0, components)
    flat, unravel = ravel_pytree(y0)

    whole = transient + segment * (segments + warm_up)
    integrator = spanning(integrator, whole)

    def run(begin, end, flat, mode):
        solution = simulate(
            system, begin, end, unravel(flat), mode, args,
            integrator=integrator, saveat=SaveAt(max_events=None), throw=False,
        )  # fmt: skip
        return ravel_pytree(solution.y1)[0], solution.mode1, solution.successful

    good = jnp.ones((), bool)
    begin = t0
    if not (isinstance(transient, int | float) and transient == 0):
        begin = t0 + transient
        flat, mode, good = run(t0, begin, flat, mode)

    def mode_of(t, flat):
        return jnp.asarray(system.initial_mode(t, unravel(flat), args), mode_type(system))

    gap = jnp.asarray(moving, jnp.float64) * (distance / float(moving.sum()) ** 0.5)
    other = flat + gap

    def step(carry, number):
        pair, modes, good, before, low, high = carry
        start, end = begin + segment * number, begin + segment * (number + 1.0)
        # Both in one batch: one program.
        pair, modes, well = jax.vmap(lambda f, m: run(start, end, f, m))(pair, modes)
        gap = pair[1] - pair[0]
        now = jnp.sqrt(jnp.sum(gap * gap))
        kept = jnp.where(now > 0, now, distance)
        growth = jnp.log(now / before)
        if renormalise:
            pair = pair.at[1].set(pair[0] + gap * (distance / kept))
            modes = modes.at[1].set(mode_of(end, pair[1]))
        after = distance if renormalise else kept
        low, high = jnp.minimum(low, pair[0]), jnp.maximum(high, pair[0])
        noise = ENGINE.some_roundings * jnp.sqrt(jnp.sum(pair[0] * pair[0]))
        return (pair, modes, good & jnp.all(well), after, low, high), (growth, now, now <= noise)

    numbers = jnp.arange(segments + warm_up, dtype=jnp.float64)
    modes = jnp.stack([mode, mode_of(begin, other)])
    carry = (jnp.stack([flat, other]), modes, good, distance, flat, flat)
    carry, (growth, apart, merged) = compiled_once(lambda *a: jax.lax.scan(step, *a), carry, numbers)
    _, _, good, _, low, high = carry
    local = jnp.where(good, growth[warm_up:] / segment, jnp.nan)[:, None]
    mean, error = mean_and_error(local, record.blocks)
    size = 0.5 * jnp.sqrt(jnp.sum((high - low) ** 2))
    status = jnp.zeros((), jnp.int32)
    for word, applies in (
        ("saturated", jnp.any((apart > ACCURACY.small * size) & (apart > distance))),
        ("merged", jnp.any(merged)),
        ("failed", ~good | ~jnp.all(jnp.isfinite(apart))),
    ):
        status = jnp.where(applies, SEPARATION_STATUS.index(word), status)
    told = status == 0
    steps = jnp.arange(1.0, segments + 1)
    return Separation(
        exponent=jnp.where(told, mean[0], jnp.nan),
        error=jnp.where(told, error[0], jnp.nan) if renormalise else jnp.full_like(error[0], jnp.nan),
        time=segment * steps,
        running=jnp.cumsum(local[:, 0]) / steps,
        distance=apart[warm_up:],
        successful=good,
        status=status,
    )
