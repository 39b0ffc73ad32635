"""How objects show themselves: names with numbers and units, in text and in notebooks."""

import dataclasses
import html
import inspect
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer

WIDTH = 104  # characters of a line
FEW = 6  # numbers that are listed one by one
LISTED = 9  # names of modes, names of components, or rows of a log that are listed


def number(value: Any) -> str:
    """A real number in at most six digits."""
    return f"{float(value):.6g}"


def amount(count: int, one: str, many: str | None = None) -> str:
    """`1 run`, `10,000 runs`."""
    return f"{count:,} {one if count == 1 else many or one + 's'}"


def _is_abstract(value: Any) -> bool:
    return isinstance(value, Tracer | jax.ShapeDtypeStruct)


def value_text(value: Any, unit: str | None = None) -> str:
    """A value with its unit: a number, a few of them, or how many from where to where.

    A traced value, which has no numbers, is shown by its type and shape.
    """
    after = f" {unit}" if unit not in (None, "", "1") else ""
    if _is_abstract(value):
        return eqx.tree_pformat(value)
    if isinstance(value, bool | np.bool_ | str | None):
        return repr(value)
    if isinstance(value, int | float | np.number):
        return (repr(value) if isinstance(value, int) else number(value)) + after
    if isinstance(value, np.ndarray | jax.Array):
        return _array_text(value) + after
    if isinstance(value, eqx.Module):
        return repr(value) if type(value).__repr__ is not eqx.Module.__repr__ else module_text(value)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        names: Any = getattr(value, "_fields", ())
        parts = (f"{name}={value_text(part)}" for name, part in zip(names, value, strict=True))
        return f"{type(value).__name__}({', '.join(parts)})"
    if isinstance(value, tuple | list) and len(value) <= FEW:
        inside = ", ".join(value_text(part) for part in value)
        only = "," if isinstance(value, tuple) and len(value) == 1 else ""
        return (f"({inside}{only})" if isinstance(value, tuple) else f"[{inside}]") + after
    if isinstance(value, type) or inspect.isroutine(value):
        return getattr(value, "__qualname__", repr(value))
    return " ".join(repr(value).split())


def _array_text(value: Any) -> str:
    try:
        array = np.asarray(value)
    except TypeError:  # keys of random numbers
        return eqx.tree_pformat(value)
    if array.dtype.kind not in "iufb":
        return eqx.tree_pformat(value)
    if array.ndim == 0:
        return number(array) if array.dtype.kind == "f" else str(array.item())
    if array.ndim == 1 and array.size <= FEW:
        return f"[{', '.join(number(x) for x in array)}]"
    shape = f"{array.shape[0]:,}" if array.ndim == 1 else " x ".join(f"{n:,}" for n in array.shape)
    finite = array[np.isfinite(array)]
    span = f" from {number(finite.min())} to {number(finite.max())}" if finite.size else ""
    return f"{shape} numbers{span}"


def parameters_of(module: Any) -> dict[str, Any]:
    """Parameters of a module: its fields, and what else its constructor took and it still knows."""
    fields = [field.name for field in dataclasses.fields(module)]
    given = [p.name for p in inspect.signature(type(module)).parameters.values()]
    names = dict.fromkeys(name for name in (*fields, *given) if not name.startswith("_"))
    found = {}
    for name in names:
        try:
            found[name] = getattr(module, name)
        except Exception:  # not set yet, or a property that does not apply
            continue
    return {k: v for k, v in found.items() if not inspect.ismethod(v)}


def units_of(module: Any) -> Mapping[str, str]:
    """Units of its parameters, as its class states them."""
    units = getattr(module, "parameter_units", {})
    return units if isinstance(units, Mapping) else {}


def module_text(module: Any) -> str:
    """A module by its parameters with their units: what `repr` of systems and laws gives."""
    units = units_of(module)
    parts = [f"{k}={value_text(v, units.get(k))}" for k, v in parameters_of(module).items()]
    name = type(module).__name__
    line = f"{name}({', '.join(parts)})"
    if len(line) <= WIDTH and "\n" not in line:
        return line
    return f"{name}(\n{_filled_lines(parts)})"


def _filled_lines(parts: Sequence[str]) -> str:
    """Parts in as few lines as hold them, indented; one that has several lines keeps them."""
    lines, row = [], ""
    for part in parts:
        if row and ("\n" in part or len(row) + len(part) + 2 > WIDTH - 4):
            lines.append(row)
            row = ""
        if "\n" in part:
            lines += f"{part},".split("\n")
        else:
            row = f"{row} {part},".strip()
    return "".join(f"    {line}\n" for line in (*lines, row) if line)


def parameters_html(module: Any) -> str:
    """The same as a table for notebooks."""
    units = units_of(module)
    rows = []
    for key, value in parameters_of(module).items():
        unit = units.get(key)
        plain = isinstance(value, int | float | np.ndarray | jax.Array) and not isinstance(value, bool)
        rows.append((key, value_text(value), unit if unit and plain else ""))
    return html_table(type(module).__name__, ("parameter", "value", "unit"), rows)


class AbstractShown(eqx.Module):
    """A module that shows itself by its parameters, with numbers and units.

    A subclass may state `parameter_units`, units by the names of its parameters. Under a
    transformation, where there are no numbers, types and shapes are shown in their place.

    >>> from typing import Any, ClassVar
    >>> class Spring(AbstractShown):
    ...     stiffness: Any
    ...     length: Any = 0.1
    ...     parameter_units: ClassVar = {"stiffness": "N/m", "length": "m"}
    >>> Spring(20.0)
    Spring(stiffness=20 N/m, length=0.1 m)
    """

    parameter_units: ClassVar[Mapping[str, str]] = {}

    def __repr__(self) -> str:
        return module_text(self)

    def _repr_html_(self) -> str:
        return parameters_html(self)


def columns_aligned(table: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table of texts, its columns one under the other."""
    widths = [max(len(row[i]) for row in table) for i in range(len(table[0]))]
    return [
        "  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in table
    ]


def html_table(title: str, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table of texts, escaped."""

    def line(cells: Sequence[Any], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(c))}</{tag}>" for c in cells) + "</tr>"

    body = "".join(line(row, "td") for row in rows)
    caption = f"<caption>{html.escape(title)}</caption>" if title else ""
    top = f"<thead>{line(head, 'th')}</thead>" if head else ""
    return f"<table>{caption}{top}<tbody>{body}</tbody></table>"
