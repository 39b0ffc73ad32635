"""Methods of a fit, and iterative ones: each a step from one evaluation of the residuals to the next.

Their evaluation is the caller's business: a loop under `jit`, or a loop on the host that hands
many starts at once to one compiled program.
"""

import abc
import itertools
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._validation import one_static, refusal
from ._evaluate import Evaluation
from ._fit import Fit
from ._losses import AbstractLoss
from ._run import Data, Run
from ._unknowns import NamedValues, Space


class AbstractMethod(eqx.Module):
    """A way to fit a `Problem`: it brings values near an optimum, from where `polish` goes on.

    `polish`: the `AbstractIterativeMethod` that fits the problem itself, as it stands.
    """

    if TYPE_CHECKING:
        polish = cast("AbstractIterativeMethod", None)  # not annotated, or it is the first field
    else:
        polish: eqx.AbstractVar["AbstractIterativeMethod"]

    def check_run(self, run: Run) -> None:
        """Raise `ValueError` for a problem that this method cannot fit."""
        if self.polish.loss is not None and run.kinds > 1:
            raise refusal("loss", self.polish.loss, "None where a KalmanFilter corrects")

    @abc.abstractmethod
    def brought_near(
        self, run: Run, data: Data, space: Space, values: NamedValues
    ) -> tuple[NamedValues, int]:
        """Values from which `polish` begins, and the steps taken to them."""

    def many_near(
        self, run: Run, data: Data, space: Space, values: NamedValues, chunk_size: int | None
    ) -> tuple[NamedValues, int | np.ndarray]:
        """The same from rows of values: here one start after the other."""
        count = next(iter(values.values())).shape[0]
        starts = [{name: row[i] for name, row in values.items()} for i in range(count)]
        ends = [self.brought_near(run, data, space, start) for start in starts]
        near = {name: np.stack([values[name] for values, _ in ends]) for name in values}
        return near, np.array([steps for _, steps in ends])


class Iteration(NamedTuple):
    """How far a method has come: `z`, where it wants the next evaluation, and what it keeps."""

    z: Float[Array, " unknown"]
    kept: Any
    steps: Int[Array, ""]
    done: Bool[Array, ""]


class AbstractIterativeMethod(AbstractMethod):
    """A method for one start; `jax.vmap` over its functions serves many.

    `loss`: an `AbstractLoss` in place of the squares of the residuals, or `None`.
    """

    if TYPE_CHECKING:
        loss = cast("AbstractLoss | None", None)
    else:
        loss: eqx.AbstractVar[AbstractLoss | None]

    @property
    def polish(self) -> "AbstractIterativeMethod":
        """The method itself."""
        return self

    def brought_near(self, run, data, space, values):
        return values, 0

    def many_near(self, run, data, space, values, chunk_size):
        return values, 0

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


def check_falling(name: str, value: Any) -> Any:
    """A tuple of positive numbers, each below the one before it."""
    if not isinstance(value, tuple) or not value:
        raise refusal(name, value, "a tuple of falling numbers", TypeError)
    for i, number in enumerate(value):
        one_static(f"{name}[{i}]", number, "positive")
    if any(b >= a for a, b in itertools.pairwise(value)):
        raise refusal(name, value, "falling")
    return value
