"""Unknowns to be found, and the data they are found from."""

import dataclasses
import hashlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._argument_checks import (
    callable_as,
    check_arguments,
    count,
    flag,
    instance,
    number,
    or_none,
    reals,
)
from .._show import amount
from .._types import Given, NamedNumbers
from .._validation import (
    as_parameter,
    check_finite,
    check_mapping,
    is_concrete,
    one_row,
    refusal,
    shape_refusal,
    whole_number,
)
from ..hybrid import Integrator, Solution
from ..progress import Progress
from ._accuracy import ACCURACY
from ._corrections import Correct, correction_of
from ._evaluate import solve_run
from ._fit import Fit, best, one_fit, probability
from ._further_record import known_of_further, with_own
from ._gauss_newton import LevenbergMarquardt
from ._many_starts import many_fits, rows_of, sobol_starts
from ._methods import AbstractMethod
from ._observed import Observed, data_of, observed_of, records_of, with_noise_of
from ._prediction import Prediction, Score, known_by, predict, score
from ._record import Record
from ._run import Run, motion_of, residual_of
from ._stamps import warn_of_wide_stamps
from ._unknown import Unknown
from ._unknowns import NamedUnknowns, NamedValues, scalars, space_of


class Simulation(eqx.Module):
    """Values that would have been observed in a record: rows by name at `times` [s], and the
    `Solution`.

    With inputs that jump, states of the solution are those of `stickslip.WithBreaks`.
    """

    times: Float[Array, " time"]
    observed: dict[str, Float[Array, " time"]]
    solution: Solution

    def __repr__(self) -> str:
        names = ", ".join(self.observed)
        return f"Simulation: {names} at {amount(self.times.shape[-1], 'time')}; {self.solution!r}"


A_METHOD = "a method such as LevenbergMarquardt() or MultipleShooting(20)"
_RECORD = instance((int, np.integer, Record), "the number of a record, or a Record")
_HOW = {"method": or_none(instance(AbstractMethod, A_METHOD)), "chunk_size": or_none(count(1))}


