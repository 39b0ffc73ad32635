"""The smooth block's branch by AUTO, as the package xpplab carries it; equations from `slopes`."""

import dataclasses
import math
from typing import Any

import numpy as np

from ._diagram_job import Case, slopes

MESH = 200  # intervals, of four collocation points each


@dataclasses.dataclass(frozen=True)
class Text:
    """A formula in words: what Python computes with it is written down instead."""

    words: str

    def __add__(self, other: Any) -> "Text":
        return Text(f"({self.words}+{_words(other)})")

    def __radd__(self, other: Any) -> "Text":
        return Text(f"({_words(other)}+{self.words})")

    def __sub__(self, other: Any) -> "Text":
        return Text(f"({self.words}-{_words(other)})")

    def __rsub__(self, other: Any) -> "Text":
        return Text(f"({_words(other)}-{self.words})")

    def __mul__(self, other: Any) -> "Text":
        return Text(f"({self.words}*{_words(other)})")

    def __rmul__(self, other: Any) -> "Text":
        return Text(f"({_words(other)}*{self.words})")

    def __truediv__(self, other: Any) -> "Text":
        return Text(f"({self.words}/{_words(other)})")

    def __rtruediv__(self, other: Any) -> "Text":
        return Text(f"({_words(other)}/{self.words})")

    def __pow__(self, power: int) -> "Text":
        return Text("(" + "*".join([self.words] * power) + ")")

    def __neg__(self) -> "Text":
        return Text(f"(-{self.words})")


def _words(value: Any) -> str:
    if isinstance(value, Text):
        return value.words
    return repr(float(value)) if value >= 0 else f"({float(value)!r})"


def _function(name: str):
    return lambda a: Text(f"{name}({a.words})")


def model(case: Case, k3: float) -> str:
    """The equations of motion in the language of XPP."""
    x, y, u, v, stiffness = map(Text, ("x", "y", "u", "v", "k3"))
    a, b = slopes(
        case.values, x, y, u, v, stiffness,
        absolute=_function("abs"), tanh=_function("tanh"), cosh=_function("cosh"),
    )  # fmt: skip
    lines = [
        f"par k3={k3!r}", "x'=u", "y'=v", f"u'={a.words}", f"v'={b.words}",
        "@ meth=stiff,tol=1e-10,atol=1e-12,bound=1e6,maxstor=10000", "done",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def branch(case: Case, start: np.ndarray, period: float, low: float, high: float, step: float):
    """Stiffness and period of each orbit, and of the doublings; AUTO's own steps up to `step`."""
    import xpplab  # pyright: ignore[reportMissingImports]

    block = xpplab.Model.from_text(model(case, low))
    for name, value in zip("xyuv", start, strict=True):
        block.initial_conditions[name] = float(value)
    block.set(total=period, dt=period / 2000)
    block.run()
    block.auto.set(
        ntst=MESH, ncol=4, nmax=math.ceil(4 * (high - low) / step), npr=10_000, ds=0.3 * step,
        dsmin=1e-3 * step, dsmax=step, parmin=low - step, parmax=high, normmax=1e6, itmx=20, itnw=9,
        epsl=1e-9, epsu=1e-9, epss=1e-9,
    )  # fmt: skip
    points = list(block.auto.start("periodic", "k3"))
    # The first point is the start as it was given; AUTO corrects from the second one on.
    found = np.array([(p.value, p.period) for p in points[1:]])
    return found, np.array([(p.value, p.period) for p in points if p.type == "PD"])
