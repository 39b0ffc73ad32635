"""Description of a mode-switched (hybrid) system: the one interface every analysis knows."""

import abc
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._show import AbstractShown
from .._types import Numeric, Whole
from .._validation import MOST, check_callable, leaves_of, numbers, refusal, whole_number

if not TYPE_CHECKING:
    from equinox import AbstractClassVar

DIRECTIONS = ("rising", "falling", "both")


def mode_type(system: Any) -> Any:
    """Type of the numbers of modes: of 64 bits where there are more than 32 bits can tell apart."""
    return jnp.int64 if len(system.mode_names) > 2**31 else jnp.int32


class AbstractHybridSystem(AbstractShown):
    r"""A few smooth vector fields, guards between them, jumps in the mode and the state.

    In mode $m$ the state follows $\dot y = f_m(t, y)$ as long as no guard of that mode fires. A guard
    is a scalar function $g_i(t, y, m)$; it fires when it crosses zero in its direction. Then
    $(y, m) \mapsto$ `transition(t, y, m, i)` and the motion goes on in the new mode.

    Write a system as a subclass. Its parameters are its fields, so that `jax.vmap`, `jax.grad` and
    `jax.jit` reach them; nothing else is needed for sweeps, gradients, Poincaré maps or
    identification. A stick-slip oscillator (mass $m$ on a belt of speed $v_b$, spring $k$, friction
    $F_s$ at rest and $F_k$ in motion):

    ```python
    from typing import ClassVar, NamedTuple
    import jax.numpy as jnp
    import stickslip as ss

    class State(NamedTuple):
        x: float   # displacement [m]
        v: float   # speed [m/s]

    class Oscillator(ss.AbstractHybridSystem):
        mass: float
        stiffness: float
        static_force: float
        kinetic_force: float
        belt_speed: float

        mode_names: ClassVar = ("stick", "slip")
        guard_names: ClassVar = ("force reaches its static limit", "speed reaches the belt's")
        units: ClassVar = {"x": "m", "v": "m/s"}

        def vector_field(self, t, y, mode, args):
            slip = (self.kinetic_force - self.stiffness * y.x) / self.mass
            return State(x=y.v, v=jnp.where(mode == 0, 0.0, slip))

        def guards(self, t, y, mode, args):            # positive inside the mode, 0 at its border
            stick = mode == 0
            return (
                jnp.where(stick, self.static_force - self.stiffness * y.x, 1.0),
                jnp.where(stick, 1.0, self.belt_speed - y.v),
            )

        def transition(self, t, y, mode, guard, args):
            return State(x=y.x, v=self.belt_speed), 1 - mode

        def initial_mode(self, t, y, args):
            return jnp.where(y.v == self.belt_speed, 0, 1)

    system = Oscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    solution = ss.simulate(system, 0.0, 50.0, State(x=0.0, v=0.2))
    print(f"x(50) = {solution.y1.x:.10f} after {solution.num_events} events")
    ```

    **Contract**

    - `vector_field(t, y, mode, args) -> dy`: same structure as `y`. `mode` is an integer scalar,
      traced: choose with `jnp.where`, or list one function per mode and call
      `switch(mode, functions, ...)`. Each branch must be smooth through its own border (use the
      sign that belongs to the mode, not `sign(v)`).
    - `guards(t, y, mode, args) -> tuple of scalars`, one per entry of `guard_names`. With the
      default direction `"falling"`, positive means inside the mode; a guard that does not belong to
      `mode` returns a positive constant. `guard_directions` may say `"rising"` or `"both"`: such a
      guard fires at every change of its sign, and once it has fired has the sign that it goes to. So
      does a mark that acts in one direction alone: its `transition` changes nothing on the way back.
      A guard is taken as violated below `-1e-12` of its magnitude: by default, how much it changes
      as the state goes from zero to the largest values of the motion so far, or its own largest value
      in this mode where that is more; `guard_scales` states magnitudes instead (a property may compute
      them; `None` for one that is not stated).
    - `transition(t, y, mode, guard, args) -> (y, mode)`: called at the located zero of guard number
      `guard`. It must return a mode that is admissible right afterwards; `-1` where there is none
      (the lane then ends with `RESULTS.no_admissible_mode`).
    - `initial_mode(t, y, args) -> mode`: admissible mode of a state; `-1` where there is none.
    - `switches(t, y, mode, args)`, if wanted: where the field bends or jumps in ways that its program
      does not show. Shown ones need no declaration.
    - `constraints(t, y, mode, args)`, if wanted: what is zero as long as a mode lasts.
    - `mode_names`, `guard_names`, `units` (component name to SI unit) are class attributes. So are, if
      wanted, `parameter_units` (parameter name to SI unit), which `repr` and sweeps show, and `periods`
      (component name to period, as `{"theta": 2 * math.pi}`) of components that come back to where they
      were: the motion is the same at `theta` and at `theta` plus its period. Observables and pictures
      then give them within half a period of zero, and a motion that goes round can have a period.

    A system without events derives from `AbstractSmoothSystem`, one around another system from
    `AbstractSystemWrapper`.

    The state is a pytree of scalars or arrays: a `NamedTuple`, an `equinox.Module` or a dictionary, so
    that `vmap` gives a structure of arrays and labelled output has names. Of an array `x` the analyses
    know `"x"`, with all its numbers, and each of them: `"x[0]"`, `"x[1]"`, of a matrix `"x[0, 1]"`.
    """

    if TYPE_CHECKING:
        # To type checkers what is annotated here is either an attribute of the class or a property,
        # and a subclass may have neither the other nor a narrower type. Without annotations it may.
        mode_names = cast("Sequence[str]", ())
        guard_names = cast("tuple[str, ...]", ())
        units = cast("Mapping[str, str]", {})
        periods = cast("Mapping[str, float]", {})
        guard_directions = cast("tuple[str, ...] | None", None)
        guard_scales = cast("Any", None)
    else:
        mode_names: AbstractClassVar[Sequence[str]]
        guard_names: AbstractClassVar[tuple[str, ...]]
        units: ClassVar[Mapping[str, str]] = {}
        periods: ClassVar[Mapping[str, float]] = {}
        guard_directions: ClassVar[tuple[str, ...] | None] = None
        guard_scales: ClassVar[Any] = None

    @property
    def continuous_guards(self) -> tuple[int, ...]:
        """Guards, by number, at which neither state nor field jumps: they do not flag a run."""
        return ()

    @property
    def scheduled_guards(self) -> tuple[int, ...]:
        """Guards, by number, that are the time left until an instant that is known [s].

        Steps land on their zeros, which are not searched for, and they are neither logged nor counted.
        """
        return ()

    @property
    def answers_jumps(self) -> bool:
        """Whether `transition` takes the constant -1 for a guard: a load has jumped at a declared time.

        It then says what the jump brings about all at once; of other systems the guards are asked.
        """
        return False

    def time_scale(self, args: PyTree) -> Any:
        r"""Shortest time [s] in which a load changes by its own size, of the time or of the state.

        $1/\omega$ for a load $\sin\omega t$, a quarter of its width for a pulse, infinity for a
        load that is constant between declared breaks; for the bump of a cam the time in which it is
        passed, over four. `None`, the default: not known; `AdaptiveStep` says how steps are bounded
        then, and which loads of the state count. It has no effect where there are none.
        """
        return None

    def switches(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> tuple:
        """Scalars at whose changes of sign the field bends or jumps without showing it.

        Comparisons of a field by `jnp.where`, `jnp.maximum`, `jnp.clip`, `jnp.interp` and the like is
        found without them; decisions of a long loop, a function from elsewhere or the time are not. The
        motion lands on each change of sign as on a guard, without an event: the state, the mode and
        the log go on unchanged. Up to there the field is given states on the one side only, behind it
        on the other, so that derivatives are exact. Each must change with the state or the time.
        """
        return ()

    def switches_in(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> tuple:
        """`switches` as the engine asks for them; a class that declares them otherwise overrides it."""
        return tuple(self.switches(t, y, mode, args))

    def check_start(self, t: Numeric, y: PyTree, mode: Whole | None, args: PyTree) -> None:
        """Raise `ValueError` for a state that no motion can begin with; by default it raises nothing.

        `simulate` calls it before anything is compiled, with the `mode` that the user names, in which
        the state may be impossible, or None. Numbers may be traced: these pass unread.
        """

    def constraints(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> tuple | None:
        """Scalars that are zero in every state that can be in `mode`; `None`, the default: not known.

        The sliding speed of each contact that sticks [m/s], the gap of each stop that is closed [m] and
        its rate. As `mode` is traced, there is one entry for each contact, with the constant 0 where
        it slides. Exponents and multipliers measure deviations that keep to them.
        """
        return None

    def held_state(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> PyTree:
        """The state moved by its error onto what `mode` holds; by default as it is.

        Results are handed out so: what sticks on a surface that moves has the speed of that, not of
        its steps, and a run that goes on from there finds it at rest.
        """
        return y

    @abc.abstractmethod
    def vector_field(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> PyTree:
        """Time derivative of the state in `mode`, with the structure of `y` [unit of y per s]."""

    @abc.abstractmethod
    def guards(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> tuple:
        """Values of all guards, a tuple of scalars in the order of `guard_names`."""

    @abc.abstractmethod
    def transition(
        self, t: Numeric, y: PyTree, mode: Whole, guard: Whole, args: PyTree
    ) -> tuple[PyTree, Any]:
        """State and mode right after guard number `guard` has fired."""

    @abc.abstractmethod
    def initial_mode(self, t: Numeric, y: PyTree, args: PyTree) -> Any:
        """An admissible mode for the state `y` at time `t`, or -1."""


def switch(mode: Whole, functions: tuple[Callable, ...], *operands: PyTree) -> PyTree:
    """`functions[mode](*operands)` by `jax.lax.switch`, jit-able and batched.

    Under `vmap` with a mode per lane every branch is evaluated and the lane's own one selected, so
    each branch must be free of NaN where it is not selected if gradients are wanted. A mode below 0
    takes the first function, one beyond the last the last.

    Errors: `TypeError` for a mode that is not an integer and for guards that are not a sequence.
    """
    if not isinstance(functions, tuple | list) or not functions:
        raise refusal("functions", functions, "a sequence of at least one function", TypeError)
    for i, function in enumerate(functions):
        check_callable(f"functions[{i}]", function, "f(*operands)", *operands)
    for where, leaf in leaves_of("operands", operands):
        # Whatever else JAX can trace has a type of its own there: keys of random numbers, for one.
        if not isinstance(leaf, bool | jax.Array | np.bool_):
            numbers(where, leaf)
    whole_number("mode", mode, -MOST, MOST)
    index = jnp.clip(jnp.asarray(mode, jnp.int32), 0, len(functions) - 1)
    return jax.lax.switch(index, functions, *operands)


def guard_directions(system: AbstractHybridSystem) -> tuple[str, ...]:
    """Direction words of all guards, `"falling"` where the system is silent."""
    return _of_each_guard(system, "guard_directions", "falling")


def guard_scales(system: AbstractHybridSystem) -> tuple:
    """Stated magnitudes of all guards, 1 where the system is silent."""
    return _of_each_guard(system, "guard_scales", 1.0)


def _of_each_guard(system: AbstractHybridSystem, name: str, silent: Any) -> tuple:
    given = getattr(system, name)
    if given is None or given == ():
        return (silent,) * len(system.guard_names)
    if not isinstance(given, tuple | list):
        allowed = "a tuple with an entry for each guard (not a method; a property may compute it)"
        raise refusal(name, given, allowed, TypeError)
    return tuple(given)
