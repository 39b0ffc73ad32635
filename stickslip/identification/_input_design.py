r"""Inputs whose data show most of the unknowns."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, choice, count, instance, or_none
from .._types import Given
from .._validation import (
    check_callable,
    check_finite,
    check_known,
    is_concrete,
    refusal,
    shape_refusal,
)
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._evolution import Evolution
from ._many_starts import LANES, asked_width, check_shared, evaluate_rows, evaluator
from ._sensitivity import Sensitivity
from ._unknowns import NamedUnknowns, names_among, scalars

Limits: TypeAlias = Given[float | Sequence[Any] | np.ndarray | Array | None]
CRITERIA = ("D", "A")


def _known_numbers(owner: Any, name: str, value: Any) -> Any:
    return check_finite(name, check_known(name, value))


@check_arguments(
    rounds=count(1), population=count(4), seed=count(0), start=or_none(_known_numbers)
)  # fmt: skip
class CMAES(eqx.Module):
    """The search of `design_input`: covariance matrix adaptation, a `population` of inputs a round.

    **Arguments:** `rounds`; `population`, at least 4; `seed` of the draws; `start`: coefficients to
    begin with; by default the best of the first population, which is spread evenly. **Raises**
    `TypeError`, `ValueError` for anything else.
    """

    rounds: int = 40
    population: int = 64
    seed: int = 0
    start: Limits = None


class InputDesign(eqx.Module):
    """Result of `design_input`.

    - `coefficients`: of the best input. `value`: of the criterion there, in nats; see `design_input`.
    - `sensitivity`: a `Sensitivity` there, with the standard errors to be expected.
    - `history`: best value until the end of each round. `first`: of the coefficients it began with.
    """

    coefficients: Float[Array, "*coefficient"]
    value: Float[Array, ""]
    sensitivity: Sensitivity
    history: Float[Array, " round"]
    first: Float[Array, ""]


@check_arguments(
    criterion=choice(CRITERIA), search=or_none(instance(CMAES, "a CMAES(...) or None")), **LANES
)
def design_input(
    residual: Given[Callable[..., Any]],
    values: NamedUnknowns,
    low: Limits,
    high: Limits,
    *shared: PyTree,
    criterion: str = "A",
    about: Given[Sequence[str] | None] = None,
    search: Given[CMAES | None] = None,
    chunk_size: int | None = None,
    executor: str = "auto",
) -> InputDesign:
    r"""Coefficients of an input, within limits, whose data show most of the unknowns.

    With the sensitivity $S$ of the residuals by the coordinates of the unknowns (for positive ones
    their logarithms) and $C = (S^T S)^{-1}$, the covariance to be expected, $C_a$ its part of the
    unknowns `about` which one asks, what is made as great as possible is

    - `"D"`: $-\ln\det C_a$, two for each factor e in the volume of the region of confidence;
    - `"A"`: $-\ln\mathrm{tr}\,C_a$, two for each factor e in the quadratic mean of the standard errors.

    $S$ is exact, by forward mode through all events. The criterion has no exact gradient, because
    second derivatives through events raise an error; and it has kinks and jumps where the order of
    events changes. So the greatest is sought from values alone, a `population` of inputs at a time,
    by covariance matrix adaptation (CMA-ES). For CoreXY (48 coefficients, 3,840 inputs, criterion
    `"D"`) that gained 15.6 nats over one of 64 random inputs, quasi-Newton steps with finite
    differences 5.5. These 15.6 were spent on combinations: inputs after which events almost graze show
    one of them with a sensitivity beyond measure, while each unknown by itself was known four times
    worse than before. `"A"`, the default, does not pay for that; look at `singular_values`.

    **Arguments**

    - `residual(values, coefficients, *shared)`: one row, in standard deviations of the noise; the data
      in it do not matter, only what is computed.
    - `values`: by name positive numbers or `Unknown`s, at which the information is taken; priors count.
    - `low`, `high`: limits of the coefficients, arrays of one shape, or a number for one of them.
    - `shared`: arrays handed on.
    - `about`: names of unknowns, all by default; the others are then unknown too, but of no interest.
    - `search`: how many inputs are tried, from where, by default `CMAES()`. `chunk_size`, `executor` as
      for `many_starts`.

    **Returns** an `InputDesign`. **Raises** `TypeError`, `ValueError` for anything else, and where no
    input of the first population shows all unknowns `about`. It is a loop of Python and does not
    work under `jit`.

    Source: Fedorov, Theory of Optimal Experiments (1972); Hansen, arXiv:1604.00772.
    """
    low, high = _limits(low, high)
    check_callable("residual", residual, "f(values, coefficients, *shared)", {}, low, *shared)
    space, found = scalars("values", values)
    if not is_concrete(found):
        raise refusal("values", values, "known: this is a loop of Python, call it outside of jit")
    kept = np.array([space.names.index(a) for a in names_among("about", about, space.names)])
    check_shared(shared)
    search = CMAES() if search is None else search
    begin = None if search.start is None else _start(search.start, low, high)
    population, seed = search.population, search.seed
    z = np.broadcast_to(np.asarray(space.coordinates(found)), (population, len(space.names)))
    shared = jax.tree.map(lambda a: np.broadcast_to(a, (population, *np.shape(a))), shared)
    rows = np.arange(population)

    def value_inputs(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Criterion and sensitivities of inputs in parts of the limits."""
        inputs = low + points.reshape(population, *low.shape) * (high - low)
        program, each = evaluator(residual, space, chunk_size, executor, population, (inputs, *shared))
        matrix = evaluate_rows(program, z, each, rows, asked_width(program, chunk_size))[1]
        return np.array([_criterion(one, kept, criterion) for one in matrix]), matrix

    points = np.random.default_rng(seed).uniform(size=(population, low.size))
    if begin is not None:
        points[0] = ((begin - low) / (high - low)).ravel()
    told, matrices = value_inputs(points)
    if not np.isfinite(told).any():
        names = ", ".join(space.names[i] for i in kept)
        raise refusal("about", names, "unknowns that the data of at least one input show")
    at = int(np.argmax(np.where(np.isfinite(told), told, -np.inf))) if begin is None else 0
    first = told[at]
    best = (first if np.isfinite(first) else -np.inf), points[at], matrices[at]
    evolution, history = Evolution(points[at], ACCURACY.design_step, population, seed + 1), []
    for _ in range(search.rounds):
        points = evolution.ask()
        told, matrices = value_inputs(points)
        evolution.tell(told)
        at = int(np.argmax(np.where(np.isfinite(told), told, -np.inf)))
        if told[at] > best[0]:
            best = told[at], points[at], matrices[at]
        history.append(best[0])
    value, point, matrix = best
    coefficients = low + point.reshape(low.shape) * (high - low)
    return InputDesign(
        jnp.asarray(coefficients), jnp.asarray(value), Sensitivity(space.names, jnp.asarray(matrix)),
        jnp.asarray(np.array(history)), jnp.asarray(first),
    )  # fmt: skip