class Problem:
    r"""Unknowns of a system, and the records to estimate them from.

    >>> import numpy as np
    >>> import stickslip as ss
    >>> from stickslip.systems import CoulombOscillator, Motion
    >>> times = np.linspace(0.0, 10.0, 21)
    >>> problem = Problem(
    ...     system=lambda p, inputs: CoulombOscillator(1.0, p["k"], 1.0, 0.5, 0.2),
    ...     initial_state=lambda p, inputs: Motion(x=p["x"], v=0.2),
    ...     unknowns={"k": 1.2, "x": Unknown(0.1, unit="m", per_record=True)},
    ...     observed={"position": Observed(lambda t, y, system: y.x, 1e-3, "m")},
    ...     records=Record(times, {"position": np.minimum(0.2 * times, 1.0)}),
    ... )
    >>> sorted(problem.unknowns)
    ['k', 'x[0]']

    **Arguments**

    - `system(values, inputs)`: the hybrid system under values of the unknowns by name, and what is
      `known` of the record; `inputs` are the record's `Signal`s by name. A signal that becomes a part
      of the system, a field of it, makes its jumps and bends known to the engine.
    - `initial_state(values, inputs)` at `begin` of the record.
    - `unknowns`: by name an `Unknown` or a positive number. One that is `per_record` is as many
      unknowns, `name[record]`, by the record's name or number; the two functions see it as `name`.
    - `observed`: by name an `Observed`. Every value of a record has the name of one.
    - `records`: a `Record` or several. All have the same inputs and the same `known` numbers. Records
      of different lengths share one program.
    - `integrator`: as for `simulate`.
    - `delay`: name of the unknown, or the known number, by which stamps are later than the motion [s].
    - `correct(values, state, innovations)`: the state just after a stamp, from that just before it and
      from what was measured there less what was predicted, by name, 0 where it is missing. With a known
      gain, $x^+ = x^- + K (y - h(x^-))$, an observer: every residual is then an error of prediction
      from one stamp to the next, and noise that enters the motion itself does no harm; `sd` is that
      of the innovations. Without, the whole motion is predicted from its beginning. At a stamp at which
      the record begins nothing is corrected. L. Ljung, System Identification (1999), section 4.3.
      Or a `KalmanFilter`, whose gain follows from how fast a state wanders, an unknown like any other.

    Of data from a closed loop, let the known controller be a part of the system, its reference the
    input, and observe position, speed or command: what disturbs the machine is then noise of the fit.
    As an input the measured command answers the disturbances, and they are taken for the machine,
    unless `correct` takes them for what they are.

    **Raises** `TypeError`, `ValueError` for anything else, before anything is traced.
    """

    @check_arguments(
        system=callable_as("f(values, inputs)", {}, {}),
        initial_state=callable_as("f(values, inputs)", {}, {}),
        integrator=or_none(instance(Integrator, "an Integrator or None")),
        correct=correction_of,
    )
    def __init__(
        self,
        system: Given[Callable[[NamedValues, dict], Any]],
        initial_state: Given[Callable[[NamedValues, dict], Any]],
        unknowns: NamedUnknowns,
        observed: Given[Mapping[str, Observed]],
        records: Given[Record | Sequence[Record]],
        *,
        integrator: Given[Integrator | None] = None,
        delay: Given[str | None] = None,
        correct: Given[Correct | None] = None,
    ):
        scalars("unknowns", unknowns)
        self.given = dict(unknowns)
        stated = observed_of(observed)
        self.records = records_of(records, stated)
        self.observed = with_noise_of(stated, self.records)
        self.labels = tuple(r.name or str(i) for i, r in enumerate(self.records))
        if len(set(self.labels)) < len(self.labels):
            raise refusal("records", self.labels, "records with different names")
        for name in self.records[0].known:
            if name in self.given:
                raise refusal(f"unknowns[{name!r}]", self.given[name], "not also known of the records")
        names = {*self.given, *self.records[0].known}
        if delay is not None and (not isinstance(delay, str) or delay not in names):
            raise refusal("delay", delay, f"None or one of {', '.join(sorted(names))}")
        local = [name for name in sorted(self.given) if _is_local(self.given[name])]
        self._run = Run(
            system,
            initial_state,
            tuple((name, o.function) for name, o in self.observed.items()),
            integrator,
            delay,
            tuple(name for name in sorted(self.given) if name not in local),
            tuple((name, tuple(f"{name}[{label}]" for label in self.labels)) for name in local),
            correct,
        )
        self._lengths = tuple(record.times.size for record in self.records)
        self._data = data_of(self.records, self.observed)

    def __repr__(self) -> str:
        stamps = sum(self._lengths)
        return (
            f"Problem: {', '.join(self.unknowns)} from {', '.join(self.observed)} at "
            f"{amount(stamps, 'time')} in {amount(len(self.records), 'record')}"
        )

    @property
    def unknowns(self) -> dict[str, Any]:
        """Every unknown by name, those per record one by one."""
        found = {name: self.given[name] for name in self._run.shared}
        for name, parts in self._run.local:
            found |= dict.fromkeys(parts, self.given[name])
        return found

    @property
    def residual_function(self) -> Callable[[NamedValues], Float[Array, " row"]]:
        """`residual` without checks, a function of values by name for what calls it many times."""
        run, data = self._run, self._data
        return lambda values: run(values, data)

    def residual(self, values: NamedNumbers) -> Float[Array, " row"]:
        """Residuals (model - data)/sd of everything measured: record after record, in each one observed
        quantity after the other, in each the times in order. Missing values have no row. Those of a
        `KalmanFilter` are of its innovations, and two times as many rows, of their sizes, come behind.

        **Arguments:** `values`, numbers by the names of `unknowns`. **Raises** `TypeError`,
        `ValueError` for a name too few or too many, or a value that is not finite.
        NaN in the row where a run fails.
        """
        return residual_of(self._run, self._values(values), self._data)

    def log_density(self, values: NamedNumbers) -> Float[Array, ""]:
        r"""$-\tfrac12\|r\|^2$ and the logarithms of the priors, up to a constant; $-\infty$ where a run
        fails. **Arguments**, **Raises** as `residual`."""
        found = self._values(values)
        row = residual_of(self._run, found, self._data)
        prior = space_of("unknowns", self.unknowns)[0].prior_rows(found)
        density = -0.5 * (jnp.sum(row**2) + jnp.sum(prior**2))
        return jnp.where(jnp.isfinite(density), density, -jnp.inf)

    def simulate(self, values: NamedNumbers, record: int = 0) -> Simulation:
        """The motion in one record, by its number, never corrected. **Raises** as `residual`."""
        found = self._values(values)
        whole_number("record", record, 0, len(self.records) - 1)
        rows, solution = motion_of(self._run, found, self._data, jnp.asarray(record))
        times = self.records[record].times
        names = self.observed
        rows = {name: rows[i, : times.size] for i, name in enumerate(names)}
        return Simulation(jnp.asarray(times), rows, solution)

    def parts(self, residual: Given[Array | np.ndarray]) -> dict[str, dict[str, tuple[Any, Any]]]:
        """A row of `residual`, or of `Fit.data_residual`, in parts: by record and observed quantity its
        times [s] and residuals.

        **Raises** `ValueError` for a row of another length.
        """
        count = self._data.keep.size
        residual = reals(self, "residual", residual)
        if np.shape(residual) == (self._run.kinds * count,):
            residual = residual[:count]
        if np.shape(residual) != (count,):
            raise shape_refusal("residual", residual, f"one row of {count}")
        found, at = {}, 0
        for label, record in zip(self.labels, self.records, strict=True):
            found[label] = {}
            for name in self.observed:
                if name in record.values:
                    times = record.times[record.present[name]]
                    found[label][name] = (times, residual[at : at + times.size])
                    at += times.size
        return found

    @check_arguments(starts=or_none(count(1)), seed=count(0), **_HOW)
    def fit(
        self,
        *,
        method: Given[AbstractMethod | None] = None,
        start: NamedNumbers | None = None,
        starts: Given[int | None] = None,
        seed: int = 0,
        chunk_size: int | None = None,
    ) -> Fit:
        """Estimate the unknowns.

        **Arguments:** `method`, by default `LevenbergMarquardt()`, or `GaussNewton()`,
        `GradientDescent(...)`, `MultipleShooting(...)`, `Homotopy(...)`; `start`, values by name in
        place of the unknowns' own; `starts`: the best of so many, spread by `sobol_starts` with `seed`;
        `chunk_size` as for `many_starts`. **Returns** a `Fit`. **Raises** `TypeError`, `ValueError` for
        anything else. Warns, before anything runs, where the model swings twice or more between two
        stamps, as it does where these are in milliseconds; and of a fit that converged and leaves
        residuals far above their noise.
        """
        method = self._method(method)
        unknowns = self.unknowns
        if start is not None:
            unknowns = _with_starts(unknowns, check_mapping("start", start), "start")
        warn_of_wide_stamps(self._run, unknowns, self._data, self.records[0].times)
        if starts is not None:
            rows = sobol_starts(unknowns, starts, seed=seed)
            return best(self.fits(rows, method=method, chunk_size=chunk_size))
        space, first = scalars("unknowns", unknowns)
        with Progress("fit"):
            near, taken = method.brought_near(self._run, self._data, space, first)
            fit = solve_run(method.polish, self._run, self._data, space, space.coordinates(near))
        fit = self._told(fit, taken)
        self._warn_of_misfit(fit)
        return fit

    @check_arguments(**_HOW)
    def fits(
        self,
        starts: Given[Mapping[str, Any]],
        *,
        method: Given[AbstractMethod | None] = None,
        chunk_size: int | None = None,
    ) -> Fit:
        """One fit from each of many `starts`, rows of values by name; see `many_starts`."""
        method = self._method(method)
        rows = _with_starts(self.unknowns, check_mapping("starts", starts), "starts")
        for name, row in starts.items():
            one_row(f"starts[{name!r}]", row)
        space, found = rows_of("starts", rows)
        with Progress("fits"):
            near, taken = method.many_near(self._run, self._data, space, found, chunk_size)
            fits = many_fits(method.polish, self._run, space, near, (self._data,), chunk_size)
        return self._told(fits, taken)

    def with_records(self, records: Given[Record | Sequence[Record]]) -> "Problem":
        """The same problem with other records; of the same shapes, they use the compiled programs."""
        run = self._run
        return Problem(
            run.system, run.initial_state, self.given, self.observed, records,
            integrator=run.integrator, delay=run.delay, correct=run.correct,
        )  # fmt: skip

    @check_arguments(
        fit=one_fit, level=probability, draws=or_none(count(2)), seed=count(0), robust=flag,
        record=_RECORD, after=number("not negative"),
    )  # fmt: skip
    def predict(
        self,
        fit: Given[Fit],
        record: Given[int | Record] = 0,
        *,
        level: float = 0.95,
        draws: int | None = None,
        seed: int = 0,
        robust: bool = False,
        after: float = 0.0,
    ) -> Prediction:
        """The motion that a fit of these unknowns predicts of a record, with bands; never corrected.

        **Arguments:** `fit`, also of other records or a `load_fit`; `record`, the number of one of the
        problem's, or a further `Record`; `level` of the bands. By default they follow from the
        Jacobian, to first order; with `draws` they are quantiles of so many motions with unknowns drawn
        from the normal distribution of their coordinates, by `seed`, which keep the bounds and see
        whatever bends; `robust`: without trust in the stated noise, for a fit that leaves residuals far
        above it. Unknowns per record of a further one are found from what it measures before `after`
        [s], and are as uncertain as that and the shared ones leave them. **Returns** a `Prediction`.
        **Raises** `TypeError`, `ValueError` for anything else, as a fit of other unknowns, or where
        nothing comes before `after` that unknowns per record could be found from.
        """
        problem, which = self._with(record)
        if problem is not self and self._run.local and {*self._run.shared} <= {*fit.names}:
            known = known_of_further(problem, fit, float(after))
        else:
            problem._values(problem._of_fit(fit))
            known = known_by(fit)
        return predict(problem, known, which, float(level), draws, seed, robust)

    @check_arguments(after=number("not negative"), windows=count(1), record=_RECORD)
    def score(
        self,
        fit: Given[Fit] | NamedNumbers,
        record: Given[int | Record] = 0,
        *,
        after: float = 0.0,
        windows: int = 1,
    ) -> Score:
        """How far a record is from the motion of a fit, which runs freely from its start.

        **Arguments:** `fit`, or values by name; `record` as for `predict`; `after` [s]: what begins the
        record and is not counted; `windows`: in how many parts the rest is scored. The motion starts as
        the problem's `initial_state` says, fitted where this depends on unknowns. Unknowns per record
        of a further one are found from what it measures before `after`, the others staying as they
        are. **Returns** a `Score`. **Raises** as `predict`, and `ValueError` where nothing comes before
        `after` that such unknowns could be found from.
        """
        problem, which = self._with(record)
        given, shared = fit.values if isinstance(fit, Fit) else fit, self._run.shared
        if problem is not self and self._run.local and {*shared} <= {*given}:
            # Of a fit the records may be called as this one is.
            if isinstance(fit, Fit) or not {*problem.unknowns} <= {*given}:
                given, _ = with_own(problem, {name: given[name] for name in shared}, float(after))
        elif isinstance(fit, Fit):
            given = problem._of_fit(fit)
        values = problem._values(given, "fit")
        rows = problem.simulate(values, which).observed
        rows = {name: np.asarray(row) for name, row in rows.items()}
        return score(problem, rows, which, float(after), windows)

    @property
    def digest(self) -> str:
        """Of all numbers of the records and of the stated noise; a `Fit` keeps that of its data."""
        sums = hashlib.sha256()
        for path, leaf in jax.tree_util.tree_leaves_with_path(self._data):
            array = np.ascontiguousarray(leaf)
            sums.update(f"{jax.tree_util.keystr(path)} {array.dtype} {array.shape}".encode())
            sums.update(array.tobytes())
        return sums.hexdigest()

    def _with(self, record: int | Record) -> tuple["Problem", int]:
        """The problem that has the record, and its number there."""
        if isinstance(record, Record):
            return self.with_records(record), 0
        whole_number("record", record, 0, len(self.records) - 1)
        return self, record

    def _of_fit(self, fit: Fit) -> NamedValues:
        """The estimates, of these unknowns."""
        if set(fit.names) != set(self.unknowns):
            given = f"Fit of {', '.join(fit.names)}"
            raise refusal("fit", given, f"a Fit of {', '.join(self.unknowns)}")
        return fit.values

    def _told(self, fit: Fit, taken: int | np.ndarray) -> Fit:
        """With the steps that were taken before, the digest of the data and when they were taken."""
        steps = fit.steps + jnp.asarray(taken, jnp.int32)
        digest = self.digest if is_concrete(self._data) else ""
        records, observed, times = self._data.present.shape
        instants = self._data.keep // (observed * times) * times + self._data.keep % times
        instants = jnp.broadcast_to(instants, (*steps.shape, instants.size))
        return dataclasses.replace(
            fit, steps=steps, digest=digest, instants=instants, grid=(records, times)
        )

    def _warn_of_misfit(self, fit: Fit) -> None:
        """A word on a fit that is successful and does not explain the data."""
        left = fit.reduced_chi_squared
        if is_concrete(fit) and bool(fit.successful) and float(left) > ACCURACY.poor_fit:
            warnings.warn(
                f"The fit converged, and its reduced chi squared is {float(left):.3g}: the residuals "
                "are far above their noise. Standard errors that trust it are too small; see "
                "fit.standard_errors(robust=True).",
                stacklevel=4,
            )

    def _method(self, method: AbstractMethod | None) -> AbstractMethod:
        method = LevenbergMarquardt() if method is None else method
        method.check_run(self._run)
        return method

    def _values(self, values: Any, argument: str = "values") -> NamedValues:
        values, names = check_mapping(argument, values), self.unknowns
        if set(values) != set(names):
            raise refusal(argument, values, f"numbers by the names {', '.join(names)}")
        for name, value in values.items():
            check_finite(f"{argument}[{name!r}]", value)
            if np.shape(value) != ():
                raise shape_refusal(f"{argument}[{name!r}]", value, "one number")
        return {name: as_parameter(values[name]) for name in names}


def _with_starts(unknowns: dict[str, Any], starts: dict[str, Any], argument: str) -> dict[str, Any]:
    """The same unknowns with other starts."""
    if set(starts) != set(unknowns):
        raise refusal(argument, starts, f"numbers by the names {', '.join(unknowns)}")
    return {
        name: Unknown(
            starts[name], given.bounds, given.prior, given.unit, given.per_record, given.scale
        )
        if isinstance(given, Unknown)
        else starts[name]
        for name, given in unknowns.items()
    }


def _is_local(given: Any) -> bool:
    return isinstance(given, Unknown) and given.per_record
