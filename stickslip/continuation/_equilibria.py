"""Equilibria over one parameter as a family: steps, folds, branch points and Hopf points."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._crossings import (
    PAIR,
    RIGHT,
    is_exchange,
    next_point_with_few,
    partners,
    passing,
    several_at_once,
)
from ._equilibrium import Equilibrium
from ._family import (
    AbstractFamily,
    Control,
    Event,
    Failure,
    Gap,
    Leg,
    Reached,
    Test,
    least_with_sign,
    longer,
    zero_between,
)
from ._newton import newton
from ._rest import (
    Field,
    Measure,
    Rest,
    angle_of,
    describe_rest,
    equilibrium_at,
    measure_of,
    next_measure,
    of_length_one,
    scales_of,
)


def turning(rest: Rest) -> float:
    """Rate of the parameter along the branch: zero at a fold."""
    return float(rest.measure.part(rest.tangent)[-1])


def crossing(rest: Rest) -> float:
    """Least singular value of the derivative, with the sign of its determinant with the tangent."""
    measure = rest.measure
    matrix = measure.balance(rest.jacobian)
    found = np.linalg.svd(matrix, compute_uv=False)
    row = rest.tangent / measure.columns
    sign = np.linalg.slogdet(np.vstack([matrix, row / np.linalg.norm(row)]))[0]
    return float(sign * found[-1])


def pairs(rest: Rest) -> float:
    r"""Least $|\lambda_i + \lambda_j|$, by the larger of the two, with the sign of the product of all
    sums: zero with a pair on the imaginary axis."""
    return least_with_sign(total for total, _ in _sums(rest.eigenvalues))


def _sums(found: np.ndarray) -> list[tuple[complex, int]]:
    """Sums of two eigenvalues, by the larger one, and the number of one of the two.

    Without those of two zeros, as of a body that nothing holds.
    """
    none = ENGINE.some_roundings * np.max(np.abs(found), initial=0.0)
    both = [(found[i], found[j], i) for i, j in partners(found)]
    sizes = [max(abs(a), abs(b)) for a, b, _ in both]
    pairs = zip(both, sizes, strict=True)
    return [((a + b) / size, i) for (a, b, i), size in pairs if size > none]


def growths(rest: Rest) -> np.ndarray:
    """Real parts of the eigenvalues by their magnitudes, the largest first."""
    return np.sort(_rates(rest))[::-1]


def growing(rest: Rest) -> np.ndarray:
    """Eigenvalues that grow beyond rounding, the fastest first in parts of their magnitudes."""
    rates = _rates(rest)
    order = np.argsort(-rates)
    return rest.eigenvalues[order][rates[order] > ENGINE.solved]


def _rates(rest: Rest) -> np.ndarray:
    return np.real(rest.eigenvalues) / np.maximum(np.abs(rest.eigenvalues), 1e-300)


def exchanges(one: Rest, other: Rest) -> bool:
    """Whether between two equilibria one mode begins to grow and another one ceases to."""
    spaces = []
    for rest in (one, other):
        taken = (_rates(rest) > ENGINE.solved) & (np.imag(rest.eigenvalues) >= 0.0)
        vectors = rest.vectors[:, taken] / one.measure.columns[:-1, None]
        parts = np.hstack([np.real(vectors), np.imag(vectors)])
        spaces.append(parts[:, np.any(parts != 0.0, axis=0)])
    return is_exchange(*spaces)


def _real_rates(rest: Rest, kind: str) -> np.ndarray:
    """Those of the eigenvalues of a real kind and of its negatives, by the largest of all, in order."""
    found = rest.eigenvalues
    real = np.real(found[np.abs(np.imag(found)) <= ENGINE.same * np.abs(found)])
    return np.sort(real)[::-1] / max(np.max(np.abs(found)), 1e-300)


OWN = (
    Test("BP", crossing, zero=ENGINE.slack, odd=True),
    Test("HB", pairs, zero=ENGINE.solved),
    Test("LP", turning, zero=ENGINE.slack, odd=True),
)
SWINGS = ("HB", "FL")  # with a period


def axis_pair(rest: Rest) -> int | None:
    """Number of the eigenvalue above the axis whose pair is on it; None if both are real."""
    found = rest.eigenvalues
    near = [(abs(total), i) for total, i in _sums(found)]
    if not near:
        return None
    at = min(near)[1]
    if not abs(found[at].imag) > ENGINE.zero * abs(found[at]):
        return None
    return int(np.argmin(np.abs(found - 1j * abs(found[at].imag))))


@dataclasses.dataclass(frozen=True)
class Equilibria(AbstractFamily):
    """Equilibria of a field in one `mode` over one parameter.

    `functions` of the equilibrium are tests of users.
    """

    field: Field
    mode: int
    functions: Mapping[str, Callable[[Equilibrium], Any]]

    @property
    def names(self) -> tuple[str, ...]:
        return (self.field.name,)

    @property
    def control(self) -> Control:
        return Control(ACCURACY.bend_at_rest, ACCURACY.shortest, ACCURACY.shortest)

    def onward(self, point: Rest, distance: float) -> Rest | Failure:
        along = point.measure.along(point.tangent)
        there = point.z + distance * point.tangent
        found = equilibrium_at(self.field, there, along, point.tangent, point.measure)
        return Failure("Newton's method finds no equilibrium there") if found is None else found

    def cosine(self, point: Rest, new: Rest) -> float:
        return float(np.cos(angle_of(point.tangent, new.tangent, point.measure)))

    def leaps(self, point: Rest, new: Rest, distance: float) -> bool:
        """Whether an equilibrium, a step ahead, is farther away than the branch bends."""
        measure, move = point.measure, distance * point.tangent
        away = measure.length(new.z - point.z - move)
        bend = angle_of(point.tangent, new.tangent, measure)
        if away > (ACCURACY.swerves + bend) * distance + ENGINE.zero:
            return True
        return strays(point, new, measure, measure.size)

    def length(self, one: Rest, other: Rest) -> float:
        return one.measure.length(other.z - one.z)

    def at_level(self, point: Rest, number: int, value: float) -> Rest:
        return dataclasses.replace(point, z=np.append(point.z[:-1], value))

    def orbit(self, point: Rest, label: str = "") -> Equilibrium:
        period, swing = np.nan, np.zeros(point.z.size - 1)
        pair = axis_pair(point) if label in SWINGS else None
        if pair is not None:
            period = 2.0 * np.pi / abs(point.eigenvalues[pair].imag)
            swing = np.real(point.vectors[:, pair])
        y = jax.tree.map(np.asarray, self.field.unravel(jnp.asarray(point.z[:-1])))
        return Equilibrium(y, np.asarray(self.mode), point.eigenvalues, np.asarray(period), swing)

    def sequence(self, point: Rest) -> tuple:
        return (self.mode,)

    def slope(self, point: Rest) -> np.ndarray:
        """Rates of the state and of the parameter."""
        return point.tangent

    def tests(self, point: Rest) -> list[Test]:
        users = self.functions.items()
        return [*OWN, *(Test(k, lambda p, f=f: float(f(self.orbit(p)))) for k, f in users)]

    def zero(
        self, before: Rest, after: Rest, distance: float, test: Test, found: list[Event]
    ) -> Rest | Failure | None:
        """Where two branches cross, the parameter may turn along one of them: not a fold, although its
        rate passes zero, since beyond it another branch goes on. No Hopf point is where the
        eigenvalues whose sum passes zero are real, on both sides if it is not located."""
        if test.zero and abs(test(before)) <= test.zero:
            return None if test.label == "HB" and axis_pair(before) is None else before
        if test.label == "BP":
            return _branch_point(self.field, before, after, distance, before.measure)
        bracket, known = [0.0, distance], {}
        crossed = [event.point for event in found if event.label == "BP"]
        if test.label == "LP" and crossed:
            rate = turning(crossed[0])
            if abs(rate) <= ENGINE.same:
                return None
            at = float(before.measure.along(before.tangent) @ (crossed[0].z - before.z))
            known[at] = crossed[0]
            bracket[0 if rate * turning(before) > 0.0 else 1] = at
        ends = bracket[0], bracket[1]
        point = zero_between(self.onward, before, after, distance, test, ends, known)
        if test.label != "HB":
            return point
        if isinstance(point, Failure):
            return None if axis_pair(before) is axis_pair(after) is None else point
        return None if axis_pair(point) is None else point

    def others(self, leg: Leg, found: list[Event]) -> list[Event]:
        """Pairs that leave the axis where no sign of the sums says so: it is the same where two of them
        cross at once, and where nothing is damped there is none."""
        found = several_at_once(self, growing, leg, found, RIGHT, ("BP", "LP"), _real_rates)
        before, after = ends = leg.before, leg.after
        (few, less), (many, more) = sorted(_numbers(end) for end in ends)
        if few == many and not found and exchanges(before, after):
            words = "one eigenvalue passes to each side, not told apart: between here and"
            return [Event("BP?", before, f"{words} {after.values[0]:.10g}")]
        if few == many or (many - few) % 2 or any(event.label == "HB" for event in found):
            return found
        if not passing(growing(before), growing(after))[PAIR]:
            return [event for event in found if event.label != "HB?"]
        size = before.eigenvalues.size
        if size - few - less == size - many - more:
            # Those between the ones that grow and the ones that decay stay on the axis.
            pair = [many - 1, size - more - 1]
            begins = Test("HB", lambda p: float(np.sum(growths(p)[pair])))
        elif many - few == more - less:
            # Two pairs that meet on the axis leave it as a root: what is above zero is there at once.
            begins = Test("FL", lambda p: float(growths(p)[many - 1]) - ENGINE.same)
        else:  # a Hopf point at an end
            return found
        if begins.sign(before) * begins.sign(after) >= 0:
            return found
        found = [event for event in found if event.label != "HB?"]
        at = zero_between(self.onward, before, after, leg.distance, begins)
        if not isinstance(at, Failure):
            return [*found, Event(begins.label, at)]
        words = f"not located: between here and {after.values[0]:.10g}, {at.result}"
        return [*found, Event(f"{begins.label}?", before, words)]

    def remeasure(self, points: list[Rest], new: Rest) -> Rest:
        states = np.stack([point.z for point in (*points, new)])
        measure = next_measure(points[-1].measure, points[-1], new, np.ptp(states, axis=0))
        tangent = of_length_one(new.tangent, new.tangent, measure)
        return dataclasses.replace(new, tangent=tangent, measure=measure)

    def advance(
        self, points: list[Rest], distance: float, longest: float
    ) -> Iterator[Leg | Gap | Event | Reached]:
        point, first = points[-1], distance
        new, distance = next_point_with_few(self, growing, point, distance, longest, exchanges)
        while isinstance(new, Rest) and distance == first and _double(new) and not _double(point):
            first *= ACCURACY.shorter  # near a branch point the tangent is not known
            new, distance = next_point_with_few(self, growing, point, first, longest, exchanges)
        if isinstance(new, Failure):
            words = "not_converged: the next equilibrium was not found"
            yield Event("EP", point, words, ends=True)
            return
        yield Leg(point, new, distance)
        yield Reached(new, longer(self, new, distance, longest))


def strays(point: Rest, new: Rest, measure: Measure, size: np.ndarray) -> bool:
    """Whether a component without size moves as the tangents at both ends do not let expect."""
    change = new.z[-1] - point.z[-1]
    if point.tangent[-1] == 0.0 or new.tangent[-1] == 0.0:
        return False
    own = measure_of(measure.size, new.jacobian)
    move, least = new.z - point.z, own.least(new.jacobian, new.z)
    expected = 0.5 * change * (point.tangent / point.tangent[-1] + new.tangent / new.tangent[-1])
    # Only a sign that is wrong, or a size, says so: near its beginning the tangents hardly predict it.
    most = ACCURACY.follows * np.maximum(np.abs(move), np.abs(expected)) + least
    return bool(np.any((size == 0.0) & (np.abs(move - expected) > most)))


def _numbers(point: Rest) -> tuple[int, int]:
    """How many eigenvalues grow, and how many decay, beyond rounding."""
    found = growths(point)
    return int(np.sum(found > ENGINE.solved)), int(np.sum(found < -ENGINE.solved))


def _double(point: Rest) -> bool:
    """Whether it is hardly farther from a branch point than rounding."""
    return abs(crossing(point)) < ACCURACY.closes


def _branch_point(
    field: Field, rest: Rest, new: Rest, distance: float, measure: Measure
) -> Rest | Failure:
    """The equilibrium where the derivative has a second null vector.

    At it Newton's method for equilibria is singular, and near it ill-conditioned. A larger system,
    for the point and the left null vector together, is not; it is tried from ever nearer.
    """
    along = measure.along(rest.tangent)
    low, high = (0.0, rest, crossing(rest)), (distance, new, crossing(new))
    largest, reason = max(abs(low[2]), abs(high[2])), "Newton's method finds no equilibrium there"
    for _ in range(ACCURACY.tries):
        part = float(np.clip(low[2] / (low[2] - high[2]), 0.05, 0.95))
        guess = low[1].z + part * (high[1].z - low[1].z)
        point = _singular(field, guess, measure)
        width = measure.length(high[1].z - low[1].z)
        if point is not None and measure.length(point - guess) <= width:
            at = along @ (point - rest.z)
            slack = ENGINE.same * distance  # beyond the step lies another one
            if -slack <= at <= distance + slack:
                return _at_branch_point(field, point, high[1].z - low[1].z, measure)
        middle = 0.5 * (low[0] + high[0])
        found = equilibrium_at(field, rest.z + middle * rest.tangent, along, rest.tangent, measure)
        if found is None:
            return Failure(reason)
        value = crossing(found)
        if value * low[2] > 0.0:
            low = middle, found, value
        else:
            high = middle, found, value
    if min(abs(low[2]), abs(high[2])) > ACCURACY.alike * largest:
        return Failure("the function jumps there")
    return Failure(reason)


def _singular(field: Field, z: np.ndarray, measure: Measure) -> np.ndarray | None:
    r"""Solution of $f + \beta\phi = 0$, $\phi^T f' = 0$, $|\phi| = 1$ with $\beta = 0$, near `z`."""
    rows, columns = measure.rows, measure.columns
    n = rows.size

    def step(last, number):
        z, phi, beta = last
        values, jacobian = field(z)
        slope, bend = measure.balance(jacobian), field.curvature(z, phi * rows)
        bend = bend * columns[:, None] * columns[None, :]
        matrix = np.block(
            [
                [slope, beta * np.eye(n), phi[:, None]],
                [bend, slope.T, np.zeros((n + 1, 1))],
                [np.zeros((1, n + 1)), 2.0 * phi[None, :], np.zeros((1, 1))],
            ]
        )
        right = np.concatenate([values * rows + beta * phi, slope.T @ phi, [phi @ phi - 1.0]])
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right))):
            return last, np.nan
        lines, stacks = scales_of(matrix)
        scaled = matrix * lines[:, None] * stacks[None, :]
        move = stacks * np.linalg.lstsq(scaled, right * lines, rcond=1e-15)[0]
        z, phi, beta = z - move[: n + 1] * columns, phi - move[n + 1 : -1], beta - move[-1]
        parts = measure.part(move[: n + 1] * columns)
        return (z, phi, beta), np.max(np.abs(np.concatenate([parts, move[n + 1 :]])))

    start = z, np.linalg.svd(measure.balance(field(z)[1]))[0][:, -1], 0.0
    end = newton(step, start, enough=ACCURACY.short, nearly=ENGINE.zero, most=ACCURACY.tries)
    z, _, beta = end.carried
    if not end.solved or abs(beta) > ENGINE.zero:
        return None
    least = np.linalg.svd(measure.balance(field(z)[1]), compute_uv=False)[-1]
    return z if least <= ENGINE.same else None


