"""An extended Kalman filter through events."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.scipy.linalg import cho_solve
from jaxtyping import Array, Float, Int, PyTree

from .. import _validation as check
from .._argument_checks import check_arguments, instance, or_none
from .._show import amount
from .._types import Given, NamedRows, Numeric, Row
from ..hybrid import RESULTS, AbstractHybridSystem, Integrator, SaveAt, jit_plainly, simulate
from ..hybrid import arguments as given
from ..hybrid.longest_step import spanning
from ..hybrid.tree import with_float_arrays
from ._after_correction import after_correction
from ._gaussian import Gaussian, shapes_of
from ._noise import Noise
from ._state_estimate import FORM, Observe, StateEstimate
from ._with_spread import WithSpread


class Filtered(eqx.Module):
    """Result of `kalman_filter`; under `vmap` every array has the batch axes in front.

    - `predicted`, `estimate`: a `StateEstimate` before and after the measurement of each stamp.
    - `innovations`: measured less predicted values in the order of `names`, NaN where one is missing;
      `innovation_covariances`: theirs, 1 in place of one that is missing.
    - `nis`: normalised innovation squared, chi-squared with as many degrees of freedom as there are
      values at the stamp. `log_likelihood` of all, minus infinity where a run failed.
    - `transitions`: the matrix by which deviations went from the stamp before; `slopes`: derivatives
      of what is measured by the state, 0 where it is missing; `jumps`: the saltation matrix of an
      event that a correction brought about, the unit matrix where it brought none.
    - `flags` of the run to each stamp, as those of a `Solution`: the covariance is a derivative.
      `result`: a `RESULTS` item, of the first run that failed.
    """

    predicted: StateEstimate
    estimate: StateEstimate
    innovations: Float[Array, "time measured"]
    innovation_covariances: Float[Array, "time measured measured"]
    nis: Float[Array, " time"]
    log_likelihood: Float[Array, ""]
    transitions: Float[Array, "time n n"]
    slopes: Float[Array, "time measured n"]
    jumps: Float[Array, "time n n"]
    flags: Int[Array, " time"]
    result: Any
    names: tuple[str, ...] = eqx.field(static=True)

    def __repr__(self) -> str:
        return f"Filtered: {', '.join(self.names)} at {amount(self.nis.shape[-1], 'time')}"


@check_arguments(
    start=instance(Gaussian, "a Gaussian"), noise=instance(Noise, "a Noise"),
    integrator=or_none(instance(Integrator, "an Integrator or None")),
)  # fmt: skip
def kalman_filter(
    system: AbstractHybridSystem, t0: Numeric, start: Given[Gaussian], t: Row, measured: NamedRows,
    measure: Given[Observe], noise: Given[Noise], args: PyTree = None, *,
    integrator: Given[Integrator | None] = None,
) -> Filtered:  # fmt: skip
    r"""Extended Kalman filter of a hybrid system: states at the stamps from measurements until then.

    From stamp to stamp the mean moves as `simulate` moves it, and under the same error control

    $$P^- = \Phi P\Phi^T + W, \qquad \dot\Phi = f_y\Phi, \quad \dot W = f_yW + Wf_y^T + Q_m,
      \qquad \Phi^+ = S\Phi, \quad W^+ = SWS^T \text{ at events}$$

    with the saltation matrix $S$. Where slip turns into stick it loses rank: the speed is known from
    there on. With slopes $H$ of what is measured, and its noise $R$,

    $$V = HP^-H^T + R, \quad K = P^-H^TV^{-1}, \quad P = (1 - KH)P^-(1 - KH)^T + KRK^T$$

    so that a measurement leaves alone what a contact holds. The mode stays the same, unless the
    correction goes through a guard $g$: the event was then $g/\dot g$ ago, and its transition and
    saltation matrix are made good. Where this is longer than from the stamp before, the mode is that of
    `initial_mode`: no event of this interval explains what was measured.

    **Arguments**

    - `system`, `args`, `integrator`: as for `simulate`. `t0`, `start`: a time [s], and the `Gaussian`.
    - `t`: stamps [s], none before `t0`, increasing. `measured`: a row for each quantity by name, one
      value a stamp, NaN where it is missing. `noise`: a `Noise`.
    - `measure(system, t, y, mode, args)`: what would be measured without noise, named scalars.

    **Returns** `Filtered`. Its `log_likelihood` has derivatives by all parameters, those of the start
    and of the noise too, forward and reverse. All is of first order: the distribution is in one mode,
    so narrow that guards are straight over it and few of its states are still beyond an event. A filter
    in stick takes a motion for noise until its place goes through a guard: see that `nis` keeps to its
    distribution, and let disturbances be states with `Noise.process`.

    **Raises** `TypeError`, `ValueError` naming the argument, before compilation; nothing where a run
    fails, which has numbers until then, and its `result`.

    ??? cite "Reference"

        N. J. Kong and others, "The Salted Kalman Filter", *Automatica* 131:109752, 2021.
    """
    given.the_system(system)
    check.check_handed_on("args", args)
    t0, stamps = jnp.asarray(given.a_time("t0", t0)), given.times("t", t)
    check.check_increasing("t", check.one_row("t", stamps))
    check.check_at_least("t[0]", stamps[0], "t0", t0)
    rows = check.check_mapping("measured", measured, "a mapping from names to rows of numbers")
    if rows.keys() != noise.measured.keys():
        allowed = f"of {', '.join(noise.measured)}, as in noise.measured"
        raise check.refusal("measured", sorted(rows), allowed)
    for name, row in rows.items():
        where = f"measured[{name!r}]"
        check.check_that(where, row, lambda a: ~np.isinf(a), "finite, or NaN where it is missing")
        if np.shape(row) != stamps.shape:
            raise check.shape_refusal(where, row, f"one number for each of {stamps.size} stamps of t")
    check.check_callable("measure", measure, FORM, *range(5))
    system, args = with_float_arrays((system, args))
    given.check_field(system, t0, start.mean, np.zeros((), np.int32), args, name="start.mean")
    named: Any = None if start.mode is None else given.mode_index("start.mode", system, start.mode)
    system.check_start(t0, start.mean, named, args)
    mean, mode = given.start_of(system, t0, start.mean, start.mode, args)
    what = "measure(system, t, y, mode, args)"
    found = check.check_mapping(what, eqx.filter_eval_shape(measure, system, t0, mean, mode, args))
    if found.keys() != rows.keys() or any(jnp.shape(a) != () for a in found.values()):
        raise check.refusal(what, sorted(found), f"one number for each of {', '.join(rows)}")
    process = jax.tree.map(jnp.zeros_like, mean) if noise.process is None else noise.process
    if shapes_of(process) != shapes_of(mean):
        raise check.refusal("noise.process", process, "a state with the components of start.mean")
    values = jnp.stack([jnp.asarray(row, jnp.float64) for row in rows.values()], axis=1)
    variances = jnp.stack([noise.measured[name] ** 2 for name in rows])
    data = stamps, values, variances, ravel_pytree(process)[0]
    integrator = spanning(Integrator() if integrator is None else integrator, stamps[-1] - t0)
    first = mean, start.covariance, mode
    return _compiled(system, t0, first, data, measure, args, integrator, tuple(rows))


def _filter(system, t0, first, data, measure, args, integrator, names) -> Filtered:
    (y0, covariance, mode0), (stamps, values, variances, density) = first, data
    flat, unravel = ravel_pytree(y0)
    whole = WithSpread(system, density)
    # Beside the state the noise is as small as it likes: it is integrated in units of its own.
    largest = jax.lax.stop_gradient(jnp.max(density))

    def predict(t0, t1, y, covariance, mode):
        unit = largest * jnp.sqrt(t1 - t0)
        unit = jax.lax.stop_gradient(jnp.where(unit > 0.0, unit, 1.0))
        spread = WithSpread(system, density / unit)
        run = simulate(
            spread, t0, t1, spread.start(t0, unravel(y), mode, args), mode, args,
            integrator=integrator, saveat=SaveAt(events=False, max_events=None), throw=False,
        )  # fmt: skip
        moved = run.y1.transition @ covariance @ run.y1.transition.T + unit**2 * run.y1.noise
        return run, 0.5 * (moved + moved.T)

    def onwards(carry, stamp):
        since, y, covariance, mode, good, result = carry
        t, row = stamp
        # After a failure the state stays where it is; its numbers are discarded.
        run, before = predict(jnp.where(good, since, t), t, y, covariance, mode)
        result = RESULTS.where(good, run.result, result)
        there = ravel_pytree(run.y1.y)[0]

        def observe(z):
            found = measure(system, t, unravel(z), run.mode1, args)
            return jnp.stack([jnp.asarray(found[name], jnp.float64) for name in names])

        present = ~jnp.isnan(row)
        slope = jnp.where(present[:, None], jax.jacfwd(observe)(there), 0.0)
        off = jnp.where(present, jnp.where(present, row, 0.0) - observe(there), 0.0)
        variance = jnp.where(present, variances, 1.0)
        spread = slope @ before @ slope.T + jnp.diag(variance)
        lower = jnp.linalg.cholesky(spread)
        gain = cho_solve((lower, True), slope @ before).T
        nis = off @ cho_solve((lower, True), off)
        after, kept = unravel(there + gain @ off), jnp.eye(there.size) - gain @ slope
        narrowed = kept @ before @ kept.T + (gain * variance[None, :]) @ gain.T
        moved = after_correction(whole, t, t - since, run.y1.y, after, run.mode1, args)
        after, jump, new_mode = moved
        narrowed = jump @ narrowed @ jump.T
        good = good & run.successful
        result = RESULTS.where(good & (new_mode < 0), RESULTS.no_admissible_mode, result)
        good = good & (new_mode >= 0)
        sizes = 2.0 * jnp.log(jnp.diagonal(lower)) + jnp.where(present, jnp.log(2.0 * jnp.pi), 0.0)
        score = jnp.where(good, -0.5 * (nis + jnp.sum(sizes)), -jnp.inf)
        off = jnp.where(present, off, jnp.nan)
        floats = there, before, after, narrowed, off, spread, nis, run.y1.transition, slope, jump
        floats = jax.tree.map(lambda a: jnp.where(good, a, jnp.nan), floats)
        kept = jax.tree.map(
            lambda a, b: jnp.where(good, a, b), (after, narrowed, new_mode), (y, covariance, mode)
        )
        return (t, *kept, good, result), (floats, run.mode1, new_mode, run.flags, score)

    held = whole.held(t0, y0, mode0, args)
    result = RESULTS.where(mode0 >= 0, RESULTS.successful, RESULTS.no_admissible_mode)
    carry = (t0, flat, held @ covariance @ held.T, mode0, mode0 >= 0, result)
    carry, (floats, mode_before, mode, flags, scores) = jax.lax.scan(onwards, carry, (stamps, values))
    there, before, after, narrowed, off, spread, nis, transitions, slopes, jumps = floats
    states = jax.vmap(unravel)
    return Filtered(
        StateEstimate(stamps, states(there), before, mode_before, system, args),
        StateEstimate(stamps, states(after), narrowed, mode, system, args),
        off, spread, nis, jnp.sum(scores), transitions, slopes, jumps, flags, carry[-1], names,
    )  # fmt: skip


_compiled = jit_plainly(_filter)
