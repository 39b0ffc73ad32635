"""Intervals by the profile of the likelihood, and what they say about each unknown."""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._argument_checks import callable_as, check_arguments, count, instance
from .._compiled_once import compiled_once
from .._types import Given, Named
from .._validation import check_in, check_mapping, check_that, is_concrete, refusal
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..progress import showing
from ._accuracy import ACCURACY
from ._evaluate import with_operands
from ._fit import Fit, probability
from ._profile_walk import BELOW, EDGE, FAILED, Walk
from ._unknowns import NamedValues, Space, names_among

IDENTIFIABLE, PRACTICALLY_NOT, STRUCTURALLY_NOT, UNDECIDED = range(4)
VERDICTS = (
    "identifiable", "practically not identifiable", "structurally not identifiable", "not decided",
)  # fmt: skip


class Profile(eqx.Module):
    r"""Intervals of the unknowns; under `vmap` every array has the batch axes in front.

    With $\Delta(p) = \min \|r\|^2 - \|\hat r\|^2$, the minimum over all other unknowns while one is
    held at $p$, the interval is where $\Delta$ stays below the quantile `level` of $\chi^2$ with one
    degree of freedom.

    - `names` profiled, in alphabetical order; `level`. All that follows is by name.
    - `estimate`, `lower`, `upper`, and `wald_lower`, `wald_upper` by the linearised problem, infinite
      where it does not see the unknown, each in its unit: `found.lower["mass"]`. Where the profile
      stays below the level, the end is where the search stopped.
    - `ends`, `[side]`, lower side first: 0 found, 1 stays below the level up to the limit, 2 a jump of
      the profile or the edge of where the model runs, 3 not found within the `max_steps` of `profile`.
      At 2 and 3 the end is the farthest point found below the level, at which the profile is no
      higher: to a part in 1e6 of the distance for 2, in 100 where the steps ran out.
    - `verdict`: 0 identifiable, 1 practically not, as the profile stays below on one or both sides,
      2 structurally not, as it is flat or the linearised problem does not see it, 3 not decided.
    - `values`, `rises` $\Delta$, `[side, point]`: the profile, NaN past its last point; `others`,
      by name of every unknown, `[side, point]`: all there.
    - `fall`: how far below the fit's the least $\|r\|^2$ lies that was found on the way; above the
      level the fit was at another minimum.
    - `evaluations` of residual and Jacobian, `[side]`.
    """

    level: Float[Array, "*batch"]
    estimate: NamedValues
    lower: NamedValues
    upper: NamedValues
    wald_lower: NamedValues
    wald_upper: NamedValues
    ends: dict[str, Int[Array, "*batch 2"]]
    verdict: dict[str, Int[Array, "*batch"]]
    values: dict[str, Float[Array, "*batch 2 point"]]
    rises: dict[str, Float[Array, "*batch 2 point"]]
    others: dict[str, dict[str, Float[Array, "*batch 2 point"]]]
    fall: Float[Array, "*batch"]
    evaluations: dict[str, Int[Array, "*batch 2"]]

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns profiled, in alphabetical order."""
        return tuple(sorted(self.lower))

    @property
    def verdicts(self) -> dict[str, str]:
        """By name the verdict, in words; of one profile that is known, not traced."""
        if not is_concrete(self.verdict) or self.level.ndim != 0:
            raise refusal("verdict", self.verdict, "that of one profile, known")
        return {name: VERDICTS[int(self.verdict[name])] for name in self.names}

    def __str__(self) -> str:
        if not is_concrete(self.level) or self.level.ndim != 0:
            return f"Profile(of shape {self.level.shape})"
        part = f"{100 * float(self.level):g}%"
        lines = []
        for name in self.names:
            low, high = self.ends_in_words(name)
            middle = float(self.estimate[name])
            lines.append(f"{name} = {middle:.6g}, {part} from {low} to {high}: {self.verdicts[name]}")
        return "\n".join(lines)

    __repr__ = __str__

    def ends_in_words(self, name: str) -> tuple[str, str]:
        """Both ends of an interval, with a sign where the profile stays below the level beyond."""
        check_in("name", name, self.names)
        ends = [int(end) == BELOW for end in self.ends[name]]
        low, high = float(self.lower[name]), float(self.upper[name])
        return f"{'<' if ends[0] else ''}{low:.6g}", f"{'>' if ends[1] else ''}{high:.6g}"


@check_arguments(
    residual=callable_as("f(values)", {}), fit=instance(Fit, "a Fit"), level=probability,
    points=count(1, 20), max_steps=count(10),
)  # fmt: skip
@showing("profile")
def profile(
    residual: Callable[[NamedValues], Any],
    fit: Given[Fit],
    names: Given[str | Sequence[str] | None] = None,
    *,
    limits: Named | None = None,
    level: float = 0.95,
    points: int = 4,
    max_steps: int = 1000,
) -> Profile:
    r"""Intervals by the profile likelihood: one unknown is moved, the others are fitted anew.

    It follows the curved valley that the Wald interval takes for straight, and distinguishes unknowns
    that the data do not show at all from those that they show too poorly for an interval to end. All
    unknowns and both sides are lanes of one compiled program. The ends are found to a part in 1e7 of
    the root of the rise.

    >>> from stickslip.identification import least_squares
    >>> def residual(p):
    ...     return jnp.stack([p["a"] * p["b"] - 6.0, 2.0 * p["c"] - 8.0])
    >>> fit = least_squares(residual, dict(a=1.0, b=2.0, c=3.0))
    >>> found = profile(residual, fit)
    >>> found.verdicts["a"], found.verdicts["c"]
    ('structurally not identifiable', 'identifiable')
    >>> print(f"{float(found.lower['c']):.6f} {float(found.upper['c']):.6f}")
    3.020018 4.979982

    **Arguments**

    - `residual(values)` as for the fit: one row, in units of the standard deviation of the noise.
    - `fit` at a minimum; the search begins with a refit. `names` to profile, all by default.
    - `limits`: by name (low, high), how far to look. By default to the bounds; without a bound to a
      thousandth and a thousand times the distance from the other one, or a thousand times its size.
    - `level` of the interval, above 0 and below 1. `points`: steps to the level on each side.
    - `max_steps`: evaluations for one side. All sides are evaluated together, which lasts as long as
      the slowest run among them, and far from the fit a motion may be stiff or fast: let the
      `Integrator` of the problem have `max_steps` of a few times what the run at the fit takes. A run
      that wants more counts as one that fails, beyond the edge of where the model runs.

    **Returns** a `Profile`. **Raises** `TypeError`, `ValueError` for anything else. Works under `jit`
    and `vmap`.
    """
    if fit.steps.ndim != 0:
        raise refusal(
            "fit", fit, "one fit: use jax.vmap for a batch", but=f"of shape {fit.steps.shape}"
        )
    space = fit.space
    chosen = names_among("names", names, space.names)
    z = space.coordinates(fit.values)
    lows, highs = _limits(limits, space, z, fit.values)
    rows = [space.names.index(name) for name in chosen]
    consts, evaluation = with_operands(residual, space, z)

    def every(z, lows, highs, level, points, max_steps, consts):
        evaluate = evaluation(consts)
        target = 2.0 * jax.lax.erf_inv(level) ** 2
        unbounded = jnp.asarray([bounds == (None, None) for bounds in space.bounds])
        walk = Walk(target, points, max_steps, unbounded)
        indices = jnp.repeat(jnp.asarray(rows), 2)
        signs = jnp.tile(jnp.asarray([-1.0, 1.0]), len(rows))

        def one(index, sign):
            return walk.side(evaluate, z, index, sign, jnp.stack([lows[index], highs[index]]))

        return jax.vmap(one)(indices, signs)

    operands = (
        jnp.asarray(level, jnp.float64), jnp.asarray(points, jnp.float64),
        jnp.asarray(max_steps, jnp.int32),
    )  # fmt: skip
    sides = compiled_once(every, z, lows, highs, *operands, consts)
    return _profile_of(sides, fit.cost, fit.standard_errors(), space, tuple(chosen), operands[0])


def _coordinates(space: Space, name: str, at: Array, values: NamedValues) -> Array:
    """Coordinates of one unknown at a row of its values; the others stay."""
    rows = {other: jnp.broadcast_to(value, at.shape) for other, value in values.items()}
    return space.coordinates(rows | {name: at})[:, space.names.index(name)]


def _limits(limits: Any, space: Space, z: Array, values: NamedValues) -> tuple[Array, Array]:
    """In coordinates, the lower first."""
    given = check_mapping("limits", limits)
    lows, highs = [], []
    for i, (low, high) in enumerate(space.bounds):
        if low is not None and high is not None:
            far = jnp.maximum(-jnp.log(ENGINE.zero), jnp.abs(z[i]) + 1.0)
            ends = (-far, far)
        elif low is None and high is None:
            reach = ACCURACY.reach * jnp.maximum(jnp.abs(z[i]), 1.0)
            ends = (z[i] - reach, z[i] + reach)
        else:
            ends = (z[i] - jnp.log(ACCURACY.reach), z[i] + jnp.log(ACCURACY.reach))
        lows.append(ends[0])
        highs.append(ends[1])
    for name, pair in given.items():
        where = f"limits[{name!r}]"
        if name not in space.names:
            raise refusal(where, pair, f"named after one of {', '.join(space.names)}")
        allowed = "a pair (low, high) of numbers around the estimate, inside of the bounds"
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise refusal(where, pair, allowed, TypeError)
        i = space.names.index(name)
        check_that(where, list(pair), np.isfinite, "finite")
        low, high = space.bounds[i]
        inside = [(low is None or p > low) and (high is None or p < high) for p in pair]
        if not all(inside) or not pair[0] < pair[1]:
            raise refusal(where, pair, allowed)
        with_pair = _coordinates(space, name, jnp.asarray([float(p) for p in pair]), values)
        ends = (jnp.min(with_pair), jnp.max(with_pair))
        if is_concrete(z) and not float(ends[0]) < float(z[i]) < float(ends[1]):
            raise refusal(where, pair, allowed)
        lows[i], highs[i] = ends
    return jnp.stack(lows), jnp.stack(highs)


def _outermost_ends(found, status, rises, values: list[Array], level: Array) -> Array:
    """Ends `[unknown, side]` at a jump, moved out to the farthest point below the level that the walk
    of any unknown has met: the minimum there is no higher."""
    below = rises <= 2.0 * jax.lax.erf_inv(level) ** 2
    lows = jnp.stack([jnp.min(jnp.where(below, value, jnp.inf)) for value in values])
    highs = jnp.stack([jnp.max(jnp.where(below, value, -jnp.inf)) for value in values])
    wider = jnp.stack([jnp.minimum(found[:, 0], lows), jnp.maximum(found[:, 1], highs)], axis=-1)
    return jnp.where((status == EDGE) | (status == FAILED), wider, found)


# One program: the operations one by one would be seventy.
@eqx.filter_jit
def _profile_of(
    sides: Any, cost: Array, errors: NamedValues, space: Space, names: tuple[str, ...], level: Array
) -> Profile:
    count = len(names)
    rows = jnp.asarray([space.names.index(name) for name in names])

    def side_by_side(a):
        return a.reshape(count, 2, *a.shape[1:])

    def values_of_own(z):
        """Values of the profiled unknowns where `z[unknown, ...]` are all coordinates there."""
        values = space.values(z)
        return jnp.stack([values[name][i] for i, name in enumerate(names)])

    ends = side_by_side(sides.inside[2])
    found, estimate = values_of_own(ends), values_of_own(side_by_side(sides.best)[:, 0])
    status, distances = side_by_side(sides.status), side_by_side(sides.distances)
    rises, others = side_by_side(sides.rises), side_by_side(sides.others)
    best = side_by_side(sides.best)
    sign = jnp.asarray([-1.0, 1.0])[None, :, None]
    at = jnp.take_along_axis(best, rows[:, None, None], axis=-1) + sign * distances
    # Coordinates of a lone upper bound fall where values rise.
    swapped = found[:, 0] > found[:, 1]
    found, status, others, at, rises, evaluations = (
        jnp.where(swapped.reshape(-1, *(1,) * (a.ndim - 1)), a[:, ::-1], a)
        for a in (found, status, others, at, rises, side_by_side(sides.turns))
    )
    points = jnp.broadcast_to(at[..., None], (*at.shape, len(space.names)))
    every = space.values(others)
    found = _outermost_ends(found, status, rises, [every[name] for name in names], level)
    half = jnp.sqrt(2.0) * jax.lax.erf_inv(level)
    wide = half * jnp.stack([errors[name] for name in names])
    blind = ~jnp.isfinite(wide)
    highest = jnp.max(jnp.where(jnp.isfinite(rises), rises, -jnp.inf), axis=(1, 2))
    to_both_limits = jnp.all(status == BELOW, axis=1)
    flat = to_both_limits & (highest <= ENGINE.same * 2.0 * half**2 / 2.0)
    lost = jnp.any(status == FAILED, axis=1)
    below = jnp.any(status == BELOW, axis=1)
    verdict = jnp.select(
        [flat | blind, lost, below],
        [STRUCTURALLY_NOT, UNDECIDED, PRACTICALLY_NOT],
        IDENTIFIABLE,
    )
    least = jnp.min(jnp.where(jnp.isfinite(rises), rises, jnp.inf))
    fall = 2.0 * cost - 2.0 * jnp.min(sides.least) - jnp.minimum(least, 0.0)

    def by_name(rows):
        return {name: rows[i] for i, name in enumerate(names)}

    wald_lower, wald_upper = by_name(estimate - wide), by_name(estimate + wide)
    return Profile(
        level, by_name(estimate), by_name(found[:, 0]), by_name(found[:, 1]), wald_lower, wald_upper,
        by_name(status), by_name(verdict), by_name(values_of_own(points)), by_name(rises),
        {name: {other: a[i] for other, a in every.items()} for i, name in enumerate(names)}, fall,
        by_name(evaluations),
    )  # fmt: skip
