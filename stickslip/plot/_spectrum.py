"""Amplitudes over frequencies."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_known, check_mapping, check_text, check_type, one_concrete
from ..analysis import Spectrum
from . import _axes


def spectrum(
    found: Given[Spectrum],
    *,
    unit: str | None = None,
    bases: Given[Mapping[str, float] | None] = None,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """Amplitudes over frequencies, on a logarithmic axis, without the mean.

    **Arguments**

    - `found`: of `amplitude_spectrum`; of a batch each spectrum is a line.
    - `unit`: of the signal, which is that of the amplitudes; `"1"` if it has no unit; the
      frequencies then have none either.
    - `bases`: frequencies [Hz] by name, each marked by a dotted line.
    - `ax`, `options`: axes to draw into; properties of the lines, as matplotlib calls them.

    **Returns** the axes, which show six decades.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("found", found, Spectrum, "a Spectrum")
    check_known("found", found)
    if unit is not None:
        check_text("unit", unit)
    bases = check_mapping("bases", bases, "a mapping from names to frequencies")
    for name, base in bases.items():
        one_concrete(f"bases[{name!r}]", base, "positive")
    axis, options = _axes.begin(ax, options, color=_axes.BLUE, linewidth=0.8)
    frequency, amplitude = np.asarray(found.frequency), np.asarray(found.amplitude)
    for row in amplitude.reshape(-1, frequency.size):
        axis.semilogy(frequency[1:], row[1:], **options)
    for name, base in bases.items():
        axis.axvline(float(base), color=_axes.GREY, linestyle=":", linewidth=0.8, zorder=0)
        axis.annotate(
            name, (float(base), 1.0), xycoords=("data", "axes fraction"), xytext=(2, -2),
            textcoords="offset points", va="top", fontsize="small",
        )  # fmt: skip
    top = float(amplitude[..., 1:].max()) if amplitude.shape[-1] > 1 else 0.0
    if top > 0.0:
        axis.set_ylim(1e-6 * top, 2.0 * top)  # six decades from the greatest amplitude down
    axis.set_xlabel("frequency" if unit == "1" else "frequency [Hz]")
    axis.set_ylabel(_axes.axis_label("amplitude", unit))
    return axis
