"""Iterative methods, each a step from one evaluation of residual and Jacobian to the next.

What evaluates them is the caller's business: a loop under `jit`, or a loop on the host that hands
many starts at once to one compiled program.
"""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from .._validation import check_count, check_type, one_number
from ._evaluate import Evaluation
from ._fit import Fit
from ._sensitivity import Sensitivity
from ._unknowns import Space


class Iteration(NamedTuple):
    """How far a method has come: `z`, where it wants the next evaluation, and what it keeps."""

    z: Float[Array, " unknown"]
    kept: Any
    steps: Int[Array, ""]
    done: Bool[Array, ""]


class AbstractMethod(eqx.Module):
    """A method for one start; `jax.vmap` over its functions serves many."""

    @abc.abstractmethod
    def begin(self, z: Float[Array, " unknown"], rows: int) -> Iteration:
        """Before the first evaluation."""

    @abc.abstractmethod
    def advance(
        self,
        now: Iteration,
        residual: Float[Array, " row"],
        matrix: Float[Array, "row unknown"],
    ) -> Iteration:
        """After an evaluation at `now.z`."""

    @abc.abstractmethod
    def fit(self, space: Space, now: Iteration) -> Fit:
        """Result."""

    def solve(self, evaluate: Evaluation, space: Space, z: Float[Array, " unknown"]) -> Fit:
        """From one start, under `jit` and `vmap`."""
        once = jax.jit(evaluate)  # traced once for its shape and for the loop
        rows = jax.eval_shape(once, z)[0].shape[0]

        def step(now):
            return self.advance(now, *once(now.z))

        return self.fit(space, jax.lax.while_loop(lambda now: ~now.done, step, self.begin(z, rows)))


@jax.custom_jvp
def _known(z, residual, matrix):
    """The residual at `z`, given with its Jacobian: a function that optimistix can linearise."""
    return residual


@_known.defjvp
def _known_jvp(primals, tangents):
    _, residual, matrix = primals
    return residual, matrix @ tangents[0]


def _foreseen(info, step):
    """Fall of the cost over a step if the residual were linear."""
    change = info.jac.mv(step)
    return -jnp.sum(change * (info.residual + 0.5 * change))


class LevenbergMarquardt(AbstractMethod):
    """Levenberg-Marquardt of optimistix, step by step."""

    damping: float
    tolerance: float = eqx.field(static=True)
    max_steps: int

    def _solver(self):
        return optx.LevenbergMarquardt(rtol=self.tolerance, atol=self.tolerance)

    def _start(self, z, residual, matrix):
        def known(z, args):
            return _known(z, *args), None

        shape = jax.ShapeDtypeStruct(residual.shape, residual.dtype)
        common = (known, z, (residual, matrix), {})
        return common, self._solver().init(*common, shape, None, frozenset())

    def begin(self, z, rows):
        empty = jnp.zeros(rows), jnp.zeros((rows, z.shape[0]))
        state = eqx.filter(self._start(z, *empty)[1], eqx.is_array)
        never = jnp.zeros((), bool)
        return Iteration(z, (z, state, never), jnp.zeros((), jnp.int32), never)

    def advance(self, now, residual, matrix):
        y, arrays, _ = now.kept
        # The method begins with damping 1: scaled residuals see `damping` instead.
        scale = 1.0 / jnp.sqrt(self.damping)
        (known, _, args, options), like = self._start(y, scale * residual, scale * matrix)
        # A state holds functions besides its arrays; those of this trace take the place of the old.
        state = eqx.combine(arrays, eqx.filter(like, eqx.is_array, inverse=True))
        solver, tags = self._solver(), frozenset()
        y_new, state, _ = solver.step(known, y, args, options, state, tags)
        ended, result = solver.terminate(known, y_new, args, options, state, tags)
        failed = ~jnp.all(jnp.isfinite(y_new)) | (result != optx.RESULTS.successful)
        # At the minimum along what the data see: a step along the rest may go on for ever.
        gain = _foreseen(state.f_info, state.y_eval - y_new)
        cost = 0.5 * jnp.sum(state.f_info.residual**2)
        flat = gain <= self.tolerance * cost
        accepted = state.num_accepted_steps > arrays.num_accepted_steps
        ended = ended | (flat & accepted)
        steps = now.steps + 1
        kept = (y_new, eqx.filter(state, eqx.is_array), ended & ~failed)
        return Iteration(state.y_eval, kept, steps, ended | failed | (steps >= self.max_steps))

    def fit(self, space, now):
        y, arrays, successful = now.kept
        scale = 1.0 / jnp.sqrt(self.damping)
        info = arrays.f_info
        empty = jnp.zeros_like(info.residual), jnp.zeros((*info.residual.shape, y.shape[0]))
        like = eqx.filter(self._start(y, *empty)[1], eqx.is_array, inverse=True)
        matrix = eqx.combine(info.jac, like.f_info.jac).as_matrix() / scale
        return Fit(
            space.values(y),
            info.residual / scale,
            Sensitivity(space.names, matrix),
            now.steps,
            successful,
            space,
        )


