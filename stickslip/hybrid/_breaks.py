"""A system whose load jumps or bends at known times."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, instance, reals, time, whole_state
from .._types import Given, Numeric, Row
from .._validation import as_parameter, check_finite, check_increasing, check_type, shape_refusal
from ._wrapper import AbstractSystemWrapper
from .accuracy import ACCURACY
from .load_jump import state_after_jump
from .system import AbstractHybridSystem, mode_type
from .tree import select


class Pieced(NamedTuple):
    """State `y` of the system, and the number `piece` of breaks that are past."""

    y: PyTree
    piece: Any

    held = ("piece",)


@jax.custom_jvp
def _entry(times: Any, row: Any) -> Any:
    """One entry of a row of times.

    Its derivative is a sum over the row, because that of an index, in reverse, is one that the compiler
    does not take in a fused time loop.
    """
    return times[row]


@_entry.defjvp
def _entry_jvp(primals, tangents):
    times, row = primals
    chosen = jnp.arange(times.size, dtype=row.dtype) == row
    return _entry(times, row), jnp.sum(jnp.where(chosen, tangents[0], 0.0))


_pieced = instance(Pieced, "a Pieced, as `start` makes it")


class WithBreaks(AbstractSystemWrapper):
    r"""The same system, with the times at which its load or its field jumps or bends.

    The motion lands on each of the `times` $t_b$ and goes on behind it: up to $t_b$ the system is
    given times before $t_b$ only, afterwards $t_b$ and later ones. So a load such as
    `jnp.where(t >= 2.0, 5.0, 0.0)` has its value before the jump until the jump, exactly. Where the
    jump violates a guard, the transition of that guard follows in the same instant.

    A jump that is not declared is found too, by ever shorter steps; it is flagged as discontinuous
    because the derivative by its time is lost. Here it is exact, by the saltation formula:

    >>> from typing import Any, ClassVar, NamedTuple
    >>> import jax
    >>> import jax.numpy as jnp
    >>> import stickslip as ss
    >>> from stickslip.systems import Motion
    >>> class Pushed(ss.AbstractSmoothSystem):
    ...     begin: Any
    ...     def vector_field(self, t, y, mode, args):
    ...         return Motion(x=y.v, v=jnp.where(t >= self.begin, 2.0, 0.0))
    >>> def end(begin):  # (t - begin)^2 at t = 3
    ...     pushed = ss.WithBreaks(Pushed(begin), jnp.stack([begin]))
    ...     return ss.simulate(pushed, 0.0, 3.0, pushed.start(Motion(0.0, 0.0))).y1.y.x
    >>> print(f"{end(jnp.asarray(1.0)):.6f}, {jax.grad(end)(jnp.asarray(1.0)):.6f}")
    4.000000, -4.000000

    - State `Pieced`; `start(y, t)` makes one. One more guard, the time to the next break [s].
    - `times` [s]: a vector that does not decrease; equal ones are one break. They may be parameters
      that are differentiated. Between two breaks the system's own `time_scale` holds.

    **Errors** `TypeError` unless `system` is a hybrid system, `ValueError` for times that decrease or
    are not finite.
    """

    system: AbstractHybridSystem
    times: Float[Array, " break"]

    def __init__(self, system: Given[AbstractHybridSystem], times: Row):
        self.system = check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
        self.times = as_parameter(check_finite("times", times))
        if self.times.ndim != 1 or self.times.size == 0:
            raise shape_refusal("times", times, "one row of times")
        check_increasing("times", times, equal=True)

    _own_guards: ClassVar = ("the load breaks",)

    @property
    def _own_scales(self) -> tuple:
        """The largest of the times."""
        last = jnp.max(jnp.abs(self.times))
        return (jnp.where(last > 0.0, last, 1.0),)

    @property
    def units(self) -> dict[str, str]:
        """Those of `system`."""
        return {**self.system.units, "piece": "1"}

    @check_arguments(y=_pieced)
    def inner(self, y, args):
        return y.y, args

    @check_arguments(y=whole_state, t=time)
    def start(self, y: PyTree, t: Numeric = 0.0) -> Pieced:
        """State at time `t` [s]; a break at `t` itself is past."""
        return Pieced(y, jnp.sum((self.times <= t).astype(jnp.float64)))

    def _next(self, piece: Any) -> Any:
        row = jnp.clip(piece, 0, self.times.size - 1).astype(jnp.int32)
        return jnp.where(piece >= self.times.size, ACCURACY.far, _entry(self.times, row))

    def _inside(self, t: Any, piece: Any) -> Any:
        """`t`, or the first or last instant of the piece: with the slope 1 in all cases.

        A break is located to rounding, and a lane may come out on either side of it.
        """
        begin, end = jax.lax.stop_gradient((self._next(piece - 1.0), self._next(piece)))
        begin = jnp.where(piece > 0.0, begin, -ACCURACY.far)
        last = end - ACCURACY.rounding * jnp.abs(end) - 1e-300
        now = jax.lax.stop_gradient(t)
        within = jnp.minimum(jnp.maximum(now, begin), last)
        return jnp.where(within == now, t, within + (t - now))

    def vector_field(self, t, y, mode, args):
        slope = self.system.vector_field(self._inside(t, y.piece), y.y, mode, args)
        return Pieced(slope, jnp.zeros_like(y.piece))

    def guards(self, t, y, mode, args):
        inside = self._inside(t, y.piece)
        return (*self.system.guards(inside, y.y, mode, args), self._next(y.piece) - t)

    def transition(self, t, y, mode, guard, args):
        number = len(self.system.guard_names)
        if not number:
            return Pieced(y.y, y.piece + 1.0), mode
        breaks = guard == number
        mode = jnp.asarray(mode, mode_type(self))
        inside = self._inside(t, y.piece)
        after, new = self.system.transition(inside, y.y, mode, jnp.minimum(guard, number - 1), args)
        past = state_after_jump(self.system, (inside, args), t, y.y, mode, args)
        state, mode = select(breaks, past, (after, jnp.asarray(new, mode_type(self))))
        return Pieced(state, y.piece + jnp.where(breaks, 1.0, 0.0)), mode

    @check_arguments(t=reals, y=_pieced)
    def initial_mode(self, t, y, args):
        return self.system.initial_mode(self._inside(t, y.piece), y.y, args)
