"""Points of a section over a parameter."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from .._show import amount
from .._types import Given
from .._validation import check_type, refusal
from ..hybrid.components import entries, split
from . import _axes


def orbit_diagram(
    dataset: Given[xr.Dataset],
    observable: Given[str | None] = None,
    *,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """An orbit diagram: every point of every lane over its parameter.

    Unless a `color` is given, points of lanes whose status is not "ok" are red, and a legend says why,
    with the numbers of lanes, of those without a point too. Lanes that came to rest are green: the
    points on their way, and a ring where a component of the state rests.

    **Arguments**

    - `dataset`: of `stickslip.analysis.orbit_diagram`, over one parameter; of two, select one value of
      one of them before.
    - `observable`: name of a variable over the parameter, with or without `point`, such as `"x"` or
      `"period"`, `"x[0]"` for one number of an array; the first one that has points by default.
    - `ax`, `options`: axes to draw into; properties of the dots, as matplotlib calls them. By default
      dots are the smaller the more there are.

    **Returns** the axes.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("dataset", dataset, xr.Dataset, "a Dataset of analysis.orbit_diagram")
    known = [str(name) for name, v in dataset.data_vars.items() if "point" in v.dims]
    if observable is None:
        if not known:
            raise refusal(
                "dataset", "a Dataset", "of analysis.orbit_diagram: with a variable of points"
            )
        observable = known[0]
    base, index = split(observable) if isinstance(observable, str) else ("", None)
    if isinstance(observable, str) and observable in dataset.data_vars:
        base, index = observable, None
    if base not in dataset.data_vars:
        names = ", ".join(map(str, dataset.data_vars))
        raise refusal("observable", observable, f"a variable of the dataset, one of {names}")
    found = _one_number(dataset[base], observable, index)
    parameters = [str(dim) for dim in found.dims if dim != "point"]
    if len(parameters) != 1 or parameters[0] not in dataset.coords:
        over = f"of points over {', '.join(parameters) or 'no parameter'}"
        allowed = "over one parameter: select a value of each other one, dataset.sel(k=..., method=...)"
        raise refusal("dataset", "a Dataset", allowed, but=over)
    (parameter,) = parameters
    axis, options = _axes.begin(ax, options)
    across = dataset[parameter]
    values = np.asarray(found.transpose(parameter, ...), float).reshape(across.size, -1)
    places = np.broadcast_to(np.asarray(across)[:, None], values.shape)
    shown = np.isfinite(values)
    dots = _dots(int(shown.sum()))
    rests, others, why = _not_ok(dataset, parameter)
    if "color" in options or not why:
        rests, others, why = rests & False, others & False, {}
    ok = shown & ~(rests | others)[:, None]
    axis.plot(places[ok], values[ok], **{**dots, **options})
    for lanes, color in ((others, _axes.RED), (rests, _axes.GREEN)):
        if lanes.any():
            these, look = shown & lanes[:, None], {**dots, "color": color, **options}
            axis.plot(places[these], values[these], **look, label=why[color])
    if rests.any() and (place := _place_of_rest(dataset, base, observable, index)) is not None:
        ring = {**dots, "marker": "o", "markerfacecolor": "none", "markeredgewidth": 0.8}
        ring |= {"color": _axes.GREEN, "markersize": 3.0, "zorder": 3}
        axis.plot(np.asarray(across)[rests], place[rests], **ring)
    if why:
        axis.legend(fontsize="small", markerscale=max(1.0, 4.0 / dots["markersize"]))
    axis.set_xlabel(_label(across, parameter))
    entry = observable.removeprefix(base)
    axis.set_ylabel(_label(found, base, entry))
    return axis


def _not_ok(dataset: xr.Dataset, parameter: str) -> tuple[np.ndarray, np.ndarray, dict[str, str]]:
    """Lanes at rest, others whose status is not "ok", and words by colour, with numbers of lanes."""
    status = dataset.get("status")
    if status is None or status.dims != (parameter,):
        none = np.zeros(dataset.sizes[parameter], bool)
        return none, none, {}
    numbers, words = np.asarray(status), status.attrs["flag_meanings"].split()
    rests = numbers == (words.index("at_rest") if "at_rest" in words else -1)
    said = {}
    for color, lanes in ((_axes.RED, (numbers != 0) & ~rests), (_axes.GREEN, rests)):
        counts = (
            f"{word.replace('_', ' ')}: {amount(count, 'lane')}"
            for number, word in enumerate(words)
            if (count := int(np.sum(lanes & (numbers == number))))
        )
        said |= {color: text} if (text := ", ".join(counts)) else {}
    return rests, (numbers != 0) & ~rests, said


def _place_of_rest(dataset: xr.Dataset, base: str, observable: str, index: Any) -> Any:
    """Where each lane ends, of a component of the state; None of other observables."""
    for prefix in ("end", "carry"):
        ended = dataset.get(f"{prefix}_{base}")
        if ended is not None:
            return np.asarray(_one_number(ended, observable, index), float).reshape(-1)
    return None


def _one_number(found: xr.DataArray, observable: str, index: tuple[int, ...] | None) -> xr.DataArray:
    """The number of an array at `index`; its axes are those after `point`."""
    own = found.dims[found.dims.index("point") + 1 :] if "point" in found.dims else ()
    own = tuple(dim for dim in own if dim not in found.coords)
    names = entries(str(found.name), tuple(found.sizes[dim] for dim in own))
    if index is None and not own:
        return found
    if index not in names.values():
        raise refusal("observable", observable, f"a single number, one of {', '.join(names)}")
    return found.isel(dict(zip(own, index or (), strict=True)))


def _dots(count: int) -> dict[str, Any]:
    """Below half a pixel a dot would fade; very many are drawn fainter instead."""
    return {
        "color": _axes.BLUE, "marker": ".", "linestyle": "none", "markeredgewidth": 0,
        "markersize": float(np.clip(3.0e4 / max(count, 1), 0.4, 4.0)),
        "alpha": 0.6 if count > 2e5 else 0.8, "rasterized": True,
    }  # fmt: skip


def _label(variable: xr.DataArray, name: str, entry: str = "") -> str:
    text = str(variable.attrs.get("long_name", name)) + entry
    return _axes.axis_label(text, variable.attrs.get("units"))
