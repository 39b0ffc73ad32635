"""A motion as a moving picture of the mechanism."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import PyTree
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .._types import Given
from .._validation import check_count, one_concrete, refusal
from ..hybrid import AbstractHybridSystem, Solution
from ..hybrid.components import second_of
from ..mechanism import AbstractMechanism
from ._block import Block
from ._motion import motion
from ._movie import Movie
from ._observed import Source, several
from ._pendulum import Pendulum
from ._scene import AbstractPart, Reading, Scene
from ._sticks import mechanism_of

PARTS = "a sequence of Block, Spring, Damper, Belt, Wall and Pendulum, or None"


def animate(
    solution: Given[Solution | xr.Dataset],
    system: Given[AbstractHybridSystem | None] = None,
    draw: Given[Sequence[AbstractPart] | None] = None,
    *,
    observables: Given[str | Sequence[str] | None] = None,
    lane: Given[int | Sequence[int] | None] = None,
    args: PyTree = None,
    speed: Given[float] = 1.0,
    per_second: int = 20,
) -> Movie:
    """One motion as a moving picture of its mechanism, with what sticks in blue.

    >>> import jax.numpy as jnp
    >>> import stickslip as ss
    >>> from stickslip.plot import Belt, Block, Spring, Wall, animate
    >>> from stickslip.systems import CoulombOscillator, Motion
    >>> block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    >>> times = ss.SaveAt(ts=jnp.linspace(0.0, 10.0, 201))
    >>> run = ss.simulate(block, 0.0, 10.0, Motion(x=0.0, v=0.2), saveat=times)
    >>> animate(run, block, [Wall(-1.0), Spring(-1.0, "x"), Block("x"), Belt(0.2)], speed=2.0)
    Movie: 101 frames in 5.05 s

    **Arguments**

    - `solution`: of `simulate` with `SaveAt(ts=...)` or `SaveAt(steps=True)`, and its `system`; or a
      Dataset over `time`. Between its rows places are linear.
    - `draw`: the parts, `Block`, `Spring`, `Damper`, `Belt`, `Wall`, `Pendulum`, which say where they
      are by numbers, names of observables and functions `f(t, y)` of time and state (`y.x`). By
      default a block for each coordinate in metres and a pendulum for each in radians, one beneath
      the other.
    - `observables`: drawn over time beneath the mechanism, as `motion` draws them.
    - `lane`: of a batch of runs the number of the one that is drawn, as for `motion`.
    - `args`: what `simulate` was given.
    - `speed`: seconds of the motion in a second of the film, 1 for real time. `per_second`: frames.

    **Returns** a `Movie`: `movie.save("run.gif")` or `"run.html"` writes it, and a notebook shows it.

    **Raises** `ValueError`, `TypeError` naming the argument; where no coordinate is in metres or in
    radians and `draw` is not given; for a `speed` at which there are fewer than two frames or more
    than 3000.
    """
    source = Source(solution, system, args, one=True, lane=lane)
    functions, single = ({}, False) if observables is None else several(source, observables)
    scene = Scene(source, _frames(source, speed, per_second))
    readings = _readings(scene, draw)
    panels = len(functions)
    points = np.concatenate([np.zeros((0, 2)), *(reading.points for reading in readings)])
    if not np.isfinite(points).any(axis=0).all():
        raise refusal("draw", draw, "parts that are somewhere: no frame has a finite place")
    size, corners = _view(points)
    tall = np.clip(6.6 * np.ptp(corners[:, 1]) / np.ptp(corners[:, 0]), 1.4, 5.0)
    figure = Figure(figsize=(7.0, 0.8 + tall + 1.7 * panels), layout="constrained")
    axis, *below = figure.subplots(1 + panels, height_ratios=[tall, *[1.5] * panels], squeeze=False)[
        :, 0
    ]
    axis.set(xlim=corners[:, 0], ylim=corners[:, 1], aspect="equal", yticks=[])
    axis.spines[["left", "top", "right"]].set_visible(False)
    unit = second_of(system)
    if unit == "s":
        axis.set_xlabel("[m]")
    updates = [reading.draw(axis, size) for reading in readings]
    if panels:
        row = below[0] if single else below
        motion(solution, system, observables, lane=lane, args=args, ax=row)
        for panel in below:
            panel.set_xlim(source.time[0], source.time[-1])
            updates.append(_cursor(panel, scene.times))
    updates.append(_title(axis, scene, "" if unit == "1" else f" {unit}"))

    def update(i: int) -> None:
        for one in updates:
            one(i)

    return Movie(figure, update, scene.times.size, per_second)


def _frames(source: Source, speed: Any, per_second: Any) -> np.ndarray:
    """Times of the frames."""
    one_concrete("speed", speed, "positive")
    check_count("per_second", per_second, 1)
    begin, end = source.time[0], source.time[-1]
    if not end > begin:
        but = f"with {source.time.size} row{'s' * (source.time.size != 1)}, from {begin:g} to {end:g}"
        raise refusal("solution", source.solution, "kept at two times or more", but=but)
    step = float(speed) / per_second
    if not 1.0 <= (end - begin) / step <= Movie.most - 1:
        least, most = (per_second * (end - begin) / n for n in (Movie.most - 1, 1))
        allowed = f"from {least:.3g} to {most:.3g} for the motion from {begin:g} to {end:g}"
        raise refusal("speed", speed, f"{allowed}, 2 to {Movie.most} frames")
    return begin + step * np.arange(int((end - begin) / step * (1.0 + 1e-12)) + 1)


def _readings(scene: Scene, draw: Any) -> list[Reading]:
    """All parts with numbers."""
    if draw is None:
        draw = _usual(scene)
    if not isinstance(draw, list | tuple) or not draw:
        raise refusal("draw", draw, PARTS, TypeError)
    found = []
    for i, part in enumerate(draw):
        if not isinstance(part, AbstractPart):
            raise refusal(f"draw[{i}]", part, PARTS.removesuffix(", or None"), TypeError)
        scene.part = f"draw[{i}]"
        found.append(part.read(scene))
    return found


def _usual(scene: Scene) -> list[AbstractPart]:
    """A block for each coordinate in metres and a pendulum for each in radians."""
    source = scene.source
    inner = None if source.system is None else mechanism_of(source.system)
    own = inner.names.coordinates if isinstance(inner, AbstractMechanism) else None
    names = [name for name in source.names if own is None or source.parts[name][0] in own]
    rows = {name: source.row(name, source.function("draw", name)) for name in names}
    far = max((np.ptp(row.values) for row in rows.values() if row.unit == "m"), default=0.0) or 1.0
    found: list[AbstractPart] = []
    level = 0.0
    for name, row in rows.items():
        contact = _contact_along(inner, name, scene.held)
        if row.unit == "m":
            found.append(Block(name, level, contact=contact))
            level -= 0.6 * far
        elif row.unit == "rad":
            found.append(Pendulum(name, (0.0, level), 0.5 * far, contact))
            level -= 1.2 * far
    if not found:
        allowed = f"{PARTS.removesuffix(', or None')}: no coordinate is in metres or in radians"
        raise refusal("draw", None, allowed)
    return found


def _contact_along(inner: Any, name: str, held: Mapping[str, Any]) -> str | None:
    """The contact that slides as this coordinate alone moves, where there is one."""
    directions = getattr(inner, "contact_directions", None)
    rows = directions.items() if isinstance(directions, Mapping) else ()
    along = [c for c, row in rows if c in held and isinstance(row, Mapping) and set(row) == {name}]
    return along[0] if along else None


def _view(points: np.ndarray) -> tuple[float, np.ndarray]:
    """The usual size of a part, and the corners of what is to be seen."""
    low, high = (
        np.nan_to_num(end(points, axis=0, initial=start, where=np.isfinite(points)))
        for end, start in ((np.min, np.inf), (np.max, -np.inf))
    )
    size = 0.2 * float(np.max(high - low)) or 1.0
    return size, np.stack([low - size, high + size])


def _cursor(axis: Axes, times: np.ndarray) -> Callable[[int], Any]:
    line = axis.axvline(times[0], color="k", lw=0.8)
    return lambda i: line.set_xdata([times[i], times[i]])


def _title(axis: Axes, scene: Scene, unit: str) -> Callable[[int], Any]:
    """The time, and the contacts that stick."""
    digits = max(0, -math.floor(math.log10(scene.times[1] - scene.times[0])))
    rows = {name or "stick": scene.sticks(name) for name in scene.held}
    title = axis.set_title("", fontsize=10)

    def update(i: int) -> None:
        words = [name for name, row in rows.items() if row[i]]
        told = f", sticks: {', '.join(words)}" if words != ["stick"] else ", sticks"
        title.set_text(f"t = {scene.times[i]:.{digits}f}{unit}{told if words else ''}")

    return update
