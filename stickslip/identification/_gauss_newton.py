"""Gauss-Newton and Levenberg-Marquardt, from the parts that optimistix offers."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, cast

import equinox as eqx
import jax.numpy as jnp
import lineax as lx
import optimistix as optx

from .._argument_checks import check_arguments, count, number
from .._types import Numeric
from ._accuracy import ACCURACY
from ._bounded import coordinates_after, curvature, kinds_of, within
from ._fit import CODE, Fit
from ._losses import AbstractLoss, loss_or_none
from ._methods import AbstractIterativeMethod, Iteration
from ._sensitivity import Sensitivity

DESCENT = optx.DampedNewtonDescent(linear_solver=lx.QR())


SETTINGS = {"tolerance": number("positive"), "max_steps": count(1), "loss": loss_or_none}


def _info(residual: Any, matrix: Any) -> Any:
    return optx.FunctionInfo.ResidualJac(residual, lx.MatrixLinearOperator(matrix))


class AbstractGaussNewton(AbstractIterativeMethod):
    """Steps of the linear model of the residuals, shortened by a search of optimistix."""

    if TYPE_CHECKING:
        # Not annotated: type checkers would take them for the first fields of every subclass.
        tolerance = cast("float", 0.0)
        max_steps = cast("int", 0)
        _search = cast("optx.AbstractSearch", None)
    else:
        tolerance: eqx.AbstractVar[float]
        max_steps: eqx.AbstractVar[int]
        _search: eqx.AbstractClassVar[optx.AbstractSearch]

    def _sizes(self, matrix, bend) -> Any:
        """Sizes of the coordinates, in which steps are measured: by how much each moves the residuals,
        so that no unit of a value matters."""
        sizes = jnp.sqrt(jnp.sum(matrix**2, axis=0) + bend)
        largest = jnp.max(sizes, initial=0.0)
        return jnp.maximum(sizes, jnp.where(largest > 0.0, ACCURACY.least_sensitivity * largest, 1.0))

    @abc.abstractmethod
    def _limited_step(self, size, full, y, rows, whole) -> tuple[Any, Any]:
        """The step that the search wants at `size`, and whether there is one, where `full` is the
        one to the minimum of the linear model `rows + whole @ step` from `y`."""

    def begin(self, z, rows, space=None):
        residual, matrix = jnp.zeros(rows), jnp.zeros((rows, z.shape[0]))
        search = self._search.init(z, _info(residual, matrix))
        code = jnp.full((), CODE["max_steps_reached"], jnp.int32)
        kinds, last = kinds_of(space, z.shape[0]), jnp.zeros((), bool)
        kept = (z, residual, matrix, jnp.zeros_like(z), search, kinds, last, code)
        return Iteration(z, kept, jnp.zeros((), jnp.int32), jnp.zeros((), bool))

    def advance(self, now, residual, matrix):
        y, old_residual, old_matrix, step, search, kinds, last, _ = now.kept
        first = now.steps == 0
        # `y + step` is where the linear model in the values expects to be, `now.z` the place itself.
        size, accept, _, search = self._search.step(
            first, y, y + step, _info(old_residual, old_matrix), _info(residual, matrix), search
        )
        close = _close(self.tolerance, y, step) & _close(
            self.tolerance, residual, residual - old_residual
        )
        y = jnp.where(accept, now.z, y)
        residual = jnp.where(accept, residual, old_residual)
        matrix = jnp.where(accept, matrix, old_matrix)
        step, far, gain, failed = self._step(kinds, y, size, residual, matrix)
        cost = 0.5 * jnp.sum(residual**2)
        # At the minimum along what the data see: a step along the rest may go on for ever. One step
        # without damping from there is the last, and gives the digits that damping kept back.
        flat = gain <= self.tolerance * cost
        lost = ~jnp.isfinite(cost)
        steps = now.steps + 1
        ended = last | (accept & close)
        last = accept & flat
        ended = ended | (last & (steps >= self.max_steps))
        step = jnp.where(last, far, step)
        code = jnp.where(ended, CODE["successful"], CODE["max_steps_reached"])
        code = jnp.where(failed, CODE["step_not_finite"], code)
        code = jnp.where(lost, CODE["start_not_finite"], code).astype(jnp.int32)
        done = ended | failed | lost | (steps >= self.max_steps)
        kept = (y, residual, matrix, step, search, kinds, last, code)
        return Iteration(coordinates_after(kinds, y, step), kept, steps, done)

    def _step(self, kinds, y, size, residual, matrix):
        """From `y` the shortened step and one with hardly any damping, what that would gain, and
        whether there is none."""
        bend = curvature(kinds, y, residual @ matrix)
        sizes = self._sizes(matrix, bend)
        rows = jnp.concatenate([residual, jnp.zeros_like(y)])
        whole = jnp.concatenate([matrix, jnp.diag(jnp.sqrt(bend))]) / sizes[None, :]
        # A short step does not show what can be gained: it is short where the last were not taken.
        far, _ = descent_step(jnp.asarray(1.0 / ACCURACY.rank), y, rows, whole)
        step, result = self._limited_step(size, far, y, rows, whole)
        change = whole @ far
        gain = -jnp.sum(change * (rows + 0.5 * change))
        step, far = (within(kinds, y, found / sizes) for found in (step, far))
        return step, far, gain, ~jnp.all(jnp.isfinite(step)) | (result != optx.RESULTS.successful)

    def finish(self, space, now):
        y, residual, matrix, _, _, _, _, code = now.kept
        found = Sensitivity(space.names, matrix)
        return Fit(space.values(y), residual, found, now.steps, space, code)


@check_arguments(**SETTINGS)
class GaussNewton(AbstractGaussNewton):
    """Gauss-Newton: the step to the minimum of the linear model, halved until it gains enough.

    Where the data determine all unknowns and the start is near, it takes the fewest steps: none is
    damped. Elsewhere `LevenbergMarquardt` is the safer one: along directions that the data hardly show
    these steps are long. By the line search of optimistix (Armijo's rule).

    **Arguments:** `tolerance`, `max_steps`, `loss` as for `LevenbergMarquardt`. **Raises** `TypeError`,
    `ValueError` for anything else.
    """

    tolerance: float = eqx.field(static=True, default=1e-8)
    max_steps: int = 64
    loss: AbstractLoss | None = None
    _search: ClassVar = optx.BacktrackingArmijo()

    def _limited_step(self, size, full, y, rows, whole) -> tuple[Any, Any]:
        return size * full, optx.RESULTS.successful


class AbstractDamped(AbstractGaussNewton):
    """Steps damped by a trust region, whose size begins with 1 over the `damping`."""

    if TYPE_CHECKING:
        damping = cast("Numeric", 1.0)
    else:
        damping: eqx.AbstractVar[Numeric]

    def _limited_step(self, size, full, y, rows, whole):
        # It waits for the full one: two batched factorisations side by side block each other for ever
        # where XLA has two threads, each holding one and waiting for help with its batch.
        return descent_step(size / self.damping, y, rows, whole + 0.0 * jnp.sum(full))


@check_arguments(damping=number("positive"), **SETTINGS)
class LevenbergMarquardt(AbstractDamped):
    r"""Levenberg-Marquardt: the damped descent and the trust region of optimistix, step by step.

    **Arguments**

    - `damping` $\lambda$ of the first step, $(J^TJ + \lambda D^2)\,\delta = -J^Tr$ with the lengths $D$
      of the columns of $J$, so that units and noise do not matter. More makes the first steps shorter.
    - `tolerance`: relative and absolute, of the coordinates and the residuals; or of the cost, by
      what the next step would gain if the residual were linear. `max_steps`: limit, rejected ones
      included.
    - `loss`: a robust loss such as `Huber()` in place of squares, or `None`.

    **Raises** `TypeError`, `ValueError` for anything else.
    """

    damping: Numeric = 1.0
    tolerance: float = eqx.field(static=True, default=1e-8)
    max_steps: int = 64
    loss: AbstractLoss | None = None
    _search: ClassVar = optx.ClassicalTrustRegion(high_cutoff=0.75, high_constant=5.0)


def descent_step(size: Any, y: Any, rows: Any, matrix: Any) -> Any:
    info = _info(rows, matrix)
    return DESCENT.step(size, DESCENT.query(y, info, DESCENT.init(y, info)))


def _close(tolerance: float, a: Any, change: Any) -> Any:
    """Whether a row has changed by less than the tolerance, relative and absolute."""
    return jnp.all(jnp.abs(change) < tolerance * (1.0 + jnp.abs(a)))
