"""An extended Kalman filter through events."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int, PyTree

from .._argument_checks import check_arguments, instance, or_none, time
from .._show import amount
from .._types import Given, NamedRows, Numeric, Row
from .._validation import (
    as_parameter,
    check_at_least,
    check_callable,
    check_increasing,
    check_mapping,
    check_that,
    refusal,
    shape_refusal,
)
from ..hybrid import RESULTS, AbstractHybridSystem, Integrator, SaveAt, jit_plainly, simulate
from ..hybrid.arguments import start_of, the_system, times
from ..hybrid.longest_step import spanning
from ..hybrid.tree import with_float_arrays
from ._gaussian import Gaussian, shapes_of
from ._mode_after import mode_after
from ._noise import Noise
from ._state_estimate import FORM, Observe, StateEstimate
from ._with_spread import WithSpread


class Filtered(eqx.Module):
    """Result of `kalman_filter`; under `vmap` every array has the batch axes in front.

    - `predicted`, `estimate`: a `StateEstimate` before and after the measurement of each stamp.
    - `innovations`: measured less predicted values in the order of `names`, NaN where one is missing;
      `innovation_covariances`: theirs, of those that are there.
    - `nis`: normalised innovation squared, chi-squared with as many degrees of freedom as there are
      values at the stamp.
    - `log_likelihood`: of all measurements, with its constants; minus infinity where a run failed.
    - `transitions`: the matrix by which deviations went from the stamp before; `slopes`: derivatives
      of what is measured by the state.
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
    flags: Int[Array, " time"]
    result: Any
    names: tuple[str, ...] = eqx.field(static=True)

    def __repr__(self) -> str:
        return f"Filtered: {', '.join(self.names)} at {amount(self.nis.shape[-1], 'time')}"


@check_arguments(
    t0=time, start=instance(Gaussian, "a Gaussian"), noise=instance(Noise, "a Noise"),
    integrator=or_none(instance(Integrator, "an Integrator or None")),
)  # fmt: skip
def kalman_filter(
    system: AbstractHybridSystem,
    t0: Numeric,
    start: Given[Gaussian],
    t: Row,
    measured: NamedRows,
    measure: Given[Observe],
    noise: Given[Noise],
    args: PyTree = None,
    *,
    integrator: Given[Integrator | None] = None,
) -> Filtered:
    r"""Extended Kalman filter of a hybrid system: states at the stamps from measurements until then.

    From stamp to stamp the mean moves as `simulate` moves it, with its events, and

    $$P^- = \Phi P\Phi^T + W, \qquad \dot\Phi = f_y\Phi, \qquad \dot W = f_yW + Wf_y^T + Q_m,
      \qquad \Phi^+ = S\Phi, \quad W^+ = SWS^T \text{ at events}$$

    with the saltation matrix $S$, all under the error control of the motion. Where slip turns into stick
    $S$ loses rank: the speed is known from there on, its variance is zero. With the slopes $H$ of what
    is measured, and its noise $R$,

    $$V = HP^-H^T + R, \quad K = P^-H^TV^{-1}, \quad P = (1 - KH)P^-(1 - KH)^T + KRK^T$$

    so that a measurement leaves alone what a contact holds. The mode stays the same, unless the
    correction goes through a guard, or further beyond one: then it is that of `initial_mode`.

    **Arguments**

    - `system`, `args`, `integrator`: as for `simulate`.
    - `t0`, `start`: a time [s] and the `Gaussian` there.
    - `t`: stamps [s], none before `t0`, increasing. `measured`: a row for each quantity by name, one
      value a stamp, NaN where it is missing.
    - `measure(system, t, y, mode, args)`: what would be measured without noise, named scalars.
    - `noise`: a `Noise`.

    **Returns** `Filtered`. Its `log_likelihood` has derivatives by parameters of the system, the start and
    the noise, forward and reverse. They hold, as the covariance itself, to first order: a distribution
    is as narrow as guards are straight over it, and is in one mode. A filter that believes in a stick
    too firmly takes no notice of a motion: let disturbances be states with `Noise.process`.

    **Raises** `TypeError`, `ValueError` naming the argument, before compilation. Where a run fails
    nothing is raised: see `result`.

    ??? cite "Reference"

        N. J. Kong, J. J. Payne, G. Council, A. M. Johnson, "The Salted Kalman Filter: Kalman filtering
        on hybrid dynamical systems", *Automatica* 131:109752, 2021.
    """
    the_system(system)
    stamps = times("t", t)
    if not stamps.size:
        raise shape_refusal("t", t, "at least one time")
    check_increasing("t", t)
    check_at_least("t[0]", stamps[0], "t0", t0)
    rows = check_mapping("measured", measured, "a mapping from names to rows of numbers")
    if rows.keys() != noise.measured.keys():
        raise refusal("measured", sorted(rows), f"of {', '.join(noise.measured)}, as in noise.measured")
    for name, row in rows.items():
        where = f"measured[{name!r}]"
        check_that(where, row, lambda a: ~np.isinf(a), "finite, or NaN where it is missing")
        if np.shape(row) != stamps.shape:
            raise shape_refusal(where, row, f"one number for each of {stamps.size} stamps")
    check_callable("measure", measure, FORM, *range(5))
    system, args = with_float_arrays((system, args))
    t0 = as_parameter(t0)
    mean, mode = start_of(system, t0, start.mean, start.mode, args)
    system.check_start(t0, mean, args)
    if start.mode is not None:
        system.check_mode(t0, mean, mode, args)
    found = eqx.filter_eval_shape(measure, system, t0, mean, mode, args)
    named = check_mapping("measure(system, t, y, mode, args)", found)
    if named.keys() != rows.keys() or any(jnp.shape(a) != () for a in named.values()):
        allowed = f"one number for each of {', '.join(rows)}"
        raise refusal("measure(system, t, y, mode, args)", sorted(named), allowed)
    process = jax.tree.map(jnp.zeros_like, mean) if noise.process is None else noise.process
    if shapes_of(process) != shapes_of(mean):
        raise refusal("noise.process", process, "a state with the components of start.mean")
    density = ravel_pytree(process)[0]
    values = jnp.stack([jnp.asarray(rows[name], jnp.float64) for name in rows], axis=1)
    deviations = jnp.stack([noise.measured[name] for name in rows])
    integrator = Integrator() if integrator is None else integrator
    first = (mean, start.covariance, mode)
    data = (stamps, values, deviations, density)
    return _compiled(system, t0, first, data, measure, args, integrator, tuple(rows))


