"""Lyapunov exponents, as they converge or over a parameter."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_known, refusal
from ..analysis import LyapunovSpectrum
from . import _axes


def exponents(
    found: Given[LyapunovSpectrum | xr.Dataset],
    *,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """Lyapunov exponents with their errors: over the time of the average, or over a parameter.

    **Arguments**

    - `found`: a `LyapunovSpectrum`: each exponent as it converges, with a band for the error of its
      last value; or a Dataset of `lyapunov_diagram` over one parameter: each with error bars.
    - `ax`, `options`: axes to draw into; properties of the lines, as matplotlib calls them.

    **Returns** the axes, with a line an exponent. Exponents that are not finite have no line: a
    direction that is lost, or a lane that failed.

    **Raises** `ValueError`, `TypeError` naming the argument; for a batch of spectra.
    """
    if isinstance(found, xr.Dataset):
        return _over_parameter(found, ax, options)
    if not isinstance(found, LyapunovSpectrum):
        allowed = "a LyapunovSpectrum, or a Dataset of lyapunov_diagram"
        raise refusal("found", found, allowed, TypeError)
    check_known("found", found)
    if found.exponents.ndim != 1:
        take = "one spectrum of the batch: jax.tree.map(lambda a: a[0], found)"
        raise refusal("found", found, take, but=f"of shape {found.exponents.shape[:-1]}")
    axis, options = _axes.begin(ax, options, linewidth=1.0)
    time, running = np.asarray(found.time), np.asarray(found.running)
    values, errors = np.asarray(found.exponents), np.asarray(found.error)
    settled = []
    for i in np.flatnonzero(np.isfinite(values)):
        (line,) = axis.plot(time, running[:, i], **options)
        axis.axhspan(
            values[i] - errors[i], values[i] + errors[i], color=line.get_color(), alpha=0.2, lw=0
        )
        settled.append(running[time.size // 40 :, i])
    axis.axhline(0.0, color=_axes.GREY, linewidth=0.6, zorder=0)
    if settled:
        # The first values are those of a few segments, far from where they go.
        low, high = min(0.0, np.nanmin(settled)), max(0.0, np.nanmax(settled))
        room = 0.1 * (high - low) or 1.0
        axis.set_ylim(low - room, high + room)
    axis.set_xlabel("time of the average [s]")
    axis.set_ylabel("exponent [1/s]")
    return axis


def _over_parameter(dataset: xr.Dataset, ax: Any, options: dict[str, Any]) -> Axes:
    if not {"exponents", "error"} <= set(map(str, dataset.data_vars)):
        allowed = "of lyapunov_diagram: with the variables exponents and error"
        raise refusal("found", "a Dataset", allowed)
    parameters = [str(dim) for dim in dataset["exponents"].dims if dim != "exponent"]
    if len(parameters) != 1 or parameters[0] not in dataset.coords:
        over = f"over {', '.join(parameters) or 'no parameter'}"
        raise refusal("found", "a Dataset", "over one parameter: select values of the others", but=over)
    (parameter,) = parameters
    axis, options = _axes.begin(
        ax, options, marker=".", markersize=2.0, linewidth=0.4, linestyle="none"
    )
    across = dataset[parameter]
    values = np.asarray(dataset["exponents"].transpose(parameter, "exponent"))
    errors = np.asarray(dataset["error"].transpose(parameter, "exponent"))
    finite = np.isfinite(values)
    for i in range(values.shape[1]):
        row, width = (np.where(finite, a, np.nan)[:, i] for a in (values, errors))
        axis.errorbar(np.asarray(across), row, width, elinewidth=options["linewidth"], **options)
    axis.axhline(0.0, color=_axes.GREY, linewidth=0.6, zorder=0)
    axis.set_xlabel(
        _axes.axis_label(str(across.attrs.get("long_name", parameter)), across.attrs.get("units"))
    )
    axis.set_ylabel(_axes.axis_label("exponent", dataset["exponents"].attrs.get("units")))
    return axis
