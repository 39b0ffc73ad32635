r"""One side of a profile: an unknown is moved outwards, the others follow to their conditional minimum.

Every turn of the loop evaluates the residuals once, whatever it is for, so that lanes that are mapped
over never wait for each other.

Where the sum of squares jumps, as an event appears or vanishes, a refit halts at the jump or begins on
its far side. The value found is still an upper bound of the minimum: below the level the distance
lies inside. Above it other starts are tried: the point inside as it is, the point outside, and points
around, of which the linearised problem says that they are below the level.
"""

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._evaluate import Evaluation

AS_IS, OUTSIDE, AROUND = range(1, 4)  # starts of a refit after the first

FOUND, BELOW, EDGE, FAILED = range(4)  # how a side ends


@functools.cache
def _ball(size: int) -> np.ndarray:
    """Points `[set, probe, unknown]`, evenly in the unit ball, the same ones every time."""
    rng = np.random.default_rng(0)
    points = rng.standard_normal((ACCURACY.probes, ACCURACY.probes, size))
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    return points * rng.uniform(size=(ACCURACY.probes, ACCURACY.probes, 1)) ** (1.0 / size)


class Linear(NamedTuple):
    """The problem linearised at a point, in columns of unit length; the unknown that is fixed has none.

    `weight`: size of the column of each unknown. `values`, `directions`: singular values and right
    vectors. `along`: residual along the left vectors. `slope`: half the derivative of the sum of
    squares by the fixed unknown. `drift`: how the others follow it. `curvature`: half the second
    derivative.
    """

    weight: Float[Array, " unknown"]
    values: Float[Array, " unknown"]
    directions: Float[Array, "unknown unknown"]
    along: Float[Array, " unknown"]
    slope: Float[Array, ""]
    drift: Float[Array, " unknown"]
    curvature: Float[Array, ""]


def linear(residual: Array, matrix: Array, mask: Bool[Array, " unknown"], held: Array) -> Linear:
    """`mask` is true for the unknown that is profiled, `held` once it is."""
    fixed = mask & held
    good = jnp.all(jnp.isfinite(matrix)) & jnp.all(jnp.isfinite(residual))
    matrix = jnp.where(good, matrix, 0.0)
    residual = jnp.where(good, residual, 0.0)
    own = matrix @ fixed.astype(matrix.dtype)
    free = jnp.where(fixed[None, :], 0.0, matrix)
    weight = jnp.sqrt(jnp.sum(free**2, axis=0))
    # An unknown at its bound moves nothing any more, however far its coordinate goes.
    matters = weight > ACCURACY.least_sensitivity
    free = jnp.where(matters[None, :], free, 0.0)
    weight = jnp.where(matters, weight, 1.0)
    # A triangle first: the singular values of rows times unknowns cost far more.
    short = max(matrix.shape[1] - matrix.shape[0], 0)
    q, r = jnp.linalg.qr(jnp.pad(free / weight[None, :], [(0, short), (0, 0)]))
    u, values, directions = jnp.linalg.svd(r)
    left = q[: matrix.shape[0]] @ u
    seen = values > ACCURACY.rank * values[0]
    inverse = jnp.where(seen, 1.0 / jnp.where(seen, values, 1.0), 0.0)
    by_own = jnp.where(seen, left.T @ own, 0.0)
    drift = -(directions.T @ (inverse * by_own)) / weight
    rest = own - left @ by_own
    along = jnp.where(seen, left.T @ residual, 0.0)
    held_curvature = jnp.sum(rest**2)
    # With all free the same follows from the column of the covariance.
    one = mask.astype(matrix.dtype) / weight
    column = (directions.T @ (inverse**2 * (directions @ one))) / weight
    variance = jnp.sum(jnp.where(mask, column, 0.0))
    hidden = jnp.any(~seen & (jnp.abs(directions @ mask.astype(matrix.dtype)) > ACCURACY.part))
    blind = hidden | ~(variance > 0.0)
    safe = jnp.where(variance > 0.0, variance, 1.0)
    return Linear(
        weight, values, directions, along, residual @ own,
        jnp.where(held, drift, jnp.where(blind, 0.0, column / safe)),
        jnp.where(held, held_curvature, jnp.where(blind, 0.0, 1.0 / safe)),
    )  # fmt: skip


