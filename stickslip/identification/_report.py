"""All that a fit shows and all that it leaves open, on one page."""

import dataclasses
import os
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .._argument_checks import check_arguments, count, flag, instance, or_none, text
from .._show import columns_aligned
from .._types import Given, NamedRows, Path
from .._validation import check_mapping, check_type, is_concrete, refusal, shape_refusal
from ..hybrid import Solution, same_mode_sequence
from ..hybrid.status import flags_text
from ._accuracy import ACCURACY
from ._compare import Comparison, rows_by_name
from ._fit import Fit, one_fit
from ._profile import Profile
from ._report_html import page
from ._report_plot import draw_report
from ._unseen import unseen
from ._whiteness import Correlation, LjungBox, autocorrelation, cross_correlation, ljung_box


class Whiteness:
    """Of one series of residuals: `series`, `own` correlation, `test`, `with_input` by input; `mean` in
    standard errors of white noise."""

    def __init__(self, series: np.ndarray, own: Correlation, test: LjungBox, with_input: dict):
        self.series, self.own, self.test, self.with_input = series, own, test, with_input
        number = np.isfinite(series).sum()
        self.mean = float(np.nanmean(series) / np.nanstd(series) * np.sqrt(number))


@dataclasses.dataclass(frozen=True, eq=False)
class Report:
    """Estimates, intervals, verdicts, what is not seen, tests of the residuals, held-out scores.

    `print` shows it as text, `to_dataset` as a Dataset, `plot` in pictures, `to_html` as a page.
    Fields: `fit`, `profile`, `whiteness` by series, `held_out` root mean squares by name, `comparison`,
    `title`, `hidden` sentences on combinations not seen, `modes` sentences on the runs.
    """

    fit: Fit
    profile: Profile | None
    whiteness: Mapping[str, Whiteness]
    held_out: Mapping[str, float]
    comparison: Comparison | None
    modes: list[str]
    hidden: list[str]
    title: str

    def rows(self) -> list[list[str]]:
        """The table of estimates, its head first."""
        head = ["unknown", "estimate", "unit", "standard error", "robust error", "Wald 95%"]
        profile = self.profile
        if profile is not None:
            head += [f"profile {100 * float(profile.level):g}%", "verdict"]
        table = [[*head, "bound"]]
        errors, wald = self.fit.standard_errors(), self.fit.interval()
        robust = self.fit.standard_errors(robust=True)
        for name, unit in self.fit.units.items():
            value, error = float(self.fit.values[name]), float(errors[name])
            row = [name, f"{value:.6g}", unit or "-", f"{error:.3g}", f"{float(robust[name]):.3g}"]
            low, high = map(float, wald[name])
            row += [f"{low:.6g} to {high:.6g}" if np.isfinite(error) else "none"]
            if profile is not None:
                known = name in profile.names
                row += [" to ".join(profile.ends_in_words(name)) if known else "not asked for"]
                row += [profile.verdicts[name] if known else ""]
            side = int(self.fit.active_bounds[name])
            table.append([*row, {0: "", -1: "at the lower", 1: "at the upper"}[side]])
        return table

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of the estimates, by the linearised problem; NaN for unknowns it does not see."""
        return np.asarray(self.fit.correlation())

    def correlation_rows(self) -> list[list[str]]:
        """The table of correlations, its head first."""
        names = self.fit.names
        table = [["", *names]]
        for name, row in zip(names, self.correlation, strict=True):
            table.append([name, *(f"{c:+.3f}" if np.isfinite(c) else "-" for c in row)])
        return table

    def statements(self) -> list[str]:
        """Sentences of the report."""
        fit = self.fit
        said = [
            f"{'Converged' if bool(fit.successful) else 'Did NOT converge'} in {int(fit.steps)} steps; "
            f"reduced chi squared {float(fit.reduced_chi_squared):.4g} of "
            f"{np.isfinite(np.asarray(fit.data_residual)).sum()} residuals."
        ]
        if self.profile is not None and float(self.profile.fall) > 0.1:
            said.append(
                f"The profile found a sum of squares {float(self.profile.fall):.3g} below the fit's: "
                "the fit is not the best minimum."
            )
        if float(fit.reduced_chi_squared) > ACCURACY.poor_fit:
            said.append(
                "The residuals are far above their noise, which standard errors, intervals and "
                "verdicts trust: these are too narrow. Robust errors see how large the residuals are "
                "and how long they hang together, and no error of the model. Try more starts, another "
                "model, or more noise."
            )
        hidden = [f"What the data see: {s}." for s in self.hidden]
        said += hidden or ["The data see all unknowns, to first order."]
        for name, found in self.whiteness.items():
            test = found.test
            p = float(test.p_value)
            said.append(
                f"{name}: {'NOT white' if p < 0.05 else 'white as far as it shows'}, Ljung-Box "
                f"{float(test.statistic):.4g} with {test.degrees} degrees of freedom, p = {p:.2g}; "
                f"autocorrelation outside of its band at {float(found.own.outside):.0%} of the lags; "
                f"mean {found.mean:.2g} standard errors."
            )
            for other, both in found.with_input.items():
                said.append(
                    f"{name} with input {other}: correlation outside of its band at "
                    f"{float(both.outside):.0%} of the lags, largest {_largest(both)}."
                )
        said += [
            f"Held-out {name}: root mean square {score:.6g}." for name, score in self.held_out.items()
        ]
        return said + self.modes

    def __str__(self) -> str:
        parts = [self.title, "", *columns_aligned(self.rows()), "", "Correlation of the estimates"]
        parts += [*columns_aligned(self.correlation_rows()), "", *self.statements()]
        if self.comparison is not None:
            parts += ["", "Models compared", str(self.comparison)]
        return "\n".join(parts)

    __repr__ = __str__

    def to_dataset(self) -> xr.Dataset:
        """Everything with labels: dimensions `unknown`, `other` unknown, `side`, `point`, `series`,
        `lag`, `record`."""
        fit, names = self.fit, list(self.fit.names)
        errors, robust = fit.standard_errors(), fit.standard_errors(robust=True)
        data: dict[str, Any] = {
            "estimate": ("unknown", [float(fit.values[n]) for n in names]),
            "standard_error": ("unknown", [float(errors[n]) for n in names]),
            "robust_error": ("unknown", [float(robust[n]) for n in names]),
            "unit": ("unknown", list(fit.units.values())),
            "active_bound": ("unknown", [int(fit.active_bounds[n]) for n in names]),
            "correlation": (("unknown", "other"), self.correlation),
        }
        coords: dict[str, Any] = {"unknown": names, "other": names}
        if self.profile is not None:
            found = self.profile
            rows = {
                "lower": found.lower, "upper": found.upper, "verdict": found.verdict,
                "end": found.ends, "profile_value": found.values, "profile_rise": found.rises,
            }  # fmt: skip
            for key, values in rows.items():
                shape = np.shape(values[found.names[0]])
                every = [np.asarray(values.get(n, np.full(shape, np.nan)), float) for n in names]
                data[key] = (("unknown", "side", "point")[: len(shape) + 1], every)
            coords["side"] = ["lower", "upper"]
        if self.whiteness:
            tests = self.whiteness.values()
            data["ljung_box"] = ("series", [float(w.test.statistic) for w in tests])
            data["p_value"] = ("series", [float(w.test.p_value) for w in tests])
            data["autocorrelation"] = (("series", "lag"), [np.asarray(w.own.values) for w in tests])
            data["band"] = (("series", "lag"), [np.asarray(w.own.band) for w in tests])
            coords["series"] = list(self.whiteness)
        if self.held_out:
            data["held_out"] = ("record", list(self.held_out.values()))
            coords["record"] = list(self.held_out)
        attributes = {
            "title": self.title,
            "reduced_chi_squared": float(fit.reduced_chi_squared),
            "statements": "\n".join(self.statements()),
        }
        return xr.Dataset(data, coords, attributes)

    def plot(self) -> Figure:
        """Profiles, residuals with their correlations, correlation of the estimates, on one figure."""
        return draw_report(self)

    def to_html(self, path: Path) -> None:
        """One file that holds all of it, pictures too, and loads nothing from elsewhere.

        **Raises** `TypeError` for a `path` that is not a path, `OSError` where it cannot be written.
        """
        if not isinstance(path, str | os.PathLike) or not os.fspath(path):
            raise refusal("path", path, "the path of a file", TypeError)
        page(self, os.fspath(path))


class WhitenessTest(eqx.Module):
    """How a report tests whether residuals are white.

    **Arguments:** `lags` of the correlations and of the Ljung-Box test; `inputs` by name, of the shapes
    of the residuals, with which these are correlated; `past_data`: whether the model predicted each
    sample from those before it, so that the unknowns take degrees of freedom off the test, see
    `ljung_box`. **Raises** `TypeError`, `ValueError` for anything else.
    """

    lags: int = eqx.field(static=True)
    inputs: dict[str, np.ndarray]
    past_data: bool = eqx.field(static=True)

    @check_arguments(lags=count(1), past_data=flag)
    def __init__(self, lags: int = 20, inputs: NamedRows | None = None, past_data: bool = False):
        self.lags, self.inputs, self.past_data = lags, rows_by_name("inputs", inputs), past_data


@check_arguments(
    fit=one_fit, profile=or_none(instance(Profile, "a Profile or None")), title=text(),
    whiteness=or_none(instance(WhitenessTest, "a WhitenessTest(...) or None")),
    comparison=or_none(instance(Comparison, "a Comparison or None")),
)  # fmt: skip
def report(
    fit: Given[Fit],
    *,
    profile: Given[Profile | None] = None,
    series: NamedRows | None = None,
    whiteness: Given[WhitenessTest | None] = None,
    held_out: NamedRows | None = None,
    comparison: Given[Comparison | None] = None,
    runs: Given[Mapping[str, Solution] | None] = None,
    other_runs: Given[Mapping[str, Solution] | None] = None,
    title: str = "Report of a fit",
) -> Report:
    """A `Report` of a fit, of whatever is given.

    **Arguments**

    - `fit`, one; `profile` of it, for intervals with verdicts.
    - `series`: residuals in the order of time by name of the signal, a row or a row per record, NaN
      where missing; by default the residual of the fit. `whiteness`: how they are tested, by default
      `WhitenessTest()`.
    - `held_out`: errors on data not used in the fit, by name of the record, in a unit of their own.
    - `comparison` with other models.
    - `runs`: the solution of each record at the estimate, whose events and derivative flags are listed;
      `other_runs`, of the same names, at other values, e.g. at the start or the true ones: whether
      they go through the same modes, without which no derivative connects them.

    **Raises** `TypeError`, `ValueError` for anything else. It reads numbers and does not work under
    `jit`.
    """
    if profile is not None and (not is_concrete(profile) or profile.level.ndim != 0):
        raise refusal("profile", profile, "one profile, known: call this outside of jit and vmap")
    if profile is not None and set(profile.others[profile.names[0]]) != set(fit.names):
        raise refusal("profile", profile, f"of the unknowns {', '.join(fit.names)}")
    tests = WhitenessTest() if whiteness is None else whiteness
    lags, past_data = tests.lags, tests.past_data
    if past_data and lags <= len(fit.names):
        raise refusal("lags", lags, f"more than the {len(fit.names)} unknowns")
    given = rows_by_name("series", series)
    if series is None:
        given = {"residual": np.asarray(fit.data_residual)}
    driven = tests.inputs
    results = {}
    for name, row in given.items():
        if row.shape[-1] <= lags + 1:
            if series is None:
                continue  # too short for a test, and not asked for
            raise shape_refusal(f"series[{name!r}]", row, f"of more than lags + 1 = {lags + 1} samples")
        for other, u in driven.items():
            if u.shape != row.shape:
                raise shape_refusal(
                    f"inputs[{other!r}]", u, f"of shape {row.shape}, as series[{name!r}]"
                )
        unknowns = len(fit.names) if past_data else 0
        both = {other: cross_correlation(row, u, lags) for other, u in driven.items()}
        test = ljung_box(row, lags, unknowns=unknowns)
        results[name] = Whiteness(row, autocorrelation(row, lags), test, both)
    scores = {
        name: float(np.sqrt(np.nanmean(row**2)))
        for name, row in rows_by_name("held_out", held_out).items()
    }
    modes = _modes(_runs("runs", runs), _runs("other_runs", other_runs))
    return Report(fit, profile, results, scores, comparison, modes, unseen(fit), title)


def _runs(name: str, given: Any) -> Mapping[str, Solution]:
    runs = check_mapping(name, given, "solutions by name of the record")
    for key, run in runs.items():
        check_type(f"{name}[{key!r}]", run, Solution, "a Solution")
        if not is_concrete(run.flags) or run.flags.ndim != 0:
            raise refusal(f"{name}[{key!r}]", run, "one solution, known")
    return runs


def _modes(runs: Mapping[str, Solution], others: Mapping[str, Solution]) -> list[str]:
    if set(others) - set(runs):
        raise refusal("other_runs", others, f"named as runs: {', '.join(runs)}", but="by other names")
    said = []
    for name, run in runs.items():
        text = f"Run {name}: {int(run.num_events)} events"
        if not bool(run.successful):
            text += ", it did NOT reach its end"
        if bool(run.differentiable):
            text += "; nothing was found at which derivatives do not exist"
        else:
            text += f"; NO derivative where {flags_text(run)}"
        if name in others:
            same = bool(same_mode_sequence(run, others[name]))
            text += (
                "; the other run goes through the same modes" if same
                else "; the other run goes through OTHER modes: no derivative connects the two"
            )  # fmt: skip
        said.append(text + ".")
    return said


def _largest(found: Correlation) -> str:
    ratio = np.abs(np.asarray(found.values)) / np.asarray(found.band)
    at = int(np.argmax(ratio))
    return f"{float(found.values[at]):+.3f} at lag {int(found.lags[at])}"
