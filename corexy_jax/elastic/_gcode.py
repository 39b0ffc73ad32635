"""G-code in: the lines and arcs of a file in the plane, with their speeds."""

import os
import pathlib
import re
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from stickslip.checks import Given, Numeric, check_known, check_type, one_number, refusal

# No exponents: `X1E2` is a place and a length of filament.
WORD = re.compile(r"([A-Za-z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")
MOTIONS = ("G0", "G1", "G2", "G3")
# What says nothing about the way of the head in the plane, or moves it where the file does not say.
SILENT = ("G4", "G17", "G28", "G29", "G80", "G94")


class Moves(NamedTuple):
    """Lines in the plane, as `trajectory(moves.points, moves.speeds, ...)` takes them.

    - `points` [m]: `[point, 2]`; `speeds` [m/s] of each line; `rows`: number of the row of the file
      that each line comes from, counted from 1.
    - `drawn`: whether filament is pushed out along each line; in a file without filament, whether it is
      none of `G0`.
    - `ignored`: how often each other command was there, such as those of heaters.
    """

    points: np.ndarray
    speeds: np.ndarray
    rows: np.ndarray
    drawn: np.ndarray
    ignored: dict[str, int]


def read_gcode(
    source: Given[str | os.PathLike],
    *,
    chord: Numeric = 1e-5,
    speed: Numeric = 0.05,
) -> Moves:
    r"""Moves of the head from G-code, in SI units.

    Read are `G0`, `G1` (lines), `G2`, `G3` (arcs, by `I`, `J` or `R`), `G20`, `G21` (inches,
    millimetres), `G90`, `G91` (absolute, relative), `G92` (the place is called so), `M82`, `M83`
    (filament absolute, relative), `F` (a minute's way); a row without a command repeats the last
    motion. Lines without a way in the plane, of `Z` or `E` alone, take no time here, and a `G28` (home)
    is not followed. Comments begin with `;` or stand in parentheses.

    **Arguments**

    - `source`: a path, or the text itself, which has a line break.
    - `chord` [m], positive: how far lines may be from the arc that they stand for.
    - `speed` [m/s]: that of moves before the first `F`, positive.

    **Returns** `Moves`. **Raises** `TypeError`, `ValueError` naming the row that cannot be read, or
    where nothing moves, or for a path that is none of a file.
    """
    check_type("source", source, str | os.PathLike, "a path, or G-code as a text")
    chord = float(check_known("chord", one_number("chord", chord, "positive")))
    speed = float(check_known("speed", one_number("speed", speed, "positive")))
    text = str(source)
    if not isinstance(source, str) or "\n" not in source:
        path = pathlib.Path(source)
        if not path.is_file():
            raise refusal("source", source, "the path of a file, or G-code, which has a line break")
        text = path.read_text(encoding="utf-8")
    ignored: Counter[str] = Counter()
    unit, relative, place, called = 1e-3, False, np.zeros(2), np.zeros(2)
    points, speeds, rows, drawn = [place], [], [], []
    motion, feeds, filament, fed = "G1", "M82", 0.0, False
    for row, commands, given in _rows(text):
        for name in commands:
            command = name or motion
            if command in ("G20", "G21"):
                unit = 0.0254 if command == "G20" else 1e-3
            elif command in ("G90", "G91"):
                relative = command == "G91"
            elif command == "G92":
                # Where the head is keeps its place in the machine, and gets other coordinates.
                now = place - called
                now = [given[a] * unit if a in given else c for a, c in zip("XY", now, strict=True)]
                called = place - np.array(now)
                filament = given.get("E", filament)
            elif command in MOTIONS:
                motion = command
                if "F" in given:
                    speed = given["F"] * unit / 60.0
                    if speed <= 0.0:
                        raise refusal(f"F in row {row}", given["F"], "positive")
                base = place if relative else called
                end = np.array([
                    base[i] + given[a] * unit if a in given else place[i] for i, a in enumerate("XY")
                ])  # fmt: skip
                way = [end]
                if command in ("G2", "G3"):
                    way = _arc(place, end, given, unit, command == "G3", chord, row)
                rise = 0.0
                if "E" in given:
                    rise = given["E"] - (0.0 if relative or feeds == "M83" else filament)
                    filament, fed = filament + rise, True
                for point in way:
                    if np.any(point != place):
                        points.append(point)
                        speeds.append(speed)
                        rows.append(row)
                        drawn.append((rise > 0.0, command != "G0"))
                        place = point
            elif command in SILENT or command[0] != "G":
                ignored[command] += 1
                feeds = command if command in ("M82", "M83") else feeds
            else:
                allowed = "a command of the list in the docstring of read_gcode"
                raise refusal(f"row {row}", command, allowed)
    if not speeds:
        raise refusal("source", str(source)[:60], "G-code in which something moves in the plane")
    pushed = np.array(drawn)[:, 0 if fed else 1]
    return Moves(np.array(points), np.array(speeds), np.array(rows), pushed, dict(ignored))


