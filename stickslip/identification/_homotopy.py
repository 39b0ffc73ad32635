"""Homotopy: fits with friction that is rounded off less and less, and at last not at all."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._argument_checks import callable_as, check_arguments, checked_by, instance, or_none
from .._types import Given
from ..progress import tell
from ._accuracy import ACCURACY
from ._evaluate import solve_run
from ._gauss_newton import LevenbergMarquardt
from ._many_starts import many_fits
from ._methods import AbstractMethod, check_falling
from ._run import Data, Run
from ._unknowns import NamedValues, Space

WIDTH = "width of the homotopy"


def regularised(system: Any, width: Any) -> Any:
    """The mechanism with rounded friction."""
    return system.regularised(width)


@dataclasses.dataclass(frozen=True)
class _Smoothed:
    """The system of a problem, smoothed by a width that comes as one more number of each record."""

    system: Callable[..., Any]
    smooth: Callable[..., Any]

    def __call__(self, values: NamedValues, inputs: Any) -> Any:
        return self.smooth(self.system(values, inputs), values[WIDTH])


LEVENBERG = instance(LevenbergMarquardt, "a LevenbergMarquardt(...)")


@check_arguments(
    widths=checked_by(check_falling), smooth=or_none(callable_as("f(system, width)", None, 1.0)),
    method=LEVENBERG, polish=LEVENBERG,
)  # fmt: skip
class Homotopy(AbstractMethod):
    r"""The same fit with friction rounded widely, then less, then not at all, each from where the one
    before ended.

    A contact that rests shows only that its friction suffices: from a start with too
    much of it a run stands still, and no derivative says what to do. Rounded friction creeps: the run
    depends on all parameters, smoothly, and the widest rounding has the fewest minima. Its optimum is
    wrong, the more the wider, and the next is nearer. At last `polish` fits the exact law from there,
    so that what is found is a minimum of the same sum of squares as without, and is reported with the
    same `Fit`. Of 64 starts up to a factor 4 off, along three periods of a driven block, all arrived
    at the optimum, and 24 with the exact law alone.

    No rounding brings back an unknown that even the exact law does not feel, such as a static
    coefficient below the kinetic one: let the excess of the one over the other be the unknown,
    positive.

    **Arguments**

    - `widths` [m/s]: falling; the first about a third of the greatest sliding speed, the last about the
      slowest that matters. The narrower, the more steps a run takes.
    - `smooth(system, width)`: the system with rounded friction, of the same states; by default
      `system.regularised(width)`, for an `AbstractMechanism`. The `observed` system is handed this one.
    - `method`: for the rounded ones; by default `LevenbergMarquardt(tolerance=1e-3, max_steps=30)`.
      `polish`: for the exact one.

    **Raises** `TypeError`, `ValueError` for anything else.
    """

    widths: Given[tuple[float, ...]] = eqx.field(static=True)
    smooth: Given[Callable[[Any, Any], Any] | None] = eqx.field(static=True, default=None)
    method: LevenbergMarquardt = eqx.field(
        default_factory=lambda: LevenbergMarquardt(tolerance=1e-3, max_steps=30)
    )
    polish: LevenbergMarquardt = eqx.field(default_factory=LevenbergMarquardt)

    def brought_near(self, run, data, space, values):
        taken, first = 0, space.coordinates(values)
        for number, (rounded, known) in enumerate(self._stages(run, data)):
            tell(f"width {self.widths[number]:g} m/s, {taken} steps")
            z = _not_too_far(space, first, space.coordinates(values))
            fit = solve_run(self.method, rounded, known, space, z)
            taken += int(fit.steps)
            if bool(jnp.isfinite(fit.cost)):
                values = dict(fit.values)
        return space.values(_not_too_far(space, first, space.coordinates(values))), taken

    def many_near(self, run, data, space, values, chunk_size):
        """All starts at once, stage by stage."""
        taken, first = 0, space.coordinates(values)
        for rounded, known in self._stages(run, data):
            fits = many_fits(self.method, rounded, space, values, (known,), chunk_size)
            good = jnp.isfinite(fits.cost)
            kept = {name: jnp.where(good, fits.values[name], row) for name, row in values.items()}
            values = space.values(_not_too_far(space, first, space.coordinates(kept)))
            taken = taken + np.asarray(fits.steps)
        return {name: np.asarray(row) for name, row in values.items()}, taken

    def _stages(self, run: Run, data: Data) -> list[tuple[Run, Data]]:
        rounded = dataclasses.replace(run, system=_Smoothed(run.system, self.smooth or regularised))
        count = data.times.shape[0]
        return [
            (rounded, dataclasses.replace(data, known=data.known | {WIDTH: np.full(count, width)}))
            for width in self.widths
        ]


def _not_too_far(space: Space, first: Any, z: Any) -> Any:
    """Where an unknown hardly matters it may have gone to its bound, from where nothing returns."""
    near = jnp.clip(z, first - np.log(ACCURACY.reach), first + np.log(ACCURACY.reach))
    bounded = np.array([bounds != (None, None) for bounds in space.bounds])
    return jnp.where(bounded, near, z)
