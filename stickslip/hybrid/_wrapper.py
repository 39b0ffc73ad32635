"""A system made of another one: the same modes and guards, around more state or other arguments."""

import abc
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
from jaxtyping import PyTree

from .._argument_checks import check_arguments, reals
from .._types import overridable
from .system import AbstractHybridSystem, guard_directions


class AbstractSystemWrapper(AbstractHybridSystem):
    r"""A system around another one, whose modes, guards, units and periods it has.

    A subclass has the field `system` and says with `inner(y, args)` what of its own state and arguments
    belongs to it; it remains to write `vector_field` and `transition`, and `units` if the state
    holds more. Here, a block with a clock that runs while it sticks:

    >>> from typing import Any, NamedTuple
    >>> import jax.numpy as jnp
    >>> import stickslip as ss
    >>> from stickslip.systems import CoulombOscillator, Motion
    >>> class Clocked(NamedTuple):
    ...     y: Any
    ...     clock: Any  # [s]
    >>> class WithClock(ss.AbstractSystemWrapper):
    ...     system: ss.AbstractHybridSystem
    ...     def inner(self, y, args):
    ...         return y.y, args
    ...     def vector_field(self, t, y, mode, args):
    ...         rate = jnp.where(mode == self.mode_names.index("stick"), 1.0, 0.0)
    ...         return Clocked(self.system.vector_field(t, y.y, mode, args), rate)
    ...     def transition(self, t, y, mode, guard, args):
    ...         after, mode = self.system.transition(t, y.y, mode, guard, args)
    ...         return Clocked(after, y.clock), mode
    >>> block = WithClock(CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2))
    >>> run = ss.simulate(block, 0.0, 8.5, Clocked(Motion(x=0.0, v=0.2), 0.0))
    >>> print(f"{run.y1.clock:.9f} s")  # until the spring pulls with 1 N
    5.000000000 s
    """

    system: eqx.AbstractVar[AbstractHybridSystem]

    @abc.abstractmethod
    def inner(self, y: PyTree, args: PyTree) -> tuple[PyTree, PyTree]:
        """State and arguments of `system`, from those of this one."""

    @property
    def mode_names(self) -> Sequence[str]:
        """Those of `system`."""
        return self.system.mode_names

    # Guards that a wrapper adds behind those of its system, each of which falls; their magnitudes.
    _own_guards = overridable(lambda self: ())
    _own_scales = overridable(lambda self: ())

    @property
    def guard_names(self) -> tuple[str, ...]:
        """Those of `system`, then its own."""
        return (*self.system.guard_names, *self._own_guards)

    @property
    def guard_directions(self) -> tuple[str, ...] | None:
        """Those of `system`, then `"falling"` for its own."""
        return (*guard_directions(self.system), *("falling",) * len(self._own_guards))

    @property
    def guard_scales(self) -> Any:
        """Those of `system` if it states them, then those of its own."""
        stated = self.system.guard_scales
        return None if stated is None else (*stated, *self._own_scales)

    @property
    def units(self) -> Mapping[str, str]:
        """Those of `system`."""
        return self.system.units

    @property
    def periods(self) -> Mapping[str, float]:
        """Those of `system`."""
        return self.system.periods

    @property
    def continuous_guards(self) -> tuple[int, ...]:
        """Those of `system`."""
        return self.system.continuous_guards

    @property
    def scheduled_guards(self) -> tuple[int, ...]:
        """Those of `system`."""
        return self.system.scheduled_guards

    @property
    def answers_jumps(self) -> bool:
        """As `system`; `transition` hands the guard on."""
        return self.system.answers_jumps

    def time_scale(self, args):
        """That of `system`, whose arguments are taken to be these."""
        return self.system.time_scale(args)

    def check_start(self, t, y, mode, args):
        """That of `system`."""
        inner, given = self.inner(y, args)
        self.system.check_start(t, inner, mode, given)

    def constraints(self, t, y, mode, args):
        """Those of `system`."""
        y, args = self.inner(y, args)
        return self.system.constraints(t, y, mode, args)

    def held_state(self, t, y, mode, args):
        """With that of `system` in it."""
        inner, given = self.inner(y, args)
        moved = self.system.held_state(t, inner, mode, given)
        return y if moved is inner else eqx.tree_at(lambda y: self.inner(y, args)[0], y, moved)

    def switches_in(self, t, y, mode, args):
        """Those of `system`."""
        y, args = self.inner(y, args)
        return self.system.switches_in(t, y, mode, args)

    def guards(self, t, y, mode, args):
        y, args = self.inner(y, args)
        return self.system.guards(t, y, mode, args)

    @check_arguments(t=reals)
    def initial_mode(self, t, y, args):
        y, args = self.inner(y, args)
        return self.system.initial_mode(t, y, args)
