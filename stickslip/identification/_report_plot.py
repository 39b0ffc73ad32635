"""The pictures of a report."""

import statistics
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from .._drawing import BLUE, GREY, RED, Picture, residual_dots


def draw_report(report: Any, across: int = 4) -> Figure:
    """Profiles first, then residual, autocorrelation and inputs of each series, then correlations."""
    profiled = report.profile.names if report.profile else ()
    panels: list[tuple[str, Any]] = [("profile", name) for name in profiled]
    for name, found in report.whiteness.items():
        panels += [("series", name), ("own", name)]
        panels += [("input", (name, other)) for other in found.with_input]
    panels.append(("correlation", None))
    rows = -(-len(panels) // across)
    columns = min(across, len(panels))
    figure = Picture(figsize=(3.1 * columns, 2.6 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    draw = {
        "profile": _profile, "series": _series, "own": _autocorrelation, "input": _input,
        "correlation": _correlation,
    }  # fmt: skip
    for axis, (kind, which) in zip(axes, panels, strict=False):
        draw[kind](figure, axis, report, which)
        axis.title.set_size(9)
        axis.tick_params(labelsize=7)
        axis.xaxis.label.set_size(8)
        axis.yaxis.label.set_size(8)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    return figure


def _profile(figure: Any, axis: Any, report: Any, name: str) -> None:
    found = report.profile
    values, rises = np.asarray(found.values[name]).ravel(), np.asarray(found.rises[name]).ravel()
    keep = np.isfinite(values) & np.isfinite(rises)
    order = np.argsort(values[keep])
    axis.plot(values[keep][order], rises[keep][order], "o-", ms=2.5, lw=1.0, color=BLUE)
    half = (found.wald_upper[name] - found.wald_lower[name]) / 2.0
    # The level is where the straight interval ends.
    level = _quantile(float(found.level))
    if np.isfinite(float(half)):
        middle = float(found.estimate[name])
        x = middle + float(half) * np.linspace(-1.2, 1.2, 61)
        axis.plot(x, level * np.linspace(-1.2, 1.2, 61) ** 2, "--", lw=0.8, color=GREY)
    axis.axhline(level, lw=0.7, color=RED)
    axis.set_ylim(-0.05 * level, 1.6 * level)
    axis.locator_params(axis="x", nbins=4)
    axis.set_title(f"{name}: {found.verdicts[name]}")
    unit = report.fit.units[name]
    axis.set_xlabel(f"{name} [{unit}]" if unit else name)
    axis.set_ylabel("rise of the sum of squares")


def _quantile(level: float) -> float:
    """Of chi squared with one degree of freedom: the square of that of the normal distribution."""
    return statistics.NormalDist().inv_cdf(0.5 + 0.5 * level) ** 2


def _series(figure: Any, axis: Any, report: Any, name: str) -> None:
    series = np.atleast_2d(report.whiteness[name].series)
    for row in series:
        residual_dots(axis, np.arange(row.size), row)
    axis.set(title=f"residuals: {name}", xlabel="sample", ylabel="residual")


def _stems(axis: Any, found: Any) -> None:
    lags, values, band = (np.asarray(a) for a in (found.lags, found.values, found.band))
    axis.vlines(lags, 0.0, values, lw=1.2, color=BLUE)
    known = np.isfinite(band)
    axis.fill_between(lags[known], -band[known], band[known], color="0.85", lw=0, zorder=0)
    axis.axhline(0.0, lw=0.6, color=GREY)
    axis.set_xlabel("lag [samples]")


def _autocorrelation(figure: Any, axis: Any, report: Any, name: str) -> None:
    found = report.whiteness[name]
    _stems(axis, found.own)
    axis.set_title(f"autocorrelation, p = {float(found.test.p_value):.2g}")


def _input(figure: Any, axis: Any, report: Any, which: tuple[str, str]) -> None:
    name, other = which
    _stems(axis, report.whiteness[name].with_input[other])
    axis.set_title(f"{name} with input {other}")


def _correlation(figure: Any, axis: Any, report: Any, which: None) -> None:
    names = report.fit.names
    picture = axis.imshow(report.correlation, cmap="RdBu", vmin=-1.0, vmax=1.0)
    axis.set_xticks(range(len(names)), names, rotation=90)
    axis.set_yticks(range(len(names)), names)
    axis.set_title("correlation of the estimates")
    figure.colorbar(picture, ax=axis, shrink=0.8)