def _filter(system, t0, first, data, measure, args, integrator, names) -> Filtered:
    stamps, values, deviations, density = data
    y0, covariance, mode0 = first
    flat, unravel = ravel_pytree(y0)
    integrator = spanning(integrator, stamps[-1] - t0)
    saveat = SaveAt(events=False, max_events=None)
    # Beside the state the noise is as small as it likes: it is integrated in units of its own.
    largest = jax.lax.stop_gradient(jnp.max(density))

    def predict(t0, t1, y, covariance, mode):
        unit = largest * jnp.sqrt(t1 - t0)
        unit = jax.lax.stop_gradient(jnp.where(unit > 0.0, unit, 1.0))
        spread = WithSpread(system, density / unit)
        run = simulate(
            spread, t0, t1, spread.start(t0, unravel(y), mode, args), mode, args,
            integrator=integrator, saveat=saveat, throw=False,
        )  # fmt: skip
        moved = run.y1.transition @ covariance @ run.y1.transition.T + unit**2 * run.y1.noise
        return run, 0.5 * (moved + moved.T)

    def onwards(carry, stamp):
        since, y, covariance, mode, good, result = carry
        t, row = stamp
        # After a failure the state stays where it is; its numbers are discarded.
        run, before = predict(jnp.where(good, since, t), t, y, covariance, mode)
        result = RESULTS.where(good, run.result, result)
        good = good & run.successful
        there = ravel_pytree(run.y1.y)[0]

        def observe(z):
            found = measure(system, t, unravel(z), run.mode1, args)
            return jnp.stack([jnp.asarray(found[name], jnp.float64) for name in names])

        present = ~jnp.isnan(row)
        slope = jnp.where(present[:, None], jax.jacfwd(observe)(there), 0.0)
        off = jnp.where(present, jnp.where(present, row, 0.0) - observe(there), 0.0)
        variance = jnp.where(present, deviations**2, 1.0)
        spread = slope @ before @ slope.T + jnp.diag(variance)
        lower = jnp.linalg.cholesky(spread)
        solve = jax.scipy.linalg.cho_solve
        gain = solve((lower, True), slope @ before).T
        nis = off @ solve((lower, True), off)
        after = there + gain @ off
        kept = jnp.eye(after.size) - gain @ slope
        narrowed = kept @ before @ kept.T + (gain * variance[None, :]) @ gain.T
        new_mode = mode_after(system, t, run.y1.y, unravel(after), run.mode1, args)
        held = WithSpread(system, density).held(t, unravel(after), new_mode, args)
        narrowed = held @ narrowed @ held.T
        result = RESULTS.where(good & (new_mode < 0), RESULTS.no_admissible_mode, result)
        good = good & (new_mode >= 0)
        sizes = 2.0 * jnp.log(jnp.diagonal(lower)) + jnp.where(present, jnp.log(2.0 * jnp.pi), 0.0)
        score = -0.5 * (nis + jnp.sum(sizes))
        floats = (
            there, before, after, narrowed, jnp.where(present, off, jnp.nan), spread, nis,
            run.y1.transition, slope,
        )  # fmt: skip
        floats = jax.tree.map(lambda a: jnp.where(good, a, jnp.nan), floats)
        carry = (
            t, jnp.where(good, after, y), jnp.where(good, narrowed, covariance),
            jnp.where(good, new_mode, mode), good, result,
        )  # fmt: skip
        return carry, (floats, run.mode1, new_mode, run.flags, jnp.where(good, score, -jnp.inf))

    held = WithSpread(system, density).held(t0, y0, mode0, args)
    result = RESULTS.where(mode0 >= 0, RESULTS.successful, RESULTS.no_admissible_mode)
    carry = (t0, flat, held @ covariance @ held.T, mode0, mode0 >= 0, result)
    carry, (floats, mode_before, mode, flags, scores) = jax.lax.scan(onwards, carry, (stamps, values))
    there, before, after, narrowed, off, spread, nis, transitions, slopes = floats
    states = jax.vmap(unravel)
    return Filtered(
        StateEstimate(stamps, states(there), before, mode_before, system, args),
        StateEstimate(stamps, states(after), narrowed, mode, system, args),
        off, spread, nis, jnp.sum(scores), transitions, slopes, flags, carry[-1], names,
    )  # fmt: skip


_compiled = jit_plainly(_filter)
