"""Dense output: the state between recorded steps, by a step of the method itself."""

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from .._types import Row
from .._validation import check_handed_on, check_type, refusal
from ._simulate import Integrator
from ._solution import Solution
from .arguments import the_system, times
from .executor import COMPACT
from .stepper import as_stepper
from .system import AbstractHybridSystem


def interpolate(
    system: AbstractHybridSystem,
    solution: Solution,
    ts: Row,
    args: PyTree = None,
    integrator: Integrator | None = None,
) -> PyTree:
    """States at any times of a run that was made with `SaveAt(steps=True)`.

    From the last recorded state before each time one Runge-Kutta step of the remaining length is
    taken, so that the accuracy is that of the run and not of a polynomial through it. At the time of
    an event it is the state after the event. As steps have none, it has no derivatives by parameters:
    states at given times that have are those of `SaveAt(ts=...)`.

    **Arguments**: `system`, `args`, `integrator` as in `simulate`; `solution`: one lane; `ts`: times
    [s], shape `[n]`. **Returns** states with a leading axis `n`; NaN outside the recorded time.

    **Errors** `ValueError` if the solution holds no steps or is a batch; `ValueError`/`TypeError`
    naming any other argument that is wrong.
    """
    the_system(system)
    check_handed_on("args", args)
    check_type("solution", solution, Solution, "a Solution")
    if solution.steps is None or jnp.ndim(solution.t1) != 0:
        kept = "one lane, of a run with saveat=SaveAt(steps=True)"
        raise refusal("solution", solution, kept)
    ts = times("ts", ts)
    integrator = Integrator() if integrator is None else integrator
    check_type("integrator", integrator, Integrator, "an Integrator or None")
    stepper = as_stepper(integrator.method)
    log = solution.steps
    rows = jnp.arange(log.t.shape[0], dtype=jnp.int32)
    begins = jnp.where(rows < log.count, log.t, jnp.inf)

    def one(t):
        at = jnp.searchsorted(begins, t, side="right") - 1
        inside = (at >= 0) & (t <= solution.t1)
        at = jnp.maximum(at, 0)
        t0, y0, dy0, mode = jax.tree.map(lambda a: a[at], (log.t, log.y, log.dy, log.mode))

        def field(t, y):
            return system.vector_field(t, y, mode, args)

        h = jnp.where(inside, t - t0, 0.0)
        y, _, _ = stepper.step(field, t0, y0, dy0, h, COMPACT)
        return jax.tree.map(lambda a: jnp.where(inside, a, jnp.nan), y)

    return jax.vmap(one)(ts)
