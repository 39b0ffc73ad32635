"""A hybrid system together with time integrals along its motion."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from .._argument_checks import check_arguments, instance, time, whole_state
from .._types import Numeric
from .._validation import check_callable, check_mapping, check_type, refusal
from ..hybrid import AbstractHybridSystem, AbstractSystemWrapper

Integrands = Callable[[AbstractHybridSystem, Any, PyTree, Any, PyTree], Mapping[str, Any]]


class Augmented(NamedTuple):
    """State `y` of the system and the integrals so far, by name."""

    y: PyTree
    integrals: dict[str, Any]


class WithIntegrals(AbstractSystemWrapper):
    r"""The same system with more state: $\dot I_i = p_i(t, y, m)$, integrated with the motion.

    Modes, guards and transitions are those of `system`, so it can be used wherever the original
    system can. The integrals obey the step-size control like any component and have derivatives.

    >>> import stickslip as ss
    >>> from stickslip.derived import WithIntegrals
    >>> from stickslip.systems import CoulombOscillator, Motion
    >>> block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    >>> ledger = WithIntegrals(block, CoulombOscillator.powers, units={"belt": "J", "friction": "J"})
    >>> solution = ss.simulate(ledger, 0.0, 9.0, ledger.start(Motion(x=0.0, v=0.2)))
    >>> state, work = solution.y1
    >>> gain = block.energy(state) - 0.5 * 0.2**2
    >>> bool(abs(work["belt"] + work["friction"] - gain) < 1e-9)
    True

    **Arguments:**

    - `system`: any hybrid system.
    - `integrands(system, t, y, mode, args)`: dict of named scalars. It is handed the system, so that
      its parameters are those being differentiated or batched; an unbound method does.
    - `units`: unit of each integral, by name; added to those of the system.

    **Errors** `TypeError` if they are not a hybrid system and a function, `ValueError` for an
    integral named like a component of the state.
    """

    system: AbstractHybridSystem
    integrands: Integrands = eqx.field(static=True)
    integral_units: tuple[tuple[str, str], ...] = eqx.field(static=True)

    def __init__(
        self,
        system: AbstractHybridSystem,
        integrands: Integrands,
        *,
        units: Mapping[str, str] | None = None,
    ):
        self.system = check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
        form = "f(system, t, y, mode, args) -> named scalars"
        self.integrands = check_callable("integrands", integrands, form, *range(5))
        named = check_mapping("units", units)
        for name, unit in named.items():
            check_type(f"units[{name!r}]", unit, str, "a unit, a text")
        self.integral_units = tuple(named.items())
        for name, _ in self.integral_units:
            if name in system.units:
                taken = f"named unlike the components of the state, {', '.join(system.units)}"
                raise refusal(f"units[{name!r}]", named[name], taken)

    @property
    def units(self) -> dict[str, str]:
        """Those of the system and of the integrals."""
        return {**self.system.units, **dict(self.integral_units)}

    @check_arguments(y=instance(Augmented, "an Augmented, as `start` makes it"))
    def inner(self, y, args):
        return y.y, args

    @check_arguments(y=whole_state, t=time)
    def start(self, y: PyTree, t: Numeric = 0.0, args: PyTree = None) -> Augmented:
        """Initial state: `y` with all integrals zero."""
        mode = jnp.zeros((), jnp.int32)

        def rates(t, y):
            return dict(self.integrands(self.system, t, y, mode, args))

        y = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), y)
        shapes = eqx.filter_eval_shape(rates, jnp.asarray(t, jnp.float64), y)
        return Augmented(y, jax.tree.map(lambda s: jnp.zeros(s.shape, jnp.float64), shapes))

    def vector_field(self, t, y, mode, args):
        rates = self.integrands(self.system, t, y.y, mode, args)
        return Augmented(self.system.vector_field(t, y.y, mode, args), dict(rates))

    def transition(self, t, y, mode, guard, args):
        after, mode = self.system.transition(t, y.y, mode, guard, args)
        return Augmented(after, y.integrals), mode
