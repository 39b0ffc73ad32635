"""The longest step of a system that depends on the time itself."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from .._validation import check_that
from ._dependence import degrees
from ._events import all_values
from ._section import Section
from ._step_size import AbstractStepSize
from ._system import AbstractHybridSystem

# While nothing moves the error of a step is zero, whatever its length, and what a load does meanwhile
# is seen at the ends of the step and two points inside.
OF_TIME_SCALE = 2.0
OF_RUN = 1e-3
RESOLUTION = 1e-10  # part of the run; an event function that still jumps within it is discontinuous


def bounded(
    step: AbstractStepSize, system: AbstractHybridSystem, sections: tuple[Section, ...], t0: Any,
    span: Any, y0: PyTree, mode0: Any, args: PyTree,
) -> Any:  # fmt: skip
    """The step-size rule with a number for `dtmax`, as `AdaptiveStep` says; fixed steps as they are.

    `span`: duration of the run [s], or of the analysis that runs piece by piece.
    """
    rule: Any = step
    if not rule.adaptive or rule.dtmax is not None:
        return rule
    bound: Any = jnp.inf
    if depends_on_time(system, sections, t0, y0, mode0, args):
        scale = system.time_scale(args)
        if scale is None:
            bound = jnp.maximum(OF_RUN * span, 1e-300)
        else:
            check_that("time_scale", scale, lambda a: a > 0, "positive (infinity for no bound)")
            bound = OF_TIME_SCALE * jnp.asarray(scale, jnp.float64)
    bound = jax.lax.stop_gradient(jnp.asarray(bound, jnp.float64))
    return eqx.tree_at(lambda r: r.dtmax, rule, bound, is_leaf=lambda a: a is None)


def spanning(
    integrator: Any, system: AbstractHybridSystem, t0: Any, span: Any, y0: PyTree, mode0: Any,
    args: PyTree,
) -> Any:  # fmt: skip
    """The integrator for an analysis that runs piece by piece: its steps are bounded by the whole."""
    step = bounded(integrator.step, system, (), t0, span, y0, mode0, args)
    return eqx.tree_at(lambda i: i.step, integrator, step)


def depends_on_time(
    system: AbstractHybridSystem, sections: tuple[Section, ...], t: Any, y: PyTree, mode: Any,
    args: PyTree,
) -> bool:  # fmt: skip
    """Whether the field, a guard or a section changes with the time while the state does not."""

    def motion(t, y):
        slope = system.vector_field(t, y, mode, args)
        return slope, all_values(system, sections, y, mode, args)(t, y)

    return any(degrees(motion, (t, y), (True, False)))