class Side(NamedTuple):
    """How far a side has come. Distances are in the unbounded coordinate, from the minimum outwards."""

    trial: Float[Array, " unknown"]  # wants to be evaluated
    fresh: Bool[Array, ""]  # first at its distance
    start: Bool[Array, ""]  # all unknowns free still
    z: Float[Array, " unknown"]  # best at this distance
    cost: Float[Array, ""]
    here: Linear
    damping: Float[Array, ""]
    foreseen: Float[Array, ""]  # fall of the cost that the trial would bring
    inner: Int[Array, ""]
    attempt: Int[Array, ""]  # number of the refit at this distance
    kept: tuple[Any, ...]  # cost, coordinates, problem linearised: lowest of the refits before
    best: Float[Array, " unknown"]  # minimum over all unknowns
    least: Float[Array, ""]
    d: Float[Array, ""]
    last: Float[Array, ""]  # length of the last step
    inside: tuple[Any, ...]  # distance, root of the rise, coordinates, problem linearised
    outside: tuple[Any, ...]  # distance, root of the rise, coordinates
    count: Int[Array, ""]
    turns: Int[Array, ""]
    status: Int[Array, ""]  # -1 on the way
    distances: Float[Array, " point"]
    rises: Float[Array, " point"]
    others: Float[Array, "point unknown"]