def _at_branch_point(
    field: Field, z: np.ndarray, chord: np.ndarray, measure: Measure
) -> Rest | Failure:
    """The branch point, with that of the two tangents which is nearer to a chord."""
    slope = measure.balance(field(z)[1])
    left, _, right = np.linalg.svd(slope)
    plane = right[-2:]
    bend = field.curvature(z, left[:, -1] * measure.rows)
    bend = plane @ (bend * measure.columns[:, None] * measure.columns[None, :]) @ plane.T
    # A quadratic form is zero on two lines: half-way between them lies an eigenvector.
    values, vectors = np.linalg.eigh(bend)
    if values[0] < 0.0 < values[1]:
        one, other = np.sqrt(values[1]), np.sqrt(-values[0])
        lines = [(one * vectors[:, 0] + s * other * vectors[:, 1]) @ plane for s in (1.0, -1.0)]
        ways = [of_length_one(line * measure.columns, chord, measure) for line in lines]
        parts = [abs(measure.part(way) @ measure.part(chord)) for way in ways]
        tangent = ways[int(np.argmax(parts))]
    else:
        tangent = of_length_one(chord, chord, measure)
    point = describe_rest(field, z, tangent, measure)
    if point is None:
        return Failure("Newton's method finds no equilibrium there")
    return dataclasses.replace(point, tangent=tangent)
