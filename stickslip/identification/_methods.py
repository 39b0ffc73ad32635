"""Iterative methods, each a step from one evaluation of residual and Jacobian to the next.

What evaluates them is the caller's business: a loop under `jit`, or a loop on the host that hands
many starts at once to one compiled program.
"""

import abc
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import equinox as eqx
import jax
from jaxtyping import Array, Bool, Float, Int

from .._checked import CheckedModule
from ._evaluate import Evaluation
from ._fit import Fit
from ._losses import AbstractLoss
from ._unknowns import Space


class Iteration(NamedTuple):
    """How far a method has come: `z`, where it wants the next evaluation, and what it keeps."""

    z: Float[Array, " unknown"]
    kept: Any
    steps: Int[Array, ""]
    done: Bool[Array, ""]


class AbstractMethod(eqx.Module, metaclass=CheckedModule):
    """A method for one start; `jax.vmap` over its functions serves many.

    `loss`: an `AbstractLoss` in place of the squares of the residuals, or `None`.
    """

    if TYPE_CHECKING:
        loss = cast("AbstractLoss | None", None)  # not annotated, or it is the first field to checkers
    else:
        loss: eqx.AbstractVar[AbstractLoss | None]

    @abc.abstractmethod
    def begin(self, z: Float[Array, " unknown"], rows: int, space: Space | None = None) -> Iteration:
        """Before the first evaluation; without a `space` every coordinate is open."""

    @abc.abstractmethod
    def advance(
        self,
        now: Iteration,
        residual: Float[Array, " row"],
        matrix: Float[Array, "row unknown"],
    ) -> Iteration:
        """After an evaluation at `now.z`."""

    @abc.abstractmethod
    def finish(self, space: Space, now: Iteration) -> Fit:
        """Result."""

    def solve(self, evaluate: Evaluation, space: Space, z: Float[Array, " unknown"]) -> Fit:
        """From one start, under `jit` and `vmap`."""
        once = jax.jit(evaluate)  # traced once for its shape and for the loop
        rows = jax.eval_shape(once, z)[0].shape[0]

        def step(now):
            return self.advance(now, *once(now.z))

        return self.finish(
            space, jax.lax.while_loop(lambda now: ~now.done, step, self.begin(z, rows, space))
        )