class Walk(eqx.Module):
    """`target`: rise of twice the cost at the end of the interval, reached in about `points` steps.
    `unbounded`: which unknowns have no bound."""

    target: Float[Array, ""]
    points: Float[Array, ""]
    max_steps: Int[Array, ""]
    unbounded: Bool[Array, " unknown"]

    def side(self, evaluate: Evaluation, z: Array, index: Array, sign: Array, limits: Array) -> "Side":
        """Along coordinate `index` in the direction `sign`, no further than `limits` (low, high)."""
        once = jax.jit(evaluate)
        mask = jnp.arange(z.shape[0]) == index

        def turn(now):
            return self._turn(now, mask, sign, limits, *once(now.trial))

        return jax.lax.while_loop(lambda now: now.status < 0, turn, self._begin(z))

    def _begin(self, z: Array) -> Side:
        zero, no = jnp.zeros(()), jnp.zeros((), bool)
        size = z.shape[0]
        empty = Linear(
            jnp.ones(size), jnp.zeros(size), jnp.eye(size), jnp.zeros(size), zero, jnp.zeros(size), zero
        )
        number = jnp.zeros((), jnp.int32)
        nowhere = jnp.asarray(jnp.inf)
        points = jnp.full(ACCURACY.profile_points, jnp.nan)
        return Side(
            trial=z, fresh=~no, start=~no, z=z, cost=nowhere, here=empty, damping=zero, foreseen=zero,
            inner=number, attempt=number, kept=(nowhere, z, empty), best=z, least=zero, d=zero,
            last=zero, inside=(zero, zero, z, empty), outside=(nowhere, nowhere, z), count=number,
            turns=number, status=number - 1, distances=points, rises=points,
            others=jnp.full((*points.shape, size), jnp.nan),
        )  # fmt: skip

    def _turn(self, now: Side, mask, sign, limits, residual, matrix) -> Side:
        """Take the trial or not; then another one here, or the next distance."""
        cost = 0.5 * jnp.sum(residual**2)
        finite = jnp.isfinite(cost) & jnp.all(jnp.isfinite(matrix))
        cost = jnp.where(finite, cost, jnp.inf)
        taken = finite & (now.fresh | (cost < now.cost))
        lost = now.fresh & ~finite  # nothing to stand on at this distance
        found = linear(residual, matrix, mask, ~now.start)
        here = jax.tree.map(lambda new, old: jnp.where(taken, new, old), found, now.here)
        gained = now.cost - cost
        less = jnp.where(now.damping > 1e-7, 0.1 * now.damping, 0.0)
        more = jnp.where(now.damping > 0.0, 10.0 * now.damping, 1e-4)
        damping = jnp.where(taken & (gained > 0.25 * now.foreseen), less, more)
        damping = jnp.where(now.fresh, 0.0, damping)
        tail = jnp.asarray(now.inner + 1, jnp.int32)
        stalled = ~now.fresh & (jnp.abs(gained) <= ENGINE.some_roundings * jnp.abs(now.cost))
        now = now._replace(
            z=jnp.where(taken, now.trial, now.z), cost=jnp.where(taken, cost, now.cost), here=here,
            damping=damping, inner=tail, turns=now.turns + 1,
        )  # fmt: skip
        left = 0.5 * jnp.sum(here.along**2)  # what is still to gain
        # The minimum itself in more digits: the interval is measured from there.
        good = left <= jnp.where(now.start, ENGINE.rounding, ENGINE.zero) * self.target
        most = jnp.where(now.start, ACCURACY.most_damping, ACCURACY.halted)
        tired = stalled | (now.inner >= ACCURACY.refit_steps) | (damping > most)
        close = tired & (left <= ACCURACY.refit_at_rest * self.target)
        done = ~lost & (good | close)
        # A probe is one evaluation; a refit may come down from far.
        patience = jnp.where(now.attempt < AROUND, ACCURACY.given_up, 1)
        hope = jnp.where(now.attempt < AROUND, 4.0 * left, 0.0) + 0.5 * self.target
        hopeless = ~now.start & (now.inner >= patience) & (now.cost - now.least > hope)
        ended = done | lost | tired | hopeless
        lower = now.cost < now.kept[0]
        kept = jax.tree.map(
            lambda new, old: jnp.where(lower, new, old), (now.cost, now.z, now.here), now.kept
        )
        root = jnp.sqrt(jnp.maximum(2.0 * (kept[0] - now.least) / self.target, 0.0))
        last = now.attempt >= AROUND + ACCURACY.probes - 1
        settled = now.start | (root < 1.0) | (done & (root <= ACCURACY.near_outside)) | last
        onwards = self._onwards(now, kept, mask, sign, limits)
        another = self._another(now._replace(kept=kept), mask, sign)
        again = self._again(now)
        after = jax.tree.map(
            lambda a, b, c: jnp.where(ended, jnp.where(settled, a, b), c), onwards, another, again
        )
        spent = (after.status < 0) & (after.turns >= self.max_steps)
        enclosed = after.outside[0] - after.inside[0] <= ACCURACY.near * after.outside[0]
        return after._replace(status=jnp.where(spent, jnp.where(enclosed, EDGE, FAILED), after.status))

    def _again(self, now: Side) -> Side:
        """Another step of the refit at the same distance, damped as in Levenberg's method."""
        seen = now.here.values > ACCURACY.rank * now.here.values[0]
        s = jnp.where(seen, now.here.values, 1.0)
        damped = now.damping * now.here.values[0] ** 2
        part = jnp.where(seen, s**2 / (s**2 + damped), 0.0)
        step = -(now.here.directions.T @ (part / s * now.here.along)) / now.here.weight
        over = jnp.max(jnp.abs(step) / self._longest(now.z))
        part = part / jnp.maximum(over, 1.0)
        step = step / jnp.maximum(over, 1.0)
        foreseen = jnp.sum((part - 0.5 * part**2) * now.here.along**2)
        return now._replace(trial=now.z + step, fresh=jnp.zeros((), bool), foreseen=foreseen)

    def _another(self, now: Side, mask, sign) -> Side:
        """Another start of the refit at the same distance."""
        near = now.outside[1] <= ACCURACY.near_outside * jnp.sqrt(self.target)
        attempt = now.attempt + 1
        attempt = attempt + ((attempt == OUTSIDE) & ~near).astype(jnp.int32)
        _, root, inside, here = now.inside
        number = jnp.clip(attempt - AROUND, 0, ACCURACY.probes - 1)
        ball = jnp.asarray(_ball(inside.shape[0]))[now.count % ACCURACY.probes, number]
        seen = here.values > ACCURACY.rank * here.values[0]
        room = jnp.sqrt(jnp.maximum(self.target - root**2, 0.0))
        off = jnp.where(seen, room * ball / jnp.where(seen, here.values, 1.0), 0.0)
        longest = self._longest(inside)
        around = jnp.clip(here.directions.T @ off / here.weight, -longest, longest)
        around = inside + self._follow_drift(now, sign) + around
        trial = jnp.where(attempt >= AROUND, around, inside)
        trial = jnp.where(attempt == OUTSIDE, now.outside[2], trial)
        return self._begun(trial, now._replace(attempt=attempt), mask, sign)

    def _begun(self, trial, now: Side, mask, sign) -> Side:
        """A refit from the trial, moved to the present distance."""
        return now._replace(
            trial=jnp.where(mask, now.best + sign * now.d, trial), fresh=jnp.ones((), bool),
            inner=jnp.zeros((), jnp.int32), damping=jnp.zeros(()), cost=jnp.asarray(jnp.inf),
        )  # fmt: skip

    def _follow_drift(self, now: Side, sign) -> Array:
        """How the others follow from the point inside to the present distance."""
        distance, _, inside, here = now.inside
        longest = self._longest(inside)
        return jnp.clip(sign * (now.d - distance) * here.drift, -longest, longest)

    def _onwards(self, now: Side, kept, mask, sign, limits) -> Side:
        """From the minimum at one distance to the next distance, or to the end."""
        begun = now.start
        now = now._replace(cost=kept[0], z=kept[1], here=kept[2])
        lost = ~jnp.isfinite(now.cost)
        best = jnp.where(begun, now.z, now.best)
        least = jnp.where(begun, now.cost, now.least)
        rise = jnp.where(lost, jnp.inf, 2.0 * (now.cost - least))
        root = jnp.sqrt(jnp.maximum(rise, 0.0))
        aim = jnp.sqrt(self.target)
        count = now.count + 1
        at = jnp.minimum(now.count, ACCURACY.profile_points - 1)
        now = now._replace(
            start=jnp.zeros((), bool), best=best, least=least, count=count,
            distances=now.distances.at[at].set(now.d), rises=now.rises.at[at].set(rise),
            others=now.others.at[at].set(jnp.where(lost, jnp.nan, now.z)),
        )  # fmt: skip
        # Slope of the root of the rise; at the minimum that of a parabola.
        curved = jnp.sqrt(now.here.curvature)
        slope = sign * now.here.slope / jnp.where(root > 0.0, root, 1.0)
        slope = jnp.where(root > ACCURACY.next_to_minimum * aim, slope, curved)
        hit = ~begun & (jnp.abs(root - aim) <= ACCURACY.interval_end * aim)
        within = begun | (root < aim)
        mine = (now.d, root, now.z, now.here)
        inside = jax.tree.map(lambda new, old: jnp.where(within, new, old), mine, now.inside)
        outside = jax.tree.map(lambda new, old: jnp.where(within, old, new), mine[:3], now.outside)
        own = mask.astype(jnp.float64)
        end = jnp.where(sign > 0, limits[1], limits[0])
        reach = jnp.maximum(sign * (end - best @ own), 0.0)
        step = self._step(now, begun, root, slope, inside, outside, reach)
        d = jnp.minimum(step, reach)
        open_end = within & (now.d >= reach) & ~begun
        narrow = jnp.isfinite(outside[0]) & (outside[0] - inside[0] <= ENGINE.same * outside[0])
        lost_at_once = begun & lost
        smooth = 0.5 * jnp.sum(now.here.along**2) <= ACCURACY.refit_at_rest * self.target
        crossed = jnp.where(smooth, FOUND, EDGE)  # else the refit halted there at a jump
        status = jnp.where(
            hit, crossed, jnp.where(open_end, BELOW, jnp.where(narrow, EDGE, now.status))
        )
        status = jnp.where(lost_at_once, FAILED, status)
        # At an end that was hit the point itself is the answer, else the last one below the level.
        inside = jax.tree.map(lambda new, old: jnp.where(hit, new, old), mine, inside)
        now = now._replace(
            d=d, last=jnp.abs(d - inside[0]), inside=inside, outside=outside, status=status,
            kept=(jnp.asarray(jnp.inf), *now.kept[1:]), attempt=jnp.zeros((), jnp.int32),
        )  # fmt: skip
        return self._begun(inside[2] + self._follow_drift(now, sign), now, mask, sign)

    def _longest(self, z: Array) -> Array:
        """How far a coordinate may go in a step: from one end of its bounds no step finds back."""
        return jnp.where(self.unbounded, 10.0 * jnp.maximum(jnp.abs(z), 1.0), 3.0)

    def _step(self, now: Side, begun, root, slope, inside, outside, reach):
        """The next distance: a part of the rise while all is below, then Newton's method."""
        aim = jnp.sqrt(self.target)
        uphill = slope > 0.0
        steep = jnp.where(uphill, slope, 1.0)
        goal = jnp.minimum(aim, root + aim / self.points)
        far = jnp.where(begun, reach, ACCURACY.longest_step * now.last)
        onwards = jnp.where(uphill, (goal - root) / steep, far)
        # Next to the minimum rounding has a say in the slope.
        onwards = jnp.where(root < ACCURACY.next_to_minimum * aim, jnp.maximum(onwards, far), onwards)
        onwards = now.d + jnp.minimum(onwards, far)
        first = jnp.where(uphill, aim / self.points / steep, jnp.minimum(1e-3 * reach, 1.0))
        newton = now.d + jnp.where(uphill, (aim - root) / steep, jnp.inf)
        low, high = inside[0], outside[0]
        width = high - low
        between = (newton > low) & (newton < high) & jnp.isfinite(root)
        # Far from the minimum of a jump, Newton's method creeps: every third turn halves.
        halve = ~between | (now.count % 4 == 3)
        refined = jnp.where(halve, low + 0.5 * width, newton)
        return jnp.where(begun, first, jnp.where(jnp.isfinite(high), refined, onwards))