def _criterion(matrix: np.ndarray, kept: np.ndarray, criterion: str) -> float:
    """In nats; NaN where the data do not show all that is asked for."""
    if not np.isfinite(matrix).all():
        return np.nan
    information = matrix.T @ matrix
    others = np.setdiff1d(np.arange(len(information)), kept)
    # Information left about some if the others are unknown: the Schur complement.
    left = information[np.ix_(kept, kept)]
    if others.size:
        mixed = information[np.ix_(others, kept)]
        inner = information[np.ix_(others, others)]
        inverse = np.linalg.pinv(inner, rcond=ENGINE.some_roundings, hermitian=True)
        left = left - mixed.T @ inverse @ mixed
    sizes = np.linalg.eigvalsh(left)
    if not sizes[0] > ENGINE.some_roundings * np.max(np.diag(information)):
        return np.nan
    return float(np.sum(np.log(sizes)) if criterion == "D" else -np.log(np.sum(1.0 / sizes)))


def _limits(low: Any, high: Any) -> tuple[np.ndarray, np.ndarray]:
    for name, limit in (("low", low), ("high", high)):
        _known_numbers(None, name, limit)
    shapes = np.shape(low), np.shape(high)
    if shapes[0] != shapes[1] and () not in shapes:
        raise shape_refusal("high", high, f"a number or of shape {shapes[0]}, as low")
    low, high = (np.array(a, np.float64) for a in np.broadcast_arrays(low, high))
    if not low.size or low.ndim == 0:
        raise shape_refusal("low", low, "an array, unless high is one")
    if np.any(low >= high):
        at = tuple(int(i) for i in np.argwhere(low >= high)[0])
        raise refusal(f"low[{at}]", low[at].item(), f"below high, {high[at].item()}")
    return low, high


def _start(start: Any, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    found = np.asarray(start, np.float64)
    if found.shape != low.shape:
        raise shape_refusal("start", start, f"of shape {low.shape}, as the limits")
    if np.any((found < low) | (found > high)):
        raise refusal("start", start, "within the limits low and high")
    return found
