"""Multiple shooting: fits to long records, along which the phase of the motion would be lost."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.flatten_util import ravel_pytree

from .._argument_checks import callable_as, check_arguments, checked_by, count, instance, or_none
from .._types import Given, Numeric
from .._validation import refusal
from ..progress import tell
from ._gauss_newton import AbstractDamped, LevenbergMarquardt
from ._losses import AbstractLoss
from ._methods import AbstractMethod, check_falling
from ._run import Data, Run
from ._shooting import Segments, Shooting, minimise, residual_and_jacobian, segments_of, states_at
from ._unknowns import NamedValues

Guess = Callable[[Any, dict[str, Any], dict[str, Any]], Any]


class PlainDamping(AbstractDamped):
    """Levenberg-Marquardt whose damping counts in the coordinates themselves, each open and of the size
    1, with a slower trust region.

    The rows of multiple shooting have sizes of its own choosing, with many knots whose columns are
    small at first. Damping in sensitivities lets these run: of 100 starts over 20 periods 72 arrived
    with it, 91 with this one.
    """

    damping: Numeric
    tolerance: float = eqx.field(static=True)
    max_steps: int
    loss: AbstractLoss | None = None
    _search: ClassVar = optx.ClassicalTrustRegion()

    def begin(self, z, rows, space=None):
        return super().begin(z, rows)

    def _sizes(self, matrix, bend):
        return jnp.ones_like(bend)


@check_arguments(
    segments=count(2), guess=or_none(callable_as("f(t, values, slopes)", 0.0, {}, {})),
    weights=checked_by(check_falling), max_steps=count(1),
    polish=instance(LevenbergMarquardt, "a LevenbergMarquardt(...)"),
)  # fmt: skip
class MultipleShooting(AbstractMethod):
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
    polish: LevenbergMarquardt = eqx.field(default_factory=LevenbergMarquardt)

    def check_run(self, run):
        if run.correct is not None:
            raise refusal("method", self, "another than MultipleShooting where states are corrected")

    def brought_near(self, run, data, space, values):
        lengths = data.lengths
        if min(lengths) <= self.segments:
            allowed = f"below {min(lengths)}, the number of stamps of the shortest record"
            raise refusal("segments", self.segments, allowed)
        segments = segments_of(data, self.segments)
        z = space.coordinates(values)
        states = self._states(run, data, segments, values)
        scales = np.max(np.abs(states), axis=0)
        scales = np.where(scales > 0.0, scales, 1.0)
        unknown = jnp.concatenate([z, jnp.asarray((states / scales).reshape(-1))])
        taken, size = 0, None
        for weight in self.weights:
            tell(f"weight {weight:g} of the jumps, {taken} steps")
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
            unknown, _, steps = minimise(method, shooting, unknown)
            taken += int(steps)
        return space.values(unknown[: len(space.names)]), taken

    def _states(self, run: Run, data: Data, segments: Segments, values: NamedValues) -> np.ndarray:
        """States at the knots, one row each."""
        if self.guess is None:
            return np.asarray(states_at(run, values, data, segments))
        rows = []
        for g in segments.inner:
            r, t = int(segments.record[g]), segments.begin[g]
            measured, slopes = {}, {}
            for i, (name, _) in enumerate(run.observed):
                there = data.present[r, i]
                times, row = data.times[r][there], data.values[r, i][there]
                if times.size > 1:
                    measured[name] = np.interp(t, times, row)
                    slopes[name] = np.interp(t, times, np.gradient(row, times))
            state = self.guess(t, measured, slopes)
            rows.append(np.asarray(ravel_pytree(jax.tree.map(float, state))[0]))
        return np.stack(rows)
