"""A system without events: one vector field."""

from typing import ClassVar

import jax.numpy as jnp

from .system import AbstractHybridSystem


class AbstractSmoothSystem(AbstractHybridSystem):
    r"""One smooth vector field $\dot y = f(t, y)$, one mode, no guard: only `vector_field` is to write.

    Lorenz's equations, for example, which every analysis then takes like a system with friction:

    >>> from typing import Any, ClassVar, NamedTuple
    >>> import stickslip as ss
    >>> class Point(NamedTuple):
    ...     x: Any
    ...     y: Any
    ...     z: Any
    >>> class Lorenz(ss.AbstractSmoothSystem):
    ...     sigma: Any = 10.0
    ...     rho: Any = 28.0
    ...     beta: Any = 8.0 / 3.0
    ...     units: ClassVar = {"x": "1", "y": "1", "z": "1"}
    ...     def vector_field(self, t, u, mode, args):
    ...         return Point(
    ...             self.sigma * (u.y - u.x),
    ...             u.x * (self.rho - u.z) - u.y,
    ...             u.x * u.y - self.beta * u.z,
    ...         )
    >>> run = ss.simulate(Lorenz(rho=0.5), 0.0, 40.0, Point(1.0, 2.0, 3.0))
    >>> bool(abs(run.y1.x) < 1e-8)  # below rho = 1 everything ends at rest
    True
    """

    mode_names: ClassVar = ("motion",)
    guard_names: ClassVar = ()

    def guards(self, t, y, mode, args):
        return ()

    def transition(self, t, y, mode, guard, args):
        return y, mode

    def initial_mode(self, t, y, args):
        return jnp.zeros((), jnp.int32)
