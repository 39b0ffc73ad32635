"""One equilibrium: Newton's method, tangent and sizes, all independent of the units of the state."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree
from scipy.sparse.csgraph import connected_components

from .._jit_by_code import jit_by_code
from ..analysis.observable import with_parameters
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._newton import newton


@dataclasses.dataclass(frozen=True)
class Measure:
    """Scales of distances, of Newton's method and of singular values at one place of a branch.

    `size`, `[unknown]`: of each component, the parameter's last, that of the bounds' distance; zero for
    components that have not moved, which do not count. `rows`, `columns`: with these factors the
    derivative has entries of at most about one.
    """

    size: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    def part(self, move: np.ndarray) -> np.ndarray:
        """A move in parts of the sizes."""
        return np.where(self.size > 0.0, move / np.where(self.size > 0.0, self.size, 1.0), 0.0)

    def length(self, move: np.ndarray) -> float:
        return float(np.linalg.norm(self.part(move)))

    def along(self, tangent: np.ndarray) -> np.ndarray:
        """The covector whose product with a move is its length along a tangent."""
        return self.part(self.part(tangent))

    def balance(self, jacobian: np.ndarray) -> np.ndarray:
        return jacobian * self.rows[:, None] * self.columns[None, :]

    def least(self, jacobian: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Moves of the components that are rounding."""
        linked = (np.abs(self.balance(jacobian)) > 1e-14).astype(float)
        _, group = connected_components(linked.T @ linked, directed=False)
        known = np.zeros(z.size)
        np.maximum.at(known, group, self.size / self.columns)
        known = known[group]
        return np.maximum(ENGINE.zero * self.columns * known, ENGINE.zero * np.abs(z))


@dataclasses.dataclass(frozen=True)
class Rest:
    """An equilibrium: state and parameter `z`, the derivative by them, tangent, linear motion.

    `measure`: by which it was found, and the next one is.
    """

    z: np.ndarray
    tangent: np.ndarray
    jacobian: np.ndarray
    eigenvalues: np.ndarray
    vectors: np.ndarray
    measure: Measure

    @property
    def value(self) -> float:
        return float(self.z[-1])

    @property
    def values(self) -> np.ndarray:
        return self.z[-1:]

    def backward(self) -> "Rest":
        """The same, with the branch followed the other way."""
        return dataclasses.replace(self, tangent=-self.tangent)