class GradientDescent(AbstractMethod):
    """An optimiser of optax that follows the gradient; the best point on the way is kept."""

    optimiser: Any = eqx.field(static=True)
    steps: int
    tolerance: float

    def begin(self, z, rows):
        nothing = jnp.full((rows,), jnp.nan), jnp.full((rows, z.shape[0]), jnp.nan)
        best = (jnp.asarray(jnp.inf), z, *nothing)
        return Iteration(
            z, (self.optimiser.init(z), best), jnp.zeros((), jnp.int32), jnp.zeros((), bool)
        )

    def advance(self, now, residual, matrix):
        state, best = now.kept
        cost = 0.5 * jnp.sum(residual**2)
        cost = jnp.where(jnp.isfinite(cost), cost, jnp.inf)
        here = (cost, now.z, residual, matrix)
        best = jax.tree.map(lambda a, b: jnp.where(cost < best[0], a, b), here, best)
        slope = jnp.where(jnp.isfinite(cost), matrix.T @ residual, 0.0)
        change, state = self.optimiser.update(slope, state, now.z)
        steps = now.steps + 1
        z: Any = optax.apply_updates(now.z, change)
        return Iteration(z, (state, best), steps, steps >= self.steps)

    def fit(self, space, now):
        cost, z, residual, matrix = now.kept[1]
        found = Sensitivity(space.names, jnp.where(jnp.isfinite(matrix), matrix, 0.0))
        seen = found.seen()
        along = found.directions @ (found.matrix.T @ residual)
        along = along / jnp.where(seen, found.singular_values, 1.0)
        left = jnp.sqrt(jnp.sum(jnp.where(seen, along, 0.0) ** 2))
        near = jnp.isfinite(cost) & (left < self.tolerance)
        return Fit(space.values(z), residual, found, now.steps, near, space)


def levenberg_marquardt(
    *, damping: float = 1.0, tolerance: float = 1e-8, max_steps: int = 64
) -> LevenbergMarquardt:
    """The method with its options checked; see `least_squares`."""
    one_number("damping", damping, "positive")
    one_number("tolerance", tolerance, "positive")
    check_count("max_steps", max_steps, 1)
    return LevenbergMarquardt(float(damping), float(tolerance), max_steps)


def descent(*, optimiser: Any = None, steps: int = 300, tolerance: float = 0.1) -> GradientDescent:
    """The method with its options checked; see `gradient_descent`."""
    check_count("steps", steps, 1)
    one_number("tolerance", tolerance, "positive")
    if optimiser is None:
        optimiser = optax.adam(optax.cosine_decay_schedule(0.03, steps))
    check_type("optimiser", optimiser, optax.GradientTransformation, "an optimiser of optax")
    return GradientDescent(optimiser, steps, float(tolerance))
