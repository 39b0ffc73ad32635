"""The response that an orbit of a branch is: nothing is looked for again."""

from typing import Any

import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from ..hybrid import SaveAt, jit_plainly, simulate, use_executor
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.longest_step import spanning
from ._accuracy import ACCURACY
from ._closing import Motion, spans_alike
from ._forced_response import ForcedResponse, told
from ._forcing import Forcing
from ._measured import Named, measure
from ._orbit import PeriodicOrbit, silent_directions
from ._outcome import ORBITS, first_of
from ._turns import turns_of, without


@jit_plainly
def response_of(
    system: Any, args: Any, integrator: Any, execute: Any, orbit: PeriodicOrbit, *, forcing: Forcing,
    observables: Named, max_events: int,
) -> ForcedResponse:  # fmt: skip
    """All that `forced_response` tells of an orbit with the period of the forcing.

    The orbit closes to the tolerance of the branch. One step of Newton's method more, with the
    monodromy matrix that it has, squares what is left.
    """
    period = jnp.asarray(forcing.rule(system), jnp.float64)
    motion = Motion(system, args, spanning(integrator, period))
    flat, unravel = ravel_pytree(orbit.y0)
    low, high = (ravel_pytree(tree)[0] for tree in (orbit.lowest, orbit.highest))
    reach = jnp.maximum(jnp.abs(high), jnp.abs(low))
    span = jnp.where(high - low > ACCURACY.short * reach, high - low, 0.0)
    rests = jnp.where(reach > 0.0, reach, spans_alike(system, orbit.y0, span))
    size = jnp.where(span > 0.0, span, rests)
    turns = ravel_pytree(orbit.turns)[0].astype(jnp.float64)
    t0, mode = orbit.t0, orbit.mode0

    def closing(end: Any, begin: Any) -> Any:
        moved = end - begin
        return without(moved, turns, orbit.neutral, turns_of(system, orbit.y0)) / size

    with use_executor(execute):
        once = simulate(
            system, t0, t0 + period, orbit.y0, mode, args, integrator=motion.integrator,
            saveat=SaveAt(max_events=None), throw=False,
        )  # fmt: skip
        end = ravel_pytree(once.y1)[0]
        growth = orbit.monodromy * size[None, :] / size[:, None]
        left, strength, right = jnp.linalg.svd(jnp.eye(flat.size) - growth)
        kept = strength > ACCURACY.rounding * strength[0]
        along = (left.T @ closing(end, flat)) / jnp.where(kept, strength, 1.0)
        step = right.T @ jnp.where(kept, along, 0.0)
        step = jnp.where(jnp.all(jnp.abs(step) <= ACCURACY.known), step, 0.0)
        # From the end, which is where its mode holds it to the last digit; without its whole turns.
        state = flat + closing(end, flat) * size + growth @ step * size
        measured, run, end = measure(
            motion, t0, period, unravel(state), mode, observables, forcing.harmonics, max_events, size
        )
    closes = jnp.max(jnp.abs(closing(ravel_pytree(end)[0], state)))
    allowed = jnp.minimum(ACCURACY.closes * jnp.maximum(jnp.max(jnp.abs(growth)), 1.0), ACCURACY.near)
    result = first_of(
        (orbit.result != ORBITS.successful, "not_converged"),
        (run.mode1 != mode, "mode_differs"),
        (~(run.successful & (closes <= allowed)), "not_reproduced"),
    )
    return told(
        forcing, measured, ForcedResponse(
            2.0 * jnp.pi / period, t0, unravel(state), mode, {}, {}, {}, {}, orbit.multipliers,
            silent_directions(growth), closes, run.y1.integrals["motion"] <= ENGINE.zero**2,
            run.num_events, run.sequence, run.flags, result,
        ),
    )  # fmt: skip
