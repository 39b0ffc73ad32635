"""Corrections of a motion by what was measured on its way, and the residuals that they leave."""

import abc
import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._argument_checks import callable_as, check_arguments
from .._types import Given
from .._validation import as_float64
from ..estimation import Gaussian, Noise, kalman_filter
from ..hybrid import Integrator, WithBreaks
from ..hybrid.longest_step import spanning
from ._run import Run, SystemOf, call_with_values
from ._unknowns import NamedValues


class AbstractCorrection(eqx.Module):
    """How the motion of a `Problem` is corrected from stamp to stamp.

    `kinds`: how many rows there are for each datum; the first is its residual.
    """

    kinds: ClassVar[int] = 1

    @abc.abstractmethod
    def rows(
        self, run: Run, values: NamedValues, one: tuple, measured: Array, present: Array, sd: Array
    ) -> Float[Array, "kind observed time"]:
        """Residuals of one record in standard deviations, and behind them rows of other kinds."""


class Observer(AbstractCorrection):
    """A function of values, state and innovations."""

    correct: Callable[..., Any] = eqx.field(static=True)

    def rows(self, run, values, one, measured, present, sd):
        times, begin, inputs = one
        system, breaks = run.system_of(values, inputs)
        ts = run.times_of(values, times, begin)
        # From stamp to stamp the motion is bounded in its steps by the record, as it is in one go.
        integrator = Integrator() if run.integrator is None else run.integrator
        stepping = dataclasses.replace(run, integrator=spanning(integrator, ts[-1] - begin))

        def onwards(now, stamp):
            since, y = now
            t, seen, here = stamp
            states, _ = stepping.motion(system, breaks, y, since, t[None])
            row = run.observe(system, t[None], states)[:, 0]
            off = jnp.where(here, seen - row, 0.0)
            before = jax.tree.map(lambda a: a[0], states)
            names = [name for name, _ in run.observed]
            after = self.correct(values, before, {name: off[i] for i, name in enumerate(names)})
            after = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), after)
            # A stamp that is repeated makes records equally long, and corrects nothing again.
            after = jax.tree.map(lambda new, old: jnp.where(t > since, new, old), after, before)
            return (t, after), row

        first = jnp.asarray(begin, ts.dtype), run.start(values, inputs)
        _, rows = jax.lax.scan(onwards, first, (ts, measured.T, present.T))
        return ((rows.T - measured) / sd[:, None])[None]


@check_arguments(
    process=callable_as("f(values, inputs)", {}, {}), spread=callable_as("f(values, inputs)", {}, {})
)
class KalmanFilter(AbstractCorrection):
    r"""Correction by `stickslip.estimation.kalman_filter`: the fit maximises its likelihood.

    For records that drift: a force that wanders, an encoder's offset, a start that is not known are
    states of the system, and how fast they wander is an unknown like any other. With innovations
    $\nu_i$, one after the other within a stamp, and their standard deviations $s_i$,

    $$-2\ln L = \sum_i \nu_i^2/s_i^2 + 2\ln s_i + \ln 2\pi.$$

    The residuals of the data are $-\nu_i/s_i$. The logarithms are two further rows for each value: the
    involute of a circle, $(\cos w + w\sin w,\ \sin w - w\cos w)$ with $w^2 = 2\ln(s_i/\sigma_i)$,
    has the square $1 + w^2$ and goes as far as $\ln s_i$ does. So half the sum of squares is $-\ln L$
    but for a constant, and $J^TJ$ the information of Fisher (with the innovations in place of their
    expectation): methods, intervals, profiles and posteriors are those of any fit.

    **Arguments**

    - `process(values, inputs)`: a state of densities, as `Noise.process`.
    - `spread(values, inputs)`: a state of standard deviations of that in which a record begins,
      independent, as of `Gaussian`; its mean is `initial_state` of the `Problem`.

    The noise of what is measured is $\sigma_i$, the `sd` of each `Observed`. `Problem.predict` and
    `score` are of the motion that is never corrected: their bands know of no wandering. **Raises**
    `TypeError`, `ValueError` for anything else.
    """

    kinds: ClassVar[int] = 3
    process: Given[SystemOf] = eqx.field(static=True)
    spread: Given[SystemOf] = eqx.field(static=True)

    def rows(self, run, values, one, measured, present, sd):
        times, begin, inputs = one
        system, breaks = run.system_of(values, inputs)
        ts = run.times_of(values, times, begin)
        y0 = run.start(values, inputs)
        process, spread = (
            as_float64(name, call_with_values(name, function, values, inputs))
            for name, function in (("process", self.process), ("spread", self.spread))
        )
        whole = system
        if breaks is not None:
            whole = WithBreaks(system, breaks)
            y0 = whole.start(y0, begin)
            still = jax.tree.map(jnp.zeros_like, y0)
            process, spread = (eqx.tree_at(lambda y: y.y, still, part) for part in (process, spread))

        def measure(_, t, y, mode, args):
            y = y if breaks is None else y.y
            return {name: observe(t, y, system) for name, observe in run.observed}

        names = [name for name, _ in run.observed]
        seen = jnp.where(present, measured, jnp.nan)
        noise = Noise({name: sd[i] for i, name in enumerate(names)}, process)
        found = kalman_filter(
            whole, jnp.asarray(begin, ts.dtype), Gaussian(y0, spread), ts,
            {name: seen[i] for i, name in enumerate(names)}, measure, noise, integrator=run.integrator,
        )  # fmt: skip
        order = jnp.asarray([found.names.index(name) for name in names])
        lower = jnp.linalg.cholesky(found.innovation_covariances[:, order][:, :, order])
        off = jnp.where(present.T, found.innovations[:, order], 0.0)
        white = jax.scipy.linalg.solve_triangular(lower, off[..., None], lower=True)[..., 0]
        ratio = jnp.log(jnp.diagonal(lower, axis1=1, axis2=2) / sd[None, :])
        # A run that fails has a likelihood of 0.
        white = jnp.where(jnp.isfinite(found.log_likelihood), -white, jnp.nan)
        return jnp.stack([white.T, *involute(ratio.T)])


@jax.custom_jvp
def involute(arc: Array) -> tuple[Array, Array]:
    """Point of the involute of the unit circle at a length `arc` from its cusp, 0 below that."""
    w = jnp.sqrt(2.0 * jnp.maximum(arc, 0.0))
    return jnp.cos(w) + w * jnp.sin(w), jnp.sin(w) - w * jnp.cos(w)


@involute.defjvp
def _involute_slope(primals, tangents):
    (arc,), (rate,) = primals, tangents
    w = jnp.sqrt(2.0 * jnp.maximum(arc, 0.0))
    return involute(arc), (jnp.cos(w) * rate, jnp.sin(w) * rate)


Correct = Callable[[NamedValues, Any, NamedValues], Any] | AbstractCorrection


def correction_of(owner: Any, name: str, value: Any) -> AbstractCorrection | None:
    """An `AbstractCorrection`, a function for an `Observer`, or `None`."""
    if value is None or isinstance(value, AbstractCorrection):
        return value
    return Observer(callable_as("f(values, state, innovations)", {}, None, {})(owner, name, value))
