"""The longest step of a system with motions or loads that the error of a step does not see."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from .._validation import check_that
from ._section import Section
from ._step_size import AbstractStepSize
from ._unseen import Watched, hiding
from .accuracy import ACCURACY
from .dependence import degrees_in
from .event_functions import all_values
from .system import AbstractHybridSystem


class Whole(NamedTuple):
    """In place of a `dtmax`: none is given, and the steps are those of a run of this duration [s]."""

    span: Any


class Bound(NamedTuple):
    """Bounds on a step, whatever its error."""

    rule: Any  # the step-size rule with a number for `dtmax`
    watched: tuple[Watched, ...]  # what else it must not stray from
    longest: Any  # longest step while one of these moves evenly [s]


def step_bound(
    step: AbstractStepSize, system: AbstractHybridSystem, sections: tuple[Section, ...], t0: Any,
    span: Any, y0: PyTree, mode0: Any, args: PyTree,
) -> Bound:  # fmt: skip
    """The bounds that `AdaptiveStep` speaks of; none on fixed steps, nor beside a given `dtmax`.

    `span`: duration of the run [s].
    """
    rule: Any = step
    whole = rule.adaptive and isinstance(rule.dtmax, Whole)
    longest = jnp.maximum(ACCURACY.of_run * (rule.dtmax.span if whole else span), 1e-300)
    if not rule.adaptive or not (whole or rule.dtmax is None):
        return Bound(rule, (), longest)
    closed = _motion(system, sections, t0, y0, mode0, args, system.scheduled_guards)
    by_time = _depends_on_time(closed)
    hides = hiding(system, closed, y0)
    bound, watched = jnp.inf, hides.watched
    if by_time or hides.any:
        scale = system.time_scale(args)
        if scale is not None:
            check_that("time_scale", scale, lambda a: a > 0, "positive (infinity for no bound)")
            bound, watched = ACCURACY.of_time_scale * jnp.asarray(scale, jnp.float64), ()
        elif by_time or hides.runs_free:
            bound = longest
    bound = jax.lax.stop_gradient(jnp.asarray(bound, jnp.float64))
    rule = _with_dtmax(rule, bound)
    return Bound(rule, watched, jax.lax.stop_gradient(longest))


def spanning(integrator: Any, span: Any) -> Any:
    """The integrator for an analysis of duration `span` [s] that runs piece by piece."""
    rule = integrator.step
    if not rule.adaptive or rule.dtmax is not None:
        return integrator
    whole = Whole(jax.lax.stop_gradient(jnp.asarray(span, jnp.float64)))
    return eqx.tree_at(lambda i: i.step, integrator, _with_dtmax(rule, whole))


def _with_dtmax(rule: Any, value: Any) -> Any:
    unset = lambda a: a is None or isinstance(a, Whole)  # noqa: E731
    return eqx.tree_at(lambda r: r.dtmax, rule, value, is_leaf=unset)


def depends_on_time(
    system: AbstractHybridSystem, sections: tuple[Section, ...], t: Any, y: PyTree, mode: Any,
    args: PyTree,
) -> bool:  # fmt: skip
    """Whether the field, a guard or a section changes with the time while the state does not."""
    return _depends_on_time(_motion(system, sections, t, y, mode, args))


def _depends_on_time(closed: Any) -> bool:
    return any(degrees_in(closed, [i == 0 for i in range(len(closed.jaxpr.invars))]))


def _motion(system, sections, t, y, mode, args, without: tuple[int, ...] = ()) -> Any:
    """The program of the field and of the event functions, of time and state, `without` some guards."""

    def motion(t, y):
        values = all_values(system, sections, y, mode, args)(t, y)
        kept = [value for i, value in enumerate(values) if i not in without]
        return system.vector_field(t, y, mode, args), kept

    return jax.make_jaxpr(motion)(t, y)
