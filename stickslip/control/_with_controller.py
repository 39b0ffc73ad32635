"""A system in the loop of a controller that samples it."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, instance, reals, time, whole_state
from .._types import Given, Numeric
from .._validation import (
    as_float64,
    as_parameter,
    check_count,
    check_type,
    is_concrete,
    one_number,
    refusal,
)
from ..hybrid import AbstractHybridSystem, AbstractSystemWrapper
from ..hybrid.accuracy import ACCURACY
from ..hybrid.load_jump import state_after_jump
from ..hybrid.system import mode_type
from ..hybrid.tree import select
from ._trees import UPDATE, as_tree


class Commanded(NamedTuple):
    """Arguments of a system in a loop: the `output` of its controller, and the `args` of the run."""

    output: Any
    args: PyTree


class Ramp(NamedTuple):
    """An output, or a part of one, that goes on from `value` at a `rate` per second."""

    value: Any
    rate: Any


class Controlled(NamedTuple):
    """State `y` of the system, and what the controller holds between its samples.

    - `state` of the controller; `output`, the one that acts; `queue`, those that will, the next first.
    - `clock`: time left until the next sample [s]; `waits`: 1 from a sample until its output, or the
      one before it in the queue, acts; None where that is one instant.
    """

    y: PyTree
    state: PyTree
    output: PyTree
    queue: tuple
    clock: Any
    waits: Any = None

    held = ("state", "output", "queue", "clock", "waits")


def _parts(output: PyTree, of_ramp: Callable, of_rest: Callable) -> PyTree:
    def is_ramp(part):
        return isinstance(part, Ramp)

    return jax.tree.map(lambda a: (of_ramp if is_ramp(a) else of_rest)(a), output, is_leaf=is_ramp)


def under_command(system: Any, output: PyTree, args: PyTree) -> tuple[Any, PyTree]:
    """The system, with its arguments in a `Commanded`."""
    return system, Commanded(output, args)


def whole_reading(t: Any, y: PyTree, args: PyTree) -> PyTree:
    """The state itself, as measured."""
    return y


_controlled = instance(Controlled, "a Controlled, as `start` makes it")


class WithController(AbstractSystemWrapper):
    r"""The same system in the loop of a controller with a sample time.

    At $t_k = t_o + k T_s$, $k = 0, 1, \dots$, the controller reads the system and computes

        output, state = update(k, t, measured, state, args),      measured = measure(t, y, args)

    The output acts from $t_k + d\,T_s + \tau$ on and is held until the next one acts; before the first
    one it is zero. The system finds it in its arguments: its methods are given
    `args = Commanded(output, args)`. A force that jumps is answered at once: a contact breaks away, or
    goes on to stick. Samples are steps that end there, exactly at $t_k$: they are not searched for, and
    are no events in logs and counts. A block of 1 kg with static friction, under a PID controller:

    >>> import jax
    >>> import stickslip as ss
    >>> from stickslip.control import PID, WithController
    >>> from stickslip.friction import Coulomb
    >>> from stickslip.mechanism import AbstractMechanism, Contact
    >>> class Axis(AbstractMechanism):
    ...     coordinates = {"x": "m"}
    ...     contact_directions = {"guide": {"x": 1}}
    ...     def mass_matrix(self, q):
    ...         return {"x": 1.0}
    ...     def forces(self, t, q, v, args):
    ...         return {"x": args.output}
    ...     def contacts(self, t, q, v, args):
    ...         return {"guide": Contact(Coulomb(1.5, 1.0))}
    >>> def rest(kp):
    ...     pid = PID(kp, 50.0, 10.0, period=0.01)
    ...     loop = WithController(Axis(), pid, pid.period, pid.state())
    ...     return ss.simulate(loop, 0.0, 10.0, loop.start(Axis().state(x=0.1))).y1.y.x
    >>> print(f"{rest(50.0):.12f} m, {jax.grad(rest)(50.0):.9f} m per N/m")
    0.004581286468 m, -0.000673757 m per N/m

    **Arguments**

    - `system`: any hybrid system. A controller in the loop of another one has it as its `system`; of
      two samples at one instant the inner one is taken first.
    - `update`: a function, or an `equinox.Module` that is called, whose numbers then are parameters:
      gains have derivatives. Its `args` are those of the run. `output` and `state` are pytrees of
      numbers, of the same form at every sample; a `Ramp` in an output goes on while it is held.
    - `period` $T_s$ [s], positive; `state`: that of the controller before its first sample.
    - `measure(t, y, args)`: by default the state of `system` as it is; see `encoder_reading`.
    - `delay` $d$: whole periods, an integer; `latency` $\tau$ [s]: from a sample to what it
      moves, `0 <= latency < period`; left out, there is none, and no step for it.
    - `offset` $t_o$ [s]: time of the first sample.
    - `drive(system, output, args) -> (system, args)`: puts the output elsewhere, into a parameter of
      the system for one.

    State `Controlled`; `start(y, t, args)` makes one. A sample at the start of a run belongs to it, and
    one at its end too. Derivatives go through all samples, by `period`, `latency` and `offset` too. By
    readings that are rounded they are zero, and by a static friction that the jump of an output
    overcomes: the stick ends with the sample. Periodic orbits are those forced with a period of
    $n T_s$, from a guess between two samples, such as that of `orbit_guess`; sampled hunting does not
    close in general. `max_steps` of an `Integrator` bounds the attempts, two or more a sample.

    **Errors** `TypeError`, `ValueError` naming the argument; also for an `update` with another `period`
    of its own, and for a state whose next sample is past.
    """

    system: AbstractHybridSystem
    update: Callable
    period: Float[Array, ""]
    initial: PyTree
    measure: Callable
    drive: Callable
    latency: Float[Array, ""] | None
    offset: Float[Array, ""]
    delay: int = eqx.field(static=True)

    def __init__(
        self,
        system: Given[AbstractHybridSystem],
        update: Given[Callable],
        period: Numeric,
        state: PyTree = None,
        *,
        measure: Given[Callable] = whole_reading,
        delay: Given[int] = 0,
        latency: Given[Numeric | None] = None,
        offset: Numeric = 0.0,
        drive: Given[Callable] = under_command,
    ):
        self.system = check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
        self.update = as_tree("update", update, UPDATE, *range(5))
        self.period = as_parameter(one_number("period", period, "positive"))
        own = getattr(update, "period", None)
        if own is not None and is_concrete((own, self.period)) and float(own) != float(self.period):
            raise refusal("period", float(self.period), f"that of `update`, {float(own)} s")
        self.initial = as_float64("state", state)
        self.measure = as_tree("measure", measure, "measure(t, y, args)", *range(3))
        self.drive = as_tree("drive", drive, "drive(system, output, args)", *range(3))
        self.delay = check_count("delay", delay, 0)
        self.offset = as_parameter(one_number("offset", offset))
        self.latency = None
        if latency is not None:
            self.latency = as_parameter(one_number("latency", latency, "not negative"))
            if is_concrete((self.latency, self.period)) and not self.latency < self.period:
                allowed = f"less than the period, {float(self.period)} s (whole ones are a `delay`)"
                raise refusal("latency", float(self.latency), allowed)

    # -- guards: times of samples, and of outputs that begin to act

    @property
    def _own_guards(self) -> tuple[str, ...]:
        return ("a sample",) if self.latency is None else ("a sample", "an output acts")

    @property
    def _own_scales(self) -> tuple:
        return (self.period,) * len(self._own_guards)

    @property
    def scheduled_guards(self) -> tuple[int, ...]:
        """Those of `system`, then its own."""
        first = len(self.system.guard_names)
        return (*self.system.scheduled_guards, *range(first, first + len(self._own_guards)))

    @property
    def units(self) -> dict[str, str]:
        """Those of `system`; the clock is in seconds."""
        return {**self.system.units, "clock": "s"}

    def _next(self, t: Any, y: Controlled) -> Any:
        """Number of the next sample: the clock says which, whose rounding is then away."""
        t, clock, period, offset = stop_gradient((t, y.clock, self.period, self.offset))
        return jnp.round((t + clock - offset) / period)

    def _time_of(self, number: Any) -> Any:
        return self.offset + number * self.period

    def _under(self, output: PyTree, args: PyTree) -> tuple[Any, PyTree]:
        return self.drive(self.system, _parts(output, lambda a: a.value, lambda a: a), args)

    def inner(self, y, args):
        return y.y, self._under(y.output, args)[1]

    def vector_field(self, t, y, mode, args):
        system, given = self._under(y.output, args)
        still = jax.tree.map(jnp.zeros_like, y)
        return still._replace(
            y=system.vector_field(t, y.y, mode, given), clock=-jnp.ones_like(y.clock),
            output=_parts(y.output, lambda a: Ramp(a.rate, jnp.zeros_like(a.rate)), jnp.zeros_like),
        )  # fmt: skip

    def guards(self, t, y, mode, args):
        system, given = self._under(y.output, args)
        number = self._next(t, y)
        own = (self._time_of(number) - t,)
        if self.latency is not None:
            own += (self._time_of(number - stop_gradient(y.waits)) + self.latency - t,)
        return (*system.guards(t, y.y, mode, given), *own)

    def transition(self, t, y, mode, guard, args):
        system, given = self._under(y.output, args)
        first, mode = len(self.system.guard_names), jnp.asarray(mode, mode_type(self))
        guard = jnp.asarray(guard)
        own = self._behind_sample(t, y, args)
        if self.latency is not None:
            own = select(guard == first, own, y)
        acts = own._replace(
            output=own.queue[0], queue=(*own.queue[1:], own.queue[-1])[: len(y.queue)],
            waits=None if y.waits is None else jnp.zeros_like(y.waits),
        )  # fmt: skip
        behind, new = self._under(acts.output, args)
        after, found = state_after_jump(behind, (t, given), t, y.y, mode, new)
        acts = acts._replace(y=after), found
        if self.latency is not None:
            acts = select(guard == first + 1, acts, (own, mode))
        if not first and not self.system.answers_jumps:
            return acts
        after, found = system.transition(t, y.y, mode, jnp.minimum(guard, first - 1), given)
        return select(guard < first, (y._replace(y=after), jnp.asarray(found, mode.dtype)), acts)

    def _update(self, number: Any, t: Any, y: PyTree, state: PyTree, args: PyTree) -> tuple:
        """Output and state of the controller behind a sample."""
        measured, now = self.measure(t, y, args), self._time_of(number)
        found = self.update(number.astype(jnp.int32), now, measured, state, args)
        if not isinstance(found, tuple) or len(found) != 2:
            raise refusal("update(...)", found, "a pair, (output, state)", TypeError)
        return jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), found)

    def _behind_sample(self, t: Any, y: Controlled, args: PyTree) -> Controlled:
        """Behind a sample, its output last in the queue, which then is one longer than the delay."""
        number = self._next(t, y)
        output, state = self._update(number, t, y.y, y.state, args)
        return y._replace(
            state=state, queue=(*y.queue[: self.delay], output), clock=self._time_of(number + 1.0) - t,
            waits=None if y.waits is None else jnp.ones_like(y.waits),
        )  # fmt: skip

    # -- the start

    @check_arguments(y=whole_state, t=time)
    def start(self, y: PyTree, t: Numeric = 0.0, args: PyTree = None) -> Controlled:
        """State at time `t` [s] with the controller as it begins; a sample at `t` is still to come.

        `args`: those of the run. Raises `ValueError`, `TypeError` for an `update` that does not return
        an output and a state like the one before.
        """
        t, y = jnp.asarray(t, jnp.float64), as_float64("y", y)

        def sample(t, y, state):
            return state, *self._update(jnp.zeros(()), t, y, state, args)

        before, output, state = eqx.filter_eval_shape(sample, t, y, self.initial)
        if not _alike(state, before):
            raise refusal("update(...)[1]", state, f"of the form of the state before, {before}")
        zero = jax.tree.map(lambda a: jnp.zeros(a.shape, jnp.float64), output)
        late = (t - self.offset) / self.period
        number = jnp.maximum(jnp.ceil(late - ACCURACY.some_roundings * (1.0 + jnp.abs(late))), 0.0)
        clock = stop_gradient(jnp.maximum(self._time_of(number) - t, 0.0))
        waits = None if self.latency is None else jnp.zeros(())
        later = self.delay + (self.latency is not None)
        return Controlled(y, self.initial, zero, (zero,) * later, clock, waits)

    def check_start(self, t, y, mode, args):
        """That of `system`; raises `ValueError` for a state whose next sample is past."""
        if not isinstance(y, Controlled):
            raise refusal("y0", y, "a Controlled, as `start` makes it", TypeError)
        if is_concrete((self.period, self.offset, t, y.clock)):
            left = float(self._time_of(self._next(t, y)) - t)
            if left < -ACCURACY.some_roundings * (abs(float(t)) + float(self.period)):
                allowed = f"that of a sample at {float(t)} s or later, as `start(y, {float(t)})` has it"
                raise refusal("y0.clock", float(y.clock), allowed)
        system, given = self._under(y.output, args)
        system.check_start(t, y.y, mode, given)

    @check_arguments(t=reals, y=_controlled)
    def initial_mode(self, t, y, args):
        system, given = self._under(y.output, args)
        return system.initial_mode(t, y.y, given)

    # -- the rest is that of the system, with the output that acts

    def constraints(self, t, y, mode, args):
        system, given = self._under(y.output, args)
        return system.constraints(t, y.y, mode, given)

    def switches_in(self, t, y, mode, args):
        system, given = self._under(y.output, args)
        return system.switches_in(t, y.y, mode, given)


def _alike(a: PyTree, b: PyTree) -> bool:
    """Whether two trees of shapes are the same."""
    (a, form), (b, other) = jax.tree.flatten(a), jax.tree.flatten(b)
    return form == other and all(x.shape == z.shape for x, z in zip(a, b, strict=True))
