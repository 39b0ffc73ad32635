"""The picture of the page `one_attempt.md`: the ten verbs of an attempt, and guards over one step."""

from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

# Verb, object, file below `stickslip/hybrid`.
VERBS = (
    ("step", "stages, end, slope at the end, error", "_step.py"),
    ("measure", "the error by the size of the motion", "_tolerance.py"),
    ("evaluate", "guards and sections at the end", "_step.py"),
    ("look", "at two points inside the step", "_doubt.py"),
    ("rank", "the guard that comes first", "_event_decision.py"),
    ("decide", "one code for the attempt", "_event_decision.py"),
    ("jump", "correct the time, ask the transition", "_attempt.py"),
    ("move", "time, state, slope and mode", "_attempt.py"),
    ("aim", "length of the next attempt", "_locate.py, _control.py"),
    ("account", "counters, flags, result code", "_accounts.py"),
)
INSIDE = (0.3819660112501051, 0.7236067977499789)  # of the step; `_doubt.py` says why these
PLAIN, SHORT, EVENT = "#3a6ea5", "#b5522b", "#2f7d4f"
HEIGHT, TOP = 0.72, 10.0


def attempt_figure() -> Figure:
    """Left the verbs from top to bottom and the ways back, right three guards over one step."""
    figure = plt.figure(figsize=(7.1, 5.9))
    grid = figure.add_gridspec(3, 2, width_ratios=(2.5, 1.0))
    _flow(figure.add_subplot(grid[:, 0]))
    _guard(
        figure.add_subplot(grid[0, 1]), "SHRINK: below zero at the end", SHORT,
        lambda s: 0.6 - 0.9 * s - 0.25 * s**2, 0.578,
    )  # fmt: skip
    _guard(
        figure.add_subplot(grid[1, 1]), "DIP: seen below zero inside", SHORT,
        lambda s: 3.4 * (s - 0.33) * (s - 0.55), INSIDE[0],
    )  # fmt: skip
    _guard(
        figure.add_subplot(grid[2, 1]), "REJECT: not its cubic, near zero", SHORT,
        lambda s: 0.55 + 0.3 * np.cos(9.0 * s), None,
    )  # fmt: skip
    return figure


def _flow(ax: Any) -> None:
    ax.set_axis_off()
    ax.set_xlim(-0.25, 10.4)
    ax.set_ylim(-0.35, 10.55)
    ax.text(0.0, 10.35, "lane: t, y, slope, mode, values, bracket, h, ...", fontsize=8, va="center")
    for number, (verb, rest, file) in enumerate(VERBS, start=1):
        y = TOP - number + 0.25
        colour = EVENT if verb == "jump" else PLAIN
        box = (0.0, y - HEIGHT / 2)
        ax.add_patch(
            FancyBboxPatch(
                box,
                7.6,
                HEIGHT,
                boxstyle="round,pad=0,rounding_size=0.12",
                fc="white",
                ec=colour,
                lw=1.1,
            )
        )
        ax.text(0.2, y, f"{number}", fontsize=8, va="center", color="0.45")
        ax.text(0.75, y + 0.14, verb, fontsize=8.5, va="center", weight="bold", color=colour)
        ax.text(2.6, y + 0.14, rest, fontsize=7.6, va="center")
        ax.text(2.6, y - 0.19, file, fontsize=6.2, va="center", family="monospace", color="0.45")
        _arrow(ax, (1.2, y + 1 - HEIGHT / 2), (1.2, y + HEIGHT / 2), "0.4")
    decide, aim = (TOP - number + 0.25 for number in (6, 9))
    move, first, last = TOP - 8 + 0.25, TOP - 1 + 0.25, TOP - 10 + 0.25
    _arrow(ax, (7.6, decide + 0.12), (7.6, aim + 0.12), SHORT, bend=-0.38)
    ax.text(
        8.45, decide - 0.3, "state kept,\ntried again:\nSHRINK\nDIP\nREJECT", fontsize=7, color=SHORT,
        va="center",
    )  # fmt: skip
    _arrow(ax, (7.6, decide - 0.14), (7.6, move + 0.14), PLAIN, bend=-0.34)
    ax.text(
        8.45, move - 0.15, "accepted:\nPLAIN\nREFRESH\nSECTION", fontsize=7, color=PLAIN, va="center"
    )
    ax.text(
        8.45,
        last + 0.25,
        "with a jump:\nEVENT\nCOLLAPSED\nVIOLATED",
        fontsize=7,
        color=EVENT,
        va="center",
    )
    # Round to the next attempt.
    ax.plot([0.0, -0.2, -0.2, 0.0], [last, last, first, first], color="0.4", lw=1.0)
    _arrow(ax, (-0.05, first), (0.0, first), "0.4")


def _arrow(ax: Any, begin: tuple, end: tuple, colour: str, bend: float = 0.0) -> None:
    ax.add_patch(
        FancyArrowPatch(
            begin, end, arrowstyle="-|>", mutation_scale=7, lw=1.0, color=colour, shrinkA=0, shrinkB=0,
            connectionstyle=f"arc3,rad={bend}",
        )
    )  # fmt: skip


def _guard(ax: Any, title: str, colour: str, guard: Callable, place: float | None) -> None:
    """A guard over a step, the cubic through its ends and slopes, the looks inside, the next length."""
    s = np.linspace(0.0, 1.0, 401)
    ax.axhline(0.0, color="0.6", lw=0.7)
    ax.plot(s, guard(s), color="0.15", lw=1.2)
    ax.plot(s, cubic(guard, s), color=PLAIN, lw=0.9, ls="--")
    looks = np.array(INSIDE)
    ax.plot(looks, guard(looks), "o", ms=3.2, color="0.15")
    ax.plot([0.0, 1.0], guard(np.array([0.0, 1.0])), "s", ms=3.2, color="0.15")
    if place is not None:
        ax.annotate("next end", (place, 0.0), (place, -0.28), fontsize=6.5, color=colour, ha="center",
                    arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 0.9})  # fmt: skip
    ax.set_title(title, fontsize=7.5, loc="left", color=colour)
    ax.set_ylim(-0.6, 1.15)
    ax.set_yticks([0.0])
    ax.set_xticks([0.0, 1.0], ["t", "t + h"])
    ax.tick_params(labelsize=7)


def cubic(guard: Callable, s: np.ndarray) -> np.ndarray:
    """The cubic through the values and slopes at both ends; $s$ from 0 to 1."""
    d = 1e-6
    v0, v1 = guard(0.0), guard(1.0)
    r0, r1 = (guard(d) - guard(-d)) / (2 * d), (guard(1.0 + d) - guard(1.0 - d)) / (2 * d)
    blend = s * s * (3.0 - 2.0 * s)
    return v0 + (v1 - v0) * blend + r0 * s * (1 - s) ** 2 - r1 * s * s * (1 - s)
