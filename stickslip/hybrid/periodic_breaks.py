"""A system whose load jumps or bends at times that recur with a period."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._argument_checks import check_arguments, time
from .._types import Given, Numeric, Row
from .._validation import (
    as_parameter,
    check_callable,
    check_finite,
    check_increasing,
    check_type,
    is_concrete,
    one_number,
    refusal,
    shape_refusal,
)
from ._wrapper import AbstractSystemWrapper
from .accuracy import ACCURACY
from .load_jump import state_after_jump
from .names import MadeNames
from .system import AbstractHybridSystem, mode_type
from .tree import select


class WithPeriodicBreaks(AbstractSystemWrapper):
    r"""The same system, with the times at which its load jumps or bends in every period.

    The load has a period $T$ and breaks at $t_1 < \dots < t_n < t_1 + T$ and whole periods before and
    after. The motion lands on each break, $t_b$, and goes on behind it: up to $t_b$ the system is given
    times before $t_b$ only, afterwards $t_b$ and later ones, as by `WithBreaks`. The state is that of
    `system`. Each of its modes is there once for each piece of the period, so that a motion that
    repeats itself is in the same mode again: `continuation` follows its periodic orbits. A mass on a
    spring and a dashpot, under a square wave:

    >>> from typing import Any
    >>> import jax.numpy as jnp
    >>> import stickslip as ss
    >>> from stickslip.continuation import OrbitGuess, periodic_orbit
    >>> from stickslip.systems import Motion
    >>> class Pushed(ss.AbstractSmoothSystem):
    ...     frequency: Any
    ...     def vector_field(self, t, y, mode, args):
    ...         push = jnp.where(jnp.sin(self.frequency * t) >= 0.0, 1.0, -1.0)
    ...         return Motion(x=y.v, v=push - y.x - 0.2 * y.v)
    >>> def times(s):
    ...     return jnp.pi / s.frequency * jnp.arange(2.0)
    >>> def period(s):
    ...     return 2 * jnp.pi / s.frequency
    >>> pushed = ss.WithPeriodicBreaks(Pushed(1.0), times, period)
    >>> orbit = periodic_orbit(pushed, OrbitGuess(Motion(0.0, 1.0), 2 * jnp.pi, t0=0.1), forced=True)
    >>> print(f"{orbit.determinant:.9f}, that is {jnp.exp(-0.4 * jnp.pi):.9f}; flags {orbit.flags}")
    0.284609543, that is 0.284609543; flags 0

    - `times` [s]: a vector that increases, over less than a period; `period` [s]: positive. Both may be
      functions of `system` instead, so that a branch over its frequency moves them; each system of a
      family is to have the same function, for which the programs are kept.
    - One more guard, the time to the next break [s]. Of a single break a period there is a second one,
      at which nothing happens, half a period later.
    - `time_scale`: that of `system`, and at most two fifths of the period without its longest piece.
      Steps longer than twice that, fixed ones or by a `dtmax` of yours, would pass over breaks.

    **Errors** `TypeError` unless `system` is a hybrid system, `ValueError` for times that do not
    increase, are not finite or take a period or more, and for a period that is not positive.
    """

    system: AbstractHybridSystem
    times: Float[Array, " break"] | None
    period: Float[Array, ""] | None
    rules: tuple[Callable | None, Callable | None] = eqx.field(static=True)

    def __init__(
        self,
        system: Given[AbstractHybridSystem],
        times: Row | Callable[[Any], Any],
        period: Numeric | Callable[[Any], Any],
    ):
        self.system = check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
        self.rules = tuple(rule if callable(rule) else None for rule in (times, period))  # pyright: ignore[reportAttributeAccessIssue]
        given = []
        for name, number, rule in zip(("times", "period"), (times, period), self.rules, strict=True):
            if rule is not None:
                check_callable(name, rule, f"{name}(system)", system)
            given.append(number if rule is None else rule(system))
        row, cycle = check_finite("times", given[0]), one_number("period", given[1], "positive")
        if np.ndim(row) != 1 or np.size(row) == 0:
            raise shape_refusal("times", row, "one row of times")
        check_increasing("times", row)
        row, cycle = as_parameter(row), as_parameter(cycle)
        if is_concrete((row, cycle)) and not float(row[-1] - row[0]) < float(cycle):
            raise refusal("times", np.asarray(row), f"within less than the period, {float(cycle)} s")
        self.times = row if self.rules[0] is None else None
        self.period = cycle if self.rules[1] is None else None

    def _cycle(self) -> tuple[Any, Any]:
        """Times of the breaks in one period, at least two, and the period."""
        times, period = (
            number if rule is None else jnp.asarray(rule(self.system), jnp.float64)
            for rule, number in zip(self.rules, (self.times, self.period), strict=True)
        )
        assert times is not None
        assert period is not None
        return jnp.append(times, times[0] + 0.5 * period) if times.size == 1 else times, period

    def _pieces(self) -> tuple[Any, Any, Any]:
        """Begin and end of each piece of one period, the first ends at the first break; the period."""
        times, period = self._cycle()
        return jnp.concatenate([times[-1:] - period, times[:-1]]), times, period

    @property
    def mode_names(self) -> Sequence[str]:
        """Those of `system` in each piece: `"slip, load 1"`, which ends at the first break, and on."""
        return _Names(self.system.mode_names, self._cycle()[0].size)

    _own_guards: ClassVar = ("the load breaks",)

    @property
    def _own_scales(self) -> tuple:
        """The period."""
        return (self._cycle()[1],)

    def time_scale(self, args):
        begin, end, period = self._pieces()
        own, rest = self.system.time_scale(args), ACCURACY.of_rest * (period - jnp.max(end - begin))
        return rest if own is None else jnp.minimum(own, rest)

    def inner(self, y, args):
        return y, args

    def _mode_and_piece(self, mode: Any) -> tuple[Any, Any]:
        """Mode of `system` and the piece."""
        mode, count = jnp.asarray(mode, mode_type(self)), len(self.system.mode_names)
        inner = jnp.where(mode < 0, mode, mode % count).astype(mode_type(self.system))
        return inner, (mode // count).astype(jnp.int32)

    def _mode_of_piece(self, mode: Any, piece: Any) -> Any:
        mode, count = jnp.asarray(mode, mode_type(self)), len(self.system.mode_names)
        return jnp.where(mode < 0, mode, mode + count * jnp.asarray(piece, mode_type(self)))

    def _around(self, t: Any, piece: Any) -> tuple[Any, Any]:
        """Begin and end of a piece in the period that `t` is in, from a little before it begins on."""
        begins, ends, period = self._pieces()
        piece = jnp.clip(piece, 0, ends.size - 1)
        begin, end = _entry(begins, piece), _entry(ends, piece)
        early = ACCURACY.early * (period - (end - begin))
        whole = jax.lax.stop_gradient(jnp.floor((t - begin + early) / period))
        return begin + whole * period, end + whole * period

    def _inside(self, t: Any, piece: Any) -> Any:
        """`t`, or the first or last instant of the piece: with the slope 1 in all cases."""
        begin, end = jax.lax.stop_gradient(self._around(t, piece))
        now = jax.lax.stop_gradient(t)
        away = ACCURACY.some_roundings * (jnp.abs(now) + (end - begin))
        within = jnp.minimum(jnp.maximum(now, begin + away), end - away)
        return jnp.where(within == now, t, within + (t - now))

    def vector_field(self, t, y, mode, args):
        inner, piece = self._mode_and_piece(mode)
        return self.system.vector_field(self._inside(t, piece), y, inner, args)

    def guards(self, t, y, mode, args):
        inner, piece = self._mode_and_piece(mode)
        found = self.system.guards(self._inside(t, piece), y, inner, args)
        return (*found, self._around(t, piece)[1] - t)

    def transition(self, t, y, mode, guard, args):
        inner, piece = self._mode_and_piece(mode)
        number, pieces = len(self.system.guard_names), self._cycle()[0].size
        following = jnp.where(piece + 1 < pieces, piece + 1, 0)
        if not number:
            return y, self._mode_of_piece(inner, following)
        breaks = jnp.asarray(guard) == number
        inside = self._inside(t, piece)
        after, new = self.system.transition(inside, y, inner, jnp.minimum(guard, number - 1), args)
        behind = self._inside(t, following)
        past = state_after_jump(self.system, (inside, args), behind, y, inner, args)
        y, inner = select(breaks, past, (after, jnp.asarray(new, mode_type(self.system))))
        return y, self._mode_of_piece(inner, jnp.where(breaks, following, piece))

    def _piece_at(self, t: Any) -> tuple[Any, Any]:
        """The piece that a time is in, at a break the one that begins there; and since when [s]."""
        times, period = self._cycle()
        late = ACCURACY.some_roundings * (jnp.abs(jnp.asarray(t, jnp.float64)) + period)
        since = jnp.mod(t - times + late, period)
        latest = jnp.argmin(since).astype(jnp.int32)
        return (latest + 1) % times.size, jnp.maximum(since[latest] - late, 0.0)

    @check_arguments(t=time)
    def initial_mode(self, t, y, args):
        piece, _ = self._piece_at(t)
        return self._mode_of_piece(self.system.initial_mode(self._inside(t, piece), y, args), piece)

    def check_start(self, t, y, mode, args):
        """That of `system`; and `ValueError` for a piece of the load that the time is not in."""
        if mode is None:
            return super().check_start(t, y, mode, args)
        if is_concrete((self, t, mode)) and np.ndim(mode) == 0 and int(mode) >= 0:
            begin, end = (float(b) for b in self._around(t, self._mode_and_piece(mode)[1]))
            near = ACCURACY.zero * (end - begin) + ACCURACY.slack * abs(float(t))
            if not begin - near <= float(t) <= end + near:
                name = self.mode_names[int(mode)]
                raise refusal("mode0", name, f"of the piece of the load at {float(t)} s")
        return super().check_start(t, y, self._mode_and_piece(mode)[0], args)

    def constraints(self, t, y, mode, args):
        inner, piece = self._mode_and_piece(mode)
        return self.system.constraints(self._inside(t, piece), y, inner, args)


def beside_break(system: WithPeriodicBreaks, t: Any) -> Any:
    """`t`, or at a break, and hardly before or after it, the middle of the piece behind it [s]."""
    t = jnp.asarray(t, jnp.float64)
    piece, since = system._piece_at(t)
    begin, end = system._around(t, piece)
    after = system._around(end, jnp.where(piece + 1 < system._cycle()[0].size, piece + 1, 0))
    near = ACCURACY.same * (end - begin)
    ends = jnp.where(end - t < near, 0.5 * sum(after), t)
    return jnp.where(since < near, 0.5 * (begin + end), ends)


class _Names(MadeNames):
    """Names of the modes of a system for each piece of its load, made when they are asked for."""

    def __init__(self, names: Sequence[str], pieces: int):
        self.names, self.pieces = names, pieces

    def __len__(self) -> int:
        return len(self.names) * self.pieces

    def name(self, number: int) -> str:
        piece, inner = divmod(number, len(self.names))
        return f"{self.names[inner]}, load {piece + 1}"

    def index(self, value: Any, start: int = 0, stop: int | None = None) -> int:
        name, found, piece = value.rpartition(", load ") if isinstance(value, str) else ("", "", "")
        if found and piece in map(str, range(1, self.pieces + 1)):
            return self.names.index(name) + len(self.names) * (int(piece) - 1)
        raise ValueError(f"{value!r} is not the name of a mode")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Names) and (self.names, self.pieces) == (other.names, other.pieces)

    def __hash__(self) -> int:
        return hash((_Names, self.names, self.pieces))


def _entry(row: Any, number: Any) -> Any:
    """One entry of a short row: a sum, because the compiler takes no index in a fused time loop."""
    chosen = jnp.arange(row.size, dtype=jnp.int32) == jnp.asarray(number, jnp.int32)
    return jnp.sum(jnp.where(chosen, row, 0.0))
