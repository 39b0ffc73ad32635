"""Period and largest exponent of many parameter sets at once, simplified and full model."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.analysis import CANNOT_TELL, period_of

from ._sets import simplified

# Parts of the record at which the motion is looked at for its size; uneven, so that no period is hit at
# one phase all the time.
SAMPLES = ((np.arange(24) + 1.0) / 24) ** 3
ROOM = 192  # maxima in transient and record together
# Periods are counted in maxima of x: the acceleration also crosses zero on a belt that is not steady.
MAXIMA = ss.Section(lambda system, t, y, dy, mode, args: y.vx, "falling", name="maximum of x")


def regimes(
    build: Callable,
    *,
    transient: float,
    duration: float,
    segments: int,
    tolerance: float,
    executor: str,
) -> ss.map_lanes:
    """Mapped function of (parameters, k3, pull): period, exponent, whether it lifted off, or failed.

    The exponent [1/s] is the mean growth of a tangent over `segments` seconds after five more; NaN
    with `segments = 0`. The period is -1 where it cannot be told.
    """
    step: Any = ss.AdaptiveStep
    integrator = ss.Integrator("tsit5", step(tolerance, 0.1 * tolerance), max_steps=2_000_000)
    options: Any = {"integrator": integrator, "throw": False}

    def lane(p, k3, pull):
        system, start = build(p, k3, pull)
        # One run for transient and record: XLA aborts on some programs with one that records beside
        # one that does not, see `map_lanes`.
        run: Any = ss.simulate(
            system, 0.0, transient + duration, start,
            saveat=ss.SaveAt(
                ts=transient + duration * SAMPLES, sections=MAXIMA, max_events=None, max_crossings=ROOM
            ),
            **options,
        )  # fmt: skip
        rows, samples = run.crossings[0], run.outputs
        seen = jnp.stack([samples.y.x, samples.y.y], axis=1)
        seen = jnp.where(jnp.isfinite(seen), seen, seen[:1])
        early = jnp.sum(rows.t < transient, dtype=rows.count.dtype)
        count = rows.count - early
        points = jnp.roll(jnp.stack([rows.y.x, rows.y.y], axis=1), -early, axis=0)
        span = jnp.stack([seen.min(axis=0), seen.max(axis=0)])
        period = period_of(points, count, span, tolerance=5e-3, max_period=16).period
        normal = jax.vmap(lambda t, y: system.normal_force(t, y))(rows.t, rows.y)
        lifted = jnp.any((rows.t >= transient) & (normal < 0.0))
        ok = run.successful & (count >= 8)

        def grow(carry, _):
            y, v = carry

            def flow(y):
                return ss.simulate(
                    system, 0.0, 1.0, y, run.mode1, saveat=ss.SaveAt(max_events=None), **options
                ).y1

            y, v = jax.jvp(flow, (y,), (v,))
            length = jnp.sqrt(sum(c * c for c in v))
            return (y, jax.tree.map(lambda c: c / length, v)), jnp.log(length)

        if segments:
            tangent = jax.tree.map(jnp.ones_like, run.y1)
            growth = jax.lax.scan(grow, (run.y1, tangent), None, length=segments + 5)[1]
            exponent = growth[5:].mean()
        else:
            exponent = jnp.full((), jnp.nan)
        period = jnp.where(ok, period, CANNOT_TELL)
        return {"period": period, "exponent": exponent, "lifted": lifted, "ok": ok}

    return ss.map_lanes(lane, executor=executor)


def mean_friction(executor: str) -> ss.map_lanes:
    """Mapped function of (parameters, k3): mean of T_s [N] from 40 s to 60 s, simplified model."""
    step: Any = ss.AdaptiveStep
    integrator = ss.Integrator("tsit5", step(1e-6, 1e-7), max_steps=2_000_000)
    times = jnp.linspace(40.0, 60.0, 401)

    def lane(p, k3):
        system, start = simplified(p, k3)
        run: Any = ss.simulate(
            system, 0.0, 60.0, start, integrator=integrator,
            saveat=ss.SaveAt(ts=times, max_events=None), throw=False,
        )  # fmt: skip
        # The block's acceleration is zero on average: friction balances its load.
        return -jax.vmap(lambda y: system.loads(y).on_block)(run.outputs.y).mean()

    return ss.map_lanes(lane, executor=executor)
