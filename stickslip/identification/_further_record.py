"""A further record with unknowns of its own: they are found from its first part."""

from typing import Any

import numpy as np

from .._validation import refusal
from ._fit import Fit, coordinate_covariance
from ._prediction import Known, Part, rows_and_slopes
from ._record import Record
from ._unknowns import Space


def with_own(problem: Any, shared: dict[str, Any], after: float) -> tuple[dict[str, Any], Fit]:
    """Values of the unknowns of a problem's one record, and the fit that has found its own: from what
    it measures before `after` [s], the `shared` ones staying as they are."""
    run, (record,) = problem._run, problem.records
    own = dict(run.local)
    early = _early(record, after)
    if not early.any():
        allowed = f"above 0: {', '.join(own)} of a further record are found from what comes before"
        raise refusal("after", after, allowed)
    begins = Record(
        record.times, record.values, inputs=record.inputs, begin=record.begin, name=record.name,
        missing={name: ~(there & early) for name, there in record.present.items()},
        known={**record.known, **shared},
    )  # fmt: skip
    unknowns = {name: problem.given[name] for name in own}
    found = type(problem)(
        run.system, run.initial_state, unknowns, problem.observed, begins, integrator=run.integrator,
        delay=run.delay, correct=run.correct,
    ).fit()  # fmt: skip
    return {**shared, **found.values}, found


def known_of_further(problem: Any, fit: Fit, after: float) -> Known:
    r"""How well the unknowns of a problem's one record are known, of which a fit has the shared ones.

    Its own ones are found at the shared estimates $\hat s$ from the residuals $r$ of what comes before
    `after` [s]. Had the shared ones been others, they would be others too, to first order by
    $A = -(J_l^T J_l)^{-1} J_l^T J_s$; what that part leaves open of them comes on top. Thus their
    coordinates are $A (s - \hat s) + e$ away, $e$ with the covariance $(J_l^T J_l)^{-1}$.
    """
    (record,), names = problem.records, problem._run.shared
    values, found = with_own(problem, {name: fit.values[name] for name in names}, after)
    rows = [fit.names.index(name) for name in names]
    space = Space(*(
        tuple(getattr(fit.space, field)[i] for i in rows) + tuple(getattr(found.space, field))
        for field in ("names", "bounds", "units", "stated", "scales", "priors")
    ))  # fmt: skip
    z = np.asarray(space.coordinates(values))
    _, slopes = rows_and_slopes(problem, space, z, 0)
    early = _early(record, after)
    there = np.stack([record.present[name] & early for name in problem.observed])
    jacobian = (slopes[:, : early.size] / problem._data.deviations[:, None, None])[there]
    of_shared, of_own = jacobian[:, : len(names)], jacobian[:, len(names) :]
    follows = -np.asarray(coordinate_covariance(found, False)) @ of_own.T @ of_shared
    moves = np.zeros((z.size, len(fit.names)))
    moves[:, rows] = np.vstack([np.eye(len(names)), follows])
    return Known(space, z, [Part(fit, moves), Part(found, np.eye(z.size)[:, len(names) :])])


def _early(record: Record, after: float) -> np.ndarray:
    return record.times < record.times[0] + after
