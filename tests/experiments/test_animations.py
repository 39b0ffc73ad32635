"""Animations: what moves is what was computed, belts keep their length."""

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from PIL import Image

from experiments._pictures import shrink_movie
from experiments.block import animate as block
from experiments.corexy._machine import along_path, paths


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def test_a_small_gif_keeps_its_pace_and_a_colour_that_comes_late(tmp_path):
    colours = ["white"] * 8 + ["red"] * 4
    first, *rest = (Image.new("RGB", (40, 20), colour) for colour in colours)
    first.putpixel((3, 3), (0, 0, 255))
    for number, frame in enumerate(rest):
        frame.putpixel((number, 0), (0, 0, 0))  # equal frames would be joined
    first.save(tmp_path / "large.gif", save_all=True, append_images=rest, duration=50, loop=0)
    with Image.open(shrink_movie(tmp_path / "large.gif", tmp_path / "small.gif", 20, 8)) as small:
        assert (small.size, small.n_frames, small.info["duration"]) == ((20, 10), 6, 100)
        small.seek(5)
        red, green, blue = small.convert("RGB").getpixel((15, 8))
    assert red > 200 > 60 > max(green, blue)


def length(corners):
    return np.hypot(*np.diff(corners, axis=0).T).sum()


@pytest.mark.parametrize("belt", [0, 1])
def test_belts_keep_their_length_and_turn_their_motors(belt):
    gap = 0.1
    corners = [paths(x, y, 3.0, 2.0, gap)[belt] for x, y in ((1.0, 0.5), (2.2, 1.4))]
    assert length(corners[0]) == pytest.approx(length(corners[1]), abs=1e-12)
    # From the collar to the motor it grows by x + y, or by y - x: as the virtual pulleys turn.
    grown = length(corners[1][:3]) - length(corners[0][:3])
    assert grown == pytest.approx((1.2, -1.2)[belt] + 0.9, abs=1e-12)


def test_points_along_a_path():
    x, y = along_path([(0.0, 0.0), (2.0, 0.0), (2.0, 3.0)], [0.5, 2.0, 4.0])
    np.testing.assert_allclose([x, y], [[0.5, 2.0, 2.0], [0.0, 0.0, 2.0]])


def test_the_block_goes_where_the_motion_does():
    time = np.linspace(5.0, 6.0, 20, endpoint=False)
    x = 0.03 * np.sin(time)
    stick = np.arange(20) % 3 == 0
    data = xr.Dataset(
        {
            "x": ("time", x), "vx": ("time", 0.03 * np.cos(time)), "y": ("time", 0.0 * x),
            "stick": ("time", stick),
        },
        {"time": time},
        {"r": 0.25, "belt_speed": 0.12, "per_second": 20, "every": 2},
    )  # fmt: skip
    movie = block.animate(data)
    assert movie.frames == 10
    body = movie.figure.axes[0].patches[2]
    for frame in (0, 3, 6):
        movie.update(frame)
        assert body.get_x() + 0.5 * body.get_width() == pytest.approx(x[2 * frame])
        blue = body.get_facecolor()[2] > body.get_facecolor()[0]
        assert blue == stick[2 * frame]
    # Marks of the belt move with it.
    first, later = [], []
    for frame, kept in ((0, first), (1, later)):
        movie.update(frame)
        kept.extend(movie.figure.axes[0].lines[3].get_xdata())
    moved = np.mod(np.array(later) - first, block.RIGHT - block.LEFT)
    np.testing.assert_allclose(moved, 0.12 * 0.1, atol=1e-12)
