"""The machine from above: where its two belts run."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from stickslip.plot import SLIP

DARK, PALE = "0.25", "0.8"
BELTS = ("#1f4e9c", "#3d7a4b")
RIM = 0.03  # radius of the drawn pulleys, of the width of the frame


def paths(x: float, y: float, wide: float, high: float, gap: float) -> list[np.ndarray]:
    """Corners of the two belts, each from the collar around its motor and the far side back to it.

    Strands of a belt are a `gap` apart, and round the motor is half a circle of this diameter.
    """
    half = np.linspace(0.0, np.pi, 25)
    round_1 = np.stack([0.5 * gap * (np.cos(half) - 1.0), -0.5 * gap * np.sin(half)], axis=1)
    round_2 = np.stack([wide + 0.5 * gap * (1.0 - np.cos(half)), -0.5 * gap * np.sin(half)], axis=1)
    one = [
        (x, y), (0.0, y), *round_1, (-gap, high + gap), (wide, high + gap), (wide, y + 2 * gap),
        (x, y + 2 * gap),
    ]  # fmt: skip
    two = [
        (x, y - gap), (wide, y - gap), *round_2, (wide + gap, high), (0.0, high), (0.0, y + gap),
        (x, y + gap),
    ]  # fmt: skip
    return [np.array(one), np.array(two)]


def along_path(corners: Any, lengths: Any) -> tuple[np.ndarray, np.ndarray]:
    """Points at such lengths from the beginning of a path through corners."""
    corners = np.asarray(corners, float)
    sides = np.hypot(*np.diff(corners, axis=0).T)
    reached = np.concatenate([[0.0], np.cumsum(sides)])
    return np.interp(lengths, reached, corners[:, 0]), np.interp(lengths, reached, corners[:, 1])


class Machine:
    """The machine on axes, in a frame `wide` and `high` [m]; `move` brings it to a place."""

    def __init__(self, axis: Axes, wide: float, high: float):
        self.wide, self.high = wide, high
        edge = 0.14 * wide
        axis.set(xlim=(-edge, wide + edge), ylim=(-edge, high + edge), aspect="equal")
        axis.axis("off")
        (self.beam,) = axis.plot([], [], color=PALE, lw=9, zorder=1)
        self.belts = [axis.plot([], [], color=c, lw=1.4, zorder=3)[0] for c in BELTS]
        self.marks = [axis.plot([], [], "o", color=c, ms=3, zorder=4)[0] for c in BELTS]
        self.rim = RIM * wide
        self.gap = 2.0 * self.rim
        self.centres = np.array([(-self.rim, 0.0), (wide + self.rim, 0.0)])
        self.rims = [Circle(c, self.rim, fc="w", ec=DARK, lw=1.5, zorder=5) for c in self.centres]
        for patch in self.rims:
            axis.add_patch(patch)
        self.spokes = [axis.plot([], [], color=DARK, lw=2, zorder=6)[0] for _ in self.centres]
        for i, (centre, word) in enumerate(zip(self.centres, ("motor 1", "motor 2"), strict=True)):
            at = (0.0, -22.0)
            axis.annotate(word, centre, at, textcoords="offset points", ha="center", color=BELTS[i])
        self.side = 0.10 * wide
        self.collar = Rectangle((0.0, 0.0), self.side, 4.4 * self.gap, color=DARK, zorder=5)
        axis.add_patch(self.collar)

    def move(self, x: float, y: float, turned: Any, slips: Any) -> None:
        """The collar at `x`, `y` [m] in the frame, the rims of the motors `turned` by so much [m], and
        whether each belt `slips`."""
        self.beam.set_data([0.0, self.wide], [y + 0.5 * self.gap] * 2)
        self.collar.set_xy((x - 0.5 * self.side, y - 1.7 * self.gap))
        corners = paths(x, y, self.wide, self.high, self.gap)
        length = float(np.hypot(*np.diff(corners[0], axis=0).T).sum())
        for k, row in enumerate(corners):
            self.belts[k].set_data(*row.T)
            # The belt is held at the collar: each mark keeps its length from there.
            self.marks[k].set_data(*along_path(row, np.linspace(0.0, length, 40, endpoint=False)))
            self.marks[k].set_color(SLIP if slips[k] else BELTS[k])
            self.rims[k].set_edgecolor(SLIP if slips[k] else DARK)
            # The rim of the drawn pulley moves as far as that of the true one.
            tip = self.rim * np.array([np.cos(turned[k] / self.rim), np.sin(turned[k] / self.rim)])
            self.spokes[k].set_data(*np.stack([self.centres[k] - tip, self.centres[k] + tip], axis=1))
