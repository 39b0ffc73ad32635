"""Which loops rest, and which hunt: one verdict for each of many controllers."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._types import Given, NamedNumbers, Numeric
from .._validation import (
    as_parameter,
    check_callable,
    check_mapping,
    check_type,
    numbers,
    one_number,
    refusal,
)
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, Section, simulate
from ..hybrid.components import component_list, place_of
from ..hybrid.same_system import AbstractSameSystem
from ..sweep import map_lanes
from ._with_controller import Controlled

VERDICTS = ("rests", "hunts", "creeps", "unstable")


class HuntingMap(NamedTuple):
    """Verdicts on loops; every array has the shape of the `values`.

    - `code`: the place of the verdict in `"rests", "hunts", "creeps", "unstable"`; `verdict`: the word.
    - `amplitude`: half of the way of the component in the last quarter of the run, in its unit;
      `period` of hunting [s], NaN where there is none.
    """

    values: dict[str, Any]
    code: Int[Array, "..."]
    amplitude: Float[Array, "..."]
    period: Float[Array, "..."]

    @property
    def verdict(self) -> np.ndarray:
        """The verdicts as words."""
        return np.array(VERDICTS)[np.asarray(self.code)]


class _Levelled(AbstractSameSystem):
    """The same system, with a level of a component to be crossed."""

    system: AbstractHybridSystem
    level: Any


def hunting_map(
    loop: Callable[..., AbstractHybridSystem],
    values: NamedNumbers,
    start: Callable[[Any], Controlled],
    duration: Numeric,
    component: Given[str],
    *,
    resolution: Numeric,
    integrator: Given[Integrator | None] = None,
) -> HuntingMap:
    r"""Whether loops come to rest or hunt, over gains, sample times, friction or whatever else.

    Each lane runs for `duration`; the third and the last quarter are compared.

    - `"rests"`: in the last quarter the component moves by `resolution` at most, and the output of the
      controller does not change. As long as an integrator winds up, a block that sticks is not at rest.
    - `"hunts"`: it moves to and fro, at least half as far as in the quarter before.
    - `"creeps"`: neither; it still settles, or has not come back within a quarter.
    - `"unstable"`: it moves more than twice as far as ever before, or the run has failed.

    **Arguments**

    - `loop(**point) -> WithController`, or a system around one whose state is a `Controlled`;
      `start(system) -> y0`.
    - `values`: parameter name to an array of values, all of one shape, as `numpy.meshgrid` makes them.
    - `duration` [s]: eight periods of the slowest hunting, or more. `component`: name of a number of
      the state; `resolution` in its unit, positive.
    - `integrator`: as for `simulate`.

    **Returns** a `HuntingMap`. **Errors** `ValueError`, `TypeError` naming the argument.
    """
    check_callable("start", start, "start(system) -> y0", None)
    given = check_mapping("values", values, "a mapping from names of parameters to arrays")
    arrays = {n: as_parameter(numbers(f"values[{n!r}]", a)) for n, a in given.items()}
    shapes = {a.shape for a in arrays.values()}
    if len(shapes) != 1 or () in shapes or any(0 in shape for shape in shapes):
        raise refusal("values", {n: a.shape for n, a in arrays.items()}, "arrays of one shape")
    one_number("duration", duration, "positive")
    one_number("resolution", resolution, "positive")
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator or None")
    point = {name: numbers(name, a).ravel()[0] for name, a in given.items()}
    first = check_callable("loop", loop, "loop(**point) -> system", **point)(**point)
    check_type("loop(...)", first, AbstractHybridSystem, "an AbstractHybridSystem")
    y0 = check_type("start(...)", start(first), Controlled, "a Controlled")
    place = place_of(y0, component) if isinstance(component, str) else None
    if place is None:
        raise refusal("component", component, f"one of {component_list(y0)}")
    above = Section(
        lambda system, t, y, dy, mode, args: place.read(y) - system.level, "rising", name="middle"
    )
    # Of each of the two quarters, and few of what was before; as many crossings find room.
    samples = 256
    late = jnp.linspace(0.5, 1.0, 2 * samples + 1) * duration
    until = jnp.concatenate(
        [jnp.linspace(0.0, 0.5, 64, endpoint=False) * duration, late[: samples + 1]]
    )

    def one(point: Mapping[str, Any]) -> tuple:
        system = loop(**point)

        def run(system, t0, t1, y, mode, **saved):
            keeps = SaveAt(max_events=None, max_crossings=samples, **saved)
            return simulate(system, t0, t1, y, mode, integrator=integrator, saveat=keeps, throw=False)

        early = run(system, until[0], until[-1], start(system), None, ts=until)
        x = jax.vmap(place.read)(early.outputs.y)
        quarter = x[-samples - 1 :]
        level = _Levelled(system, 0.5 * (jnp.max(quarter) + jnp.min(quarter)))
        final = run(
            level, until[-1], late[-1], early.y1, early.mode1, ts=late[samples:], sections=above
        )
        last = jax.vmap(place.read)(final.outputs.y)
        u = jnp.stack([jnp.ravel(a) for a in jax.tree.leaves(final.outputs.y.output)])
        still = jnp.all(jnp.ptp(u, axis=-1) == 0.0)
        crossed, count = final.crossings[0], final.crossings[0].count
        end = crossed.t[jnp.clip(count - 1, 0, samples - 1)]
        period = (end - crossed.t[0]) / jnp.maximum(count - 1, 1).astype(jnp.float64)
        span = jnp.ptp(last)
        fine = early.successful & final.successful & jnp.isfinite(span)
        code = jnp.where(fine, code_of(x, last, count >= 2, still, resolution), 3)
        return code, 0.5 * span, jnp.where(code == 1, period, jnp.nan)

    lanes = {name: jnp.ravel(a) for name, a in arrays.items()}
    (shape,) = shapes
    code, amplitude, period = (jnp.reshape(a, shape) for a in map_lanes(one)(lanes))
    return HuntingMap(arrays, code, amplitude, period)


def code_of(early: Any, last: Any, returns: Any, still: Any, resolution: Any) -> Any:
    """Code of a motion: 0 rests, 1 hunts, 2 creeps, 3 unstable.

    `early`: places in three quarters, of which the third has as many as `last`, those in the fourth.
    `returns`: whether it comes back to the middle in the last, `still`: whether the output rests there.
    """
    now, before, widest = jnp.ptp(last), jnp.ptp(early[-last.size :]), jnp.ptp(early)
    hunts = returns & (now > resolution) & (2.0 * now >= before)
    code = jnp.where((now <= resolution) & still, 0, jnp.where(hunts, 1, 2))
    # By what it ever was: a block that stuck in the quarter before has no span there.
    return jnp.where((now > 2.0 * widest) & (now > resolution), 3, code)
