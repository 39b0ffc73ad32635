"""Mean, extremes and harmonics of observables over one period, as accurate as the motion itself."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from ..analysis.observable import Observable, RateOf
from ..derived import WithIntegrals
from ..hybrid import (
    AbstractHybridSystem,
    SaveAt,
    Section,
    Solution,
    simulate,
)
from ..hybrid.same_system import AbstractSameSystem
from ._accuracy import ACCURACY
from ._closing import Motion

Named = tuple[tuple[str, Observable], ...]


class AlongField:
    """An observable whose slopes are those of the field: a function of time and state alone."""

    def __init__(self, observable: Observable):
        self.observable = observable

    def __call__(self, system, t, y, dy, mode, args):
        field = system.vector_field(t, y, mode, args)
        return self.observable(system, t, y, field, mode, args)


class OverPeriod(AbstractSameSystem):
    """The same system, with the period over which is measured, and the size of the motion."""

    system: AbstractHybridSystem
    period: Any
    size: Any


class Measured(NamedTuple):
    """Of each observable by name; `harmonics` are complex, `[harmonic]`, from the first one on."""

    mean: dict[str, Any]
    lowest: dict[str, Any]
    highest: dict[str, Any]
    harmonics: dict[str, Any]


def measure(
    motion: Motion, t0: Any, period: Any, y0: PyTree, mode0: Any, observables: Named, count: int,
    max_events: int, size: Any,
) -> tuple[Measured, Solution, PyTree]:  # fmt: skip
    r"""One period of a motion, what is told of it, and its end.

    Mean and harmonics, $u_k = (2/T) \int u(t) e^{-ik\omega t} dt$, are integrated with the motion; the
    extremes lie where the rate of the observable is zero, or beside an event. Beside these stands
    `motion`, which is 0 where no component moves, in parts of its `size`.
    """
    named = [(name, AlongField(observable)) for name, observable in observables]

    def integrands(over: Any, t, y, mode, args):
        rates = ravel_pytree(over.system.vector_field(t, y, mode, args))[0] * over.period / over.size
        found = {"motion": jnp.sum(rates**2) / over.period}
        for i, (_, value) in enumerate(named):
            u = jnp.asarray(value(over.system, t, y, None, mode, args), jnp.float64) / over.period
            found[f"mean {i}"] = u
            for k in range(1, count + 1):
                angle = 2.0 * jnp.pi * k / over.period * t
                found[f"cos {i} {k}"] = 2.0 * u * jnp.cos(angle)
                found[f"sin {i} {k}"] = -2.0 * u * jnp.sin(angle)
        return found

    def turning(value):
        def of_ledger(ledger, t, y, dy, mode, args):
            return RateOf(value)(ledger.system.system, t, y.y, dy.y, mode, args)

        return Section(of_ledger, "both")

    ledger = WithIntegrals(OverPeriod(motion.system, period, size), integrands)
    run = simulate(
        ledger, t0, t0 + period, ledger.start(y0, t0, motion.args), mode0, motion.args,
        integrator=motion.integrator, throw=False, saveat=SaveAt(
            sections=tuple(turning(value) for _, value in named), max_events=max_events,
            max_crossings=ACCURACY.samples,
        ),
    )  # fmt: skip
    total, log = run.y1.integrals, run.events
    mean, lowest, highest, harmonics = {}, {}, {}, {}
    for i, (name, value) in enumerate(named):

        def at(t, y, mode, value=value):
            found = value(motion.system, t, y, None, jnp.maximum(mode, 0), motion.args)
            return jnp.asarray(found, jnp.float64)

        def rows(log, t, y, mode, at=at):
            known = jnp.arange(log.t.shape[0], dtype=jnp.int32) < log.count
            # Rows without an event are not numbers: those of the start stand for them.
            t, y, mode = jax.tree.map(
                lambda a, b: jnp.where(known.reshape(-1, *(1,) * (a.ndim - 1)), a, b),
                (t, y, mode), (t0, y0, jnp.asarray(mode0, mode.dtype)),
            )  # fmt: skip
            return jax.vmap(at)(t, y, mode)

        crossed = run.crossings[i]
        values = [at(t0, y0, mode0)[None], rows(crossed, crossed.t, crossed.y.y, crossed.mode)]
        if log is not None and motion.system.guard_names:
            values.append(rows(log, log.t, log.y_before.y, log.mode_before))
            values.append(rows(log, log.t, log.y_after.y, log.mode_after))
        every = jnp.concatenate(values)
        mean[name], lowest[name], highest[name] = total[f"mean {i}"], jnp.min(every), jnp.max(every)
        real, imag = (
            jnp.stack([total[f"{wave} {i} {k}"] for k in range(1, count + 1)])
            for wave in ("cos", "sin")
        )
        harmonics[name] = jax.lax.complex(real, imag)
    return Measured(mean, lowest, highest, harmonics), run, run.y1.y