class Field:
    """The field of one mode and its derivatives by all unknowns, compiled once."""

    def __init__(self, system, name: str, t0, y0: PyTree, mode, args):
        self.name = name
        _, self.unravel = ravel_pytree(y0)
        self.given = system, t0, mode, args, self.unravel

    def __call__(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = _slopes(self.name, *self.given, jnp.asarray(z))
        return np.asarray(values), np.asarray(slopes)

    def curvature(self, z: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Second derivative of a weighted sum of the rates by all unknowns."""
        return np.asarray(_curvature(self.name, *self.given, jnp.asarray(z), jnp.asarray(weights)))


def _rates(name, system, t0, mode, args, unravel, z):
    there = with_parameters(system, {name: z[-1]})
    return ravel_pytree(there.vector_field(t0, unravel(z[:-1]), mode, args))[0]


@jit_by_code
def _slopes(name, system, t0, mode, args, unravel, z):
    def field(z):
        return _rates(name, system, t0, mode, args, unravel, z)

    return field(z), jax.jacfwd(field)(z)


@jit_by_code
def _curvature(name, system, t0, mode, args, unravel, z, weights):
    def field(z):
        return weights @ _rates(name, system, t0, mode, args, unravel, z)

    return jax.jacfwd(jax.jacfwd(field))(z)


def scales_of(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factors of rows and columns with which the entries differ least from one, in powers of ten.

    Curtis and Reid, IMA Journal of Applied Mathematics 10 (1972): in other units the balanced matrix is
    the same. That the largest of each row and column is one would leave many choices. Entries that
    are then tiny are left out, since rounding may have made them.
    """
    taken = matrix != 0.0
    logs = np.log(np.where(taken, np.abs(matrix), 1.0))
    rows, columns = _least_squares(taken, logs)
    # Rounding may have made the tiny ones, and would have a say in the scales.
    taken &= logs + rows[:, None] + columns[None, :] > np.log(ENGINE.zero)
    rows, columns = _least_squares(taken, logs)
    size = np.where(taken, logs + rows[:, None] + columns[None, :], -np.inf).max(axis=1)
    return np.exp(rows - np.where(np.isfinite(size), size, 0.0)), np.exp(columns)


def _least_squares(taken: np.ndarray, logs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Terms of rows and columns whose sum is least different from minus the logarithms."""
    count, logs = taken.astype(float), np.where(taken, logs, 0.0)
    normal = np.block([[np.diag(count.sum(axis=1)), count], [count.T, np.diag(count.sum(axis=0))]])
    right = -np.concatenate([logs.sum(axis=1), logs.sum(axis=0)])
    found = np.linalg.lstsq(normal, right, rcond=1e-10)[0]
    return found[: taken.shape[0]], found[taken.shape[0] :]


def measure_of(size: np.ndarray, jacobian: np.ndarray) -> Measure:
    """The measure with these sizes; columns of zeros are as large as the size."""
    rows, columns = scales_of(jacobian)
    return Measure(size, rows, np.where(np.any(jacobian, axis=0), columns, _or_one(size)))


def _or_one(size: Any) -> np.ndarray:
    return np.where(size > 0.0, size, 1.0)


def equilibrium_at(
    field: Field, z: np.ndarray, along: np.ndarray, sense: np.ndarray, measure: Measure | None
) -> Rest | None:
    """The equilibrium in the plane through `z` across `along`; None where Newton's method fails.

    Without a measure, of a start of which nothing is known, the parameter is not changed.
    """
    start, known = z, measure

    def step(last, number):
        z, seen, measure = last
        values, jacobian = field(z)
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(jacobian))):
            return last, np.nan
        if known is None:
            measure = measure_of(np.append(np.zeros(z.size - 1), 1.0), jacobian)
        row = along * measure.columns
        length = _or_one(np.linalg.norm(row))
        matrix = np.vstack([measure.balance(jacobian), row / length])
        right = np.append(values * measure.rows, along @ (z - start) / length)
        move = _solve_balanced(matrix, right) * measure.columns
        if known is None:
            move[-1] = 0.0
        if not np.all(np.isfinite(move)):
            return last, np.nan
        z = z - move
        seen = np.maximum(seen, np.abs(z))
        if known is None:
            size = seen
            waited = np.ones(z.size, bool)
        else:
            least = measure.least(jacobian, z) / ENGINE.zero
            size = np.maximum(measure.size, np.maximum(np.abs(z), least))
            waited = measure.size > 0.0
        parts = np.where(move == 0.0, 0.0, np.abs(move) / np.where(size > 0.0, size, 1e-300))
        # A component that does not move along the branch may wander within its rounding for ever.
        if number + 1 >= ACCURACY.least_points:
            parts = np.where(waited, parts, np.minimum(parts, ACCURACY.short))
        return (z, seen, measure), np.max(parts)

    end = newton(
        step, (z, np.abs(z), measure), enough=ACCURACY.short, nearly=ENGINE.zero, most=ACCURACY.tries
    )
    if not end.solved:
        return None
    z, seen, measure = end.carried
    if known is None:
        z = _still(field, z, seen)
    return describe_rest(field, z, sense, measure)


def _solve_balanced(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution by elimination, which leaves zero what is zero; the shortest one if there are many."""
    try:
        # Elimination first: singular vectors mix all components, and a zero is one no longer.
        found = np.linalg.solve(matrix, right)
        if np.all(np.isfinite(found)) and np.linalg.norm(found) <= 1e6 * np.linalg.norm(right):
            return found
    except np.linalg.LinAlgError:
        pass
    try:
        return np.linalg.lstsq(matrix, right, rcond=1e-14)[0]
    except np.linalg.LinAlgError:
        return np.full(right.size, np.nan)


def _still(field: Field, z: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Remains of the first guess in components that vanish are removed, unless that is worse."""
    none = np.where(np.abs(z) <= ACCURACY.short * seen, 0.0, z)
    none[-1] = z[-1]
    values, other = np.abs(field(z)[0]), np.abs(field(none)[0])
    return none if np.all(other <= values) else z


def describe_rest(
    field: Field, z: np.ndarray, sense: np.ndarray, measure: Measure | None
) -> Rest | None:
    """The equilibrium at `z` with its tangent, that of the null vectors which is nearest to `sense`."""
    jacobian = field(z)[1]
    if not np.all(np.isfinite(jacobian)):
        return None
    if measure is None:
        measure = measure_of(np.append(np.zeros(z.size - 1), 1.0), jacobian)
    rates, vectors = np.linalg.eig(jacobian[:, :-1])
    order = np.lexsort((-np.imag(rates), -np.real(rates)))
    tangent = tangent_of(jacobian, sense, measure_of(measure.size, jacobian))
    return Rest(z, tangent, jacobian, rates[order], vectors[:, order], measure)


def tangent_of(jacobian: np.ndarray, sense: np.ndarray, measure: Measure) -> np.ndarray:
    """Null vector of the derivative, of length one."""
    _, found, right = np.linalg.svd(measure.balance(jacobian))
    # At a branch point there is a plane of them: the tangent is what the one before has in it.
    none = 1 + int(np.sum(found <= ENGINE.solved * max(found[0], 1e-300)))
    null, own = right[-none:], sense / measure.columns
    vector = null[-1] if none == 1 else (null @ own) @ null
    if not np.any(vector):
        vector = null[-1]
    vector = np.where(np.abs(vector) <= ENGINE.slack * np.max(np.abs(vector)), 0.0, vector)
    return of_length_one(vector * measure.columns, sense, measure)


def of_length_one(tangent: np.ndarray, sense: np.ndarray, measure: Measure) -> np.ndarray:
    """A tangent in the sense of another one; by the scales, if by the sizes it has no length."""
    length = measure.length(tangent)
    tangent = tangent / (length if length > 0.0 else np.linalg.norm(tangent / measure.columns))
    same = measure.part(tangent) @ measure.part(sense)
    same = same if same != 0.0 else (tangent / measure.columns) @ (sense / measure.columns)
    return tangent if same >= 0.0 else -tangent


def angle_of(one: np.ndarray, other: np.ndarray, measure: Measure) -> float:
    """Between two tangents [rad]."""
    one, other = measure.part(one), measure.part(other)
    size = np.linalg.norm(one) * np.linalg.norm(other)
    return float(np.arccos(np.clip(one @ other / size, -1.0, 1.0))) if size > 0.0 else 0.0


def next_measure(measure: Measure, rest: Rest, new: Rest, extent: np.ndarray) -> Measure:
    """The measure at the next equilibrium: sizes of the extent that the branch has had so far.

    Larger ones are those by which the components move until the parameter has changed by the bounds'
    distance, as slope and curvature of the branch let expect. Near a fold the parameter, as a function
    of a component, tells it; where a component begins to move, this one as a function of the parameter.
    The smaller of the two is taken.
    """
    own = measure_of(measure.size, new.jacobian)
    least = own.least(new.jacobian, new.z)
    far = extent
    if rest.tangent[-1] != 0.0 and new.tangent[-1] != 0.0 and new.value != rest.value:
        far = np.maximum(far, _expected_moves(rest, new, measure.size[-1]))
    size = np.maximum(measure.size, np.where(far > least, far, 0.0))
    size[-1] = measure.size[-1]
    return dataclasses.replace(own, size=size)


def _expected_moves(rest: Rest, new: Rest, span: float) -> np.ndarray:
    """Moves of the components while the parameter changes by a span."""
    before, slope = (point.tangent / point.tangent[-1] for point in (rest, new))
    move, change = new.z - rest.z, new.value - rest.value
    # The parabola over the parameter has no end at a fold, that over the component has none at rest.
    far = np.abs(slope) * span + 0.5 * np.abs((slope - before) / change) * span**2
    moved = (slope != 0.0) & (before != 0.0) & (move != 0.0)
    one = np.ones(move.size)
    rate, old = (1.0 / np.where(moved, s, one) for s in (slope, before))
    bend = np.abs((rate - old) / np.where(moved, move, one))
    other = 2.0 * span / (np.abs(rate) + np.sqrt(rate**2 + 2.0 * bend * span))
    return np.where(moved, np.minimum(far, other), np.abs(slope) * span)