def _rows(text: str) -> Iterator[tuple[int, list[str], dict[str, float]]]:
    """Rows with something in them: their number, their commands, and the numbers by their letters."""
    for row, line in enumerate(text.splitlines(), start=1):
        code = re.sub(r"\([^)]*\)", " ", line).split(";")[0].split("*")[0].strip().upper()
        code = re.sub(r"^N\s*\d+", "", code).strip()
        if not code or code.startswith("%"):
            continue
        named = re.match(r"[A-Z_]{2,}|[MT]\s*\d+", code)
        if named is not None:  # macros, heaters, texts to show: whatever follows is theirs
            yield row, [named[0].replace(" ", "")], {}
            continue
        words = WORD.findall(code)
        commands = [f"{letter}{float(number):g}" for letter, number in words if letter in "GMT"]
        others = [(letter, float(number)) for letter, number in words if letter not in "GMT"]
        given = dict(others)
        takes = [c for c in commands if c in (*MOTIONS, "G4", "G28", "G92")]
        if not words or WORD.sub("", code).strip() or len(given) < len(others) or len(takes) > 1:
            raise refusal(f"row {row}", line, "words of a letter and a number, for one motion")
        # A row with numbers only, or behind a switch such as `G90`, repeats the last motion.
        yield row, commands if takes or not given else [*commands, ""], given


def _arc(
    start: np.ndarray, end: np.ndarray, given: dict, unit: float, left: bool, chord: float, row: int
) -> list[np.ndarray]:
    """Points of an arc, counter-clockwise if `left`, near enough that lines stay within `chord`."""
    if "R" in given:
        radius, span = given["R"] * unit, end - start
        half = 0.5 * np.hypot(*span)
        if half == 0.0 or half > abs(radius) * (1.0 + 1e-9):
            raise refusal(f"R in row {row}", given["R"], "at least half of the way, which is not 0")
        rise = np.sqrt(max(radius**2 - half**2, 0.0)) * (1.0 if left == (radius > 0.0) else -1.0)
        centre = start + 0.5 * span + rise * np.array([-span[1], span[0]]) / (2.0 * half)
    else:
        centre = start + unit * np.array([given.get("I", 0.0), given.get("J", 0.0)])
    radius = np.hypot(*(start - centre))
    if radius == 0.0:
        raise refusal(f"row {row}", given, "an arc with I, J or R that is not 0")
    first, last = (np.arctan2(*(p - centre)[::-1]) for p in (start, end))
    if abs(np.hypot(*(end - centre)) - radius) > max(1e-3 * radius, chord):
        raise refusal(f"row {row}", given, "an arc that ends as far from its centre as it begins")
    turn = (last - first) % (2.0 * np.pi) if left else -((first - last) % (2.0 * np.pi))
    if np.all(end == start):  # a whole circle
        turn = 2.0 * np.pi if left else -2.0 * np.pi
    # A chord is `radius (1 - cos(step / 2))` from its arc.
    step = 2.0 * np.arccos(max(1.0 - chord / radius, 0.0))
    count = max(int(np.ceil(abs(turn) / step)), 1)
    angles = first + turn * np.arange(1, count) / count
    inside = [centre + radius * np.array([np.cos(a), np.sin(a)]) for a in angles]
    return [*inside, end]
