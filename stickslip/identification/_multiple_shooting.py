"""Multiple shooting: fits to long records, along which the phase of the motion would be lost."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from .._checked import CheckedModule
from .._types import Given
from .._validation import check_callable, check_count, check_type, one_static, refusal
from ._levenberg_marquardt import LevenbergMarquardt
from ._plain_damping import PlainDamping
from ._run import Data, Run
from ._shooting import Segments, Shooting, cut, improved, residual_and_jacobian, states_at
from ._unknowns import NamedValues, Space

Guess = Callable[[Any, dict[str, Any], dict[str, Any]], Any]


class MultipleShooting(eqx.Module, metaclass=CheckedModule):
    r"""Every record is cut into segments, each of which begins at a state of its own.

    Over a long record of a motion that sticks and slips, a wrong parameter shifts the phase by whole
    periods, and the squares of the residuals have as many minima. Over a segment they have one. The
    states at the knots are unknowns too; that each segment ends where the next begins is asked for
    ever more strictly, by jumps in units of $w$ times the size of the state, $w$ falling. At last
    `polish` fits the run as a whole from there, so that what is found is a minimum of the same sum of
    squares as without knots, and is reported with the same `Fit`.

    A knot may fall into a time at which a contact sticks: the mode there is that of `initial_mode`.

    **Arguments**

    - `segments`: how many per record, of as many stamps each; half a period of the motion is a good
      length.
    - `guess(t, values, slopes)`: the state at time `t` [s] from what was measured there, by name: the
      values and their slopes by differences. By default the states of a run at the start.
    - `weights`: the $w$, falling. `max_steps`: limit for each of them.
    - `polish`: the method for the whole.

    **Raises** `TypeError`, `ValueError` for anything else.
    """

    segments: int = eqx.field(static=True)
    guess: Given[Guess | None] = eqx.field(static=True, default=None)
    weights: Given[tuple[float, ...]] = eqx.field(static=True, default=(1.0, 0.1, 0.01))
    max_steps: int = eqx.field(static=True, default=40)
    polish: LevenbergMarquardt = eqx.field(default_factory=lambda: LevenbergMarquardt())

    def __check_init__(self):
        check_count("segments", self.segments, 2)
        if self.guess is not None:
            check_callable("guess", self.guess, "f(t, values, slopes)", 0.0, {}, {})
        if not isinstance(self.weights, tuple) or not self.weights:
            raise refusal("weights", self.weights, "a tuple of falling numbers", TypeError)
        for i, weight in enumerate(self.weights):
            one_static(f"weights[{i}]", weight, "positive")
        if any(b >= a for a, b in zip(self.weights, self.weights[1:], strict=False)):
            raise refusal("weights", self.weights, "falling")
        check_count("max_steps", self.max_steps, 1)
        check_type("polish", self.polish, LevenbergMarquardt, "a LevenbergMarquardt(...)")

    def brought_near(
        self, run: Run, data: Data, lengths: tuple[int, ...], space: Space, values: NamedValues
    ) -> tuple[NamedValues, int]:
        """Values from which `polish` converges, and the steps taken to them."""
        if min(lengths) <= self.segments:
            allowed = f"below {min(lengths)}, the number of stamps of the shortest record"
            raise refusal("segments", self.segments, allowed)
        segments = cut(data, lengths, self.segments)
        z = space.coordinates(values)
        states = self._states(run, data, lengths, segments, values)
        scales = np.max(np.abs(states), axis=0)
        scales = np.where(scales > 0.0, scales, 1.0)
        unknown = jnp.concatenate([z, jnp.asarray((states / scales).reshape(-1))])
        taken, size = 0, None
        for weight in self.weights:
            shooting = Shooting(
                run, space, data, segments, jnp.asarray(scales), jnp.asarray(weight), self.polish.loss
            )
            if size is None:
                size = float(jnp.sum(residual_and_jacobian(shooting, unknown)[0] ** 2))
                if not np.isfinite(size):
                    break
            # Small steps at first: the nearest minimum of a segment is the one that is meant.
            damping = jnp.asarray(max(1.0, 10.0 * size * weight**2))
            method = PlainDamping(damping, 1e-3, self.max_steps)
            unknown, _, steps = improved(method, shooting, unknown)
            taken += int(steps)
        return space.values(unknown[: len(space.names)]), taken

    def _states(
        self, run: Run, data: Data, lengths: tuple[int, ...], segments: Segments, values: NamedValues
    ) -> np.ndarray:
        """States at the knots, one row each."""
        if self.guess is None:
            return np.asarray(states_at(run, values, data, segments))
        rows = []
        for g in segments.inner:
            r, t = int(segments.record[g]), segments.begin[g]
            measured, slopes = {}, {}
            for i, (name, _) in enumerate(run.observed):
                times, row = _present(data, r, i, lengths[r])
                if times.size > 1:
                    measured[name] = np.interp(t, times, row)
                    slopes[name] = np.interp(t, times, np.gradient(row, times))
            state = self.guess(t, measured, slopes)
            rows.append(np.asarray(ravel_pytree(jax.tree.map(float, state))[0]))
        return np.stack(rows)


def _present(data: Data, record: int, observed: int, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and values of what was measured of one quantity in one record."""
    shape = data.values.shape
    there = np.zeros(data.values.size, bool)
    there[np.asarray(data.keep)] = True
    there = there.reshape(shape)[record, observed, :length]
    times = np.asarray(data.times)[record, :length][there]
    return times, np.asarray(data.values)[record, observed, :length][there]
