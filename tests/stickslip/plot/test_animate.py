"""Animations: parts are where the motion is, coloured by what sticks; files have all frames."""

import math
from typing import ClassVar

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from PIL import Image

import stickslip as ss
from stickslip import plot
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.plot import SLIP, STICK, Belt, Block, Damper, Movie, Pendulum, Spring, Wall, coil
from stickslip.systems import CoulombOscillator, JointedBeam, Motion

BELT = 0.2
BLOCK = CoulombOscillator(1.0, 1.0, 1.0, 0.5, BELT)
# Stuck from 0 to 5 s, where the spring gives 1 N, then it slips: by closed form until 8.90260541 s.
SLIPS = (5.0, 5.0 + 2.0 * (math.pi - math.atan(2.5)))


@pytest.fixture(scope="module")
def run():
    saveat = ss.SaveAt(ts=np.linspace(0.0, 10.0, 201))
    return ss.simulate(BLOCK, 0.0, 10.0, Motion(x=0.0, v=BELT), saveat=saveat)


def exact(t):
    """Place of the block: it rides on the belt, then swings about 0.5 m with the kinetic 0.5 N."""
    s = t - SLIPS[0]
    slips = 0.5 + 0.5 * np.cos(s) + BELT * np.sin(s)
    return np.where(t < SLIPS[0], BELT * t, np.where(t < SLIPS[1], slips, BELT * (t - SLIPS[1])))


def test_parts_follow_the_motion(run):
    parts = [
        Wall(-1.0), Spring((-1.0, 0.1), ("x", 0.1)), Damper(-1.0, lambda t, y: y.x - 0.2),
        Block("x", width=0.4), Belt(BELT),
    ]  # fmt: skip
    movie = plot.animate(run, BLOCK, parts, speed=2.0, per_second=20)
    assert (movie.frames, movie.per_second) == (101, 20)
    (axis,) = movie.figure.axes
    (body,) = axis.patches
    _, _, spring, damper, _, marks = axis.lines
    first = None
    for frame in (0, 20, 49, 51, 70, 88, 91):
        t = 0.1 * frame  # two seconds of the motion in one of the film
        movie.update(frame)
        x = float(exact(t))
        assert body.get_x() + 0.2 == pytest.approx(x, abs=1e-8)
        assert spring.get_xdata()[[0, -1]] == pytest.approx([-1.0, x], abs=1e-8)
        assert damper.get_xdata()[-1] == pytest.approx(x - 0.2, abs=1e-8)
        sticks = not SLIPS[0] < t < SLIPS[1]
        assert body.get_facecolor() == pytest.approx(to_rgba((SLIP, STICK)[sticks]))
        title = axis.get_title()
        assert title == f"t = {t:.1f} s" + (", sticks: belt" if sticks else "")
        places = np.sort(marks.get_xdata()[::3])
        first = places if first is None else first
        gap = np.diff(first)[0]
        assert np.mod(places[0] - first[0] - BELT * t + 0.5 * gap, gap) == pytest.approx(0.5 * gap)


def test_curves_beneath_with_a_line_at_the_time(run):
    movie = plot.animate(run, BLOCK, [Block("x")], observables=["v"])
    _, below = movie.figure.axes
    assert below.get_ylabel() == "v [m/s]"
    movie.update(30)
    assert below.lines[-1].get_xdata() == [1.5, 1.5]


class Two(AbstractMechanism):
    """A cart and a pendulum that know nothing of each other."""

    coordinates: ClassVar = {"x": "m", "angle": "rad"}
    contact_directions: ClassVar = {"rail": {"x": 1}, "joint": {"angle": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0, "angle": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 0.0, "angle": -q.angle}

    def contacts(self, t, q, v, args):
        return {"rail": Contact(Coulomb(0.1, 0.1), 1.0), "joint": Contact(Coulomb(0.3, 0.3), 1.0)}


@pytest.mark.more
def test_without_a_drawing_each_coordinate_has_a_part():
    two = Two()
    start = two.state(x=0.0, v_x=0.2, angle=0.25)
    found = ss.simulate(two, 0.0, 4.0, start, saveat=ss.SaveAt(ts=np.linspace(0.0, 4.0, 161)))
    movie = plot.animate(found, two)
    (axis,) = movie.figure.axes
    (body,) = axis.patches
    bob, joint = axis.lines[1:3]
    # The cart stops after 2 s, 0.2 m on; the joint holds the pendulum where it is.
    for frame, sticks, place in ((20, False, 0.2 - 0.05), (60, True, 0.2)):
        movie.update(frame)
        assert body.get_x() + 0.5 * body.get_width() == pytest.approx(place, abs=2e-3)
        colours = body.get_facecolor(), to_rgba((SLIP, STICK)[sticks])
        assert colours[0] == colours[1]
        assert joint.get_color() == STICK
        ways = bob.get_xdata()[0] - joint.get_xdata()[0], bob.get_ydata()[0] - joint.get_ydata()[0]
        assert math.atan2(ways[0], -ways[1]) == pytest.approx(0.25)


def test_of_a_dataset(run):
    time = np.linspace(0.0, 2.0, 41)
    data = xr.Dataset({"s": ("time", time**2, {"units": "m"})}, {"time": time})
    for draw in (None, [Block("s")]):
        movie = plot.animate(data, draw=draw)
        movie.update(30)
        (body,) = movie.figure.axes[0].patches
        assert body.get_x() + 0.5 * body.get_width() == pytest.approx(2.25)
    with pytest.raises(ValueError, match=r"draw\[0\].x = <function.*<lambda>.*Dataset has no states"):
        plot.animate(data, draw=[Block(lambda t, y: y.s)])
    with pytest.raises(ValueError, match=r"solution = .*with 1 row, from 0 to 0: .* two times or more"):
        plot.animate(data.isel(time=[0]), draw=[Block("s")])
    with pytest.raises(ValueError, match=r"draw = \[Block.*no frame has a finite place"):
        plot.animate(data.assign(s=data.s * np.nan), draw=[Block("s")])


@pytest.mark.more
def test_wrong_drawings_are_named(run):
    for draw, said in (
        ([Block("q")], r"draw\[0\].x = 'q': it must be a component of the state \(x, v\)"),
        ([Block("x"), Spring(0.0, ("x", "up"))], r"draw\[1\].end = 'up'"),
        ([Block("x", contact="floor")], r"draw\[0\].contact = 'floor'.* that may stick: 'belt'"),
        ([Block(lambda t, y: (y.x, y.v))], r"draw\[0\].x = .*it must be a single number"),
    ):
        with pytest.raises(ValueError, match=said):
            plot.animate(run, BLOCK, draw)
    with pytest.raises(ValueError, match=r"speed = 0.01: it must be from 0.0667 to 200"):
        plot.animate(run, BLOCK, speed=0.01)
    plot.animate(run, BLOCK, speed=0.0668)
    beam = JointedBeam.constructed(5e-4)
    still = ss.simulate(beam, 0.0, 1.0, beam.start(), saveat=ss.SaveAt(ts=np.linspace(0.0, 1.0, 21)))
    with pytest.raises(ValueError, match=r"draw = None.* no coordinate is in metres or in radians"):
        plot.animate(still, beam)


@pytest.fixture
def movie():
    figure = Figure(figsize=(1.0, 1.0))
    (dot,) = figure.add_subplot().plot([0.0, 1.0], [0.0, 1.0], "o")
    return Movie(figure, lambda i: dot.set_data([0.2 * i], [0.5]), 4, 10)


def test_files(movie, tmp_path):
    path = movie.save(tmp_path / "dot.gif")
    with Image.open(path) as picture:
        assert (picture.format, picture.n_frames, picture.info["duration"]) == ("GIF", 4, 100)
        assert picture.size == (80, 80)
    page = movie.save(tmp_path / "dot.html").read_text(encoding="utf-8")
    for text in (page, movie._repr_html_()):
        assert text.count("data:image/png;base64") == 4
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dot.gif", "dot.html"]
    with pytest.raises(ValueError, match=r"it must be the path of a file that ends with .gif or .html"):
        movie.save(tmp_path / "dot.mp4")


def test_a_still_is_the_middle_or_any_frame(movie):
    (line,) = movie.figure.axes[0].lines
    for frame, place in ((None, 0.4), (3, 0.6)):
        assert movie.still(frame) is movie.figure
        assert line.get_xdata() == pytest.approx([place])
    with pytest.raises(ValueError, match=r"frame = 4: it must be at most 3"):
        movie.still(4)


def test_a_coil_ends_where_it_should():
    x, y = coil((0.0, 0.0), (0.0, 2.0), 4, 0.2)
    assert (x[0], y[0], x[-1], y[-1]) == (0.0, 0.0, 0.0, 2.0)
    assert np.ptp(x) == pytest.approx(0.2)


def test_a_pendulum_hangs_from_its_pivot(run):
    movie = plot.animate(run, BLOCK, [Pendulum(lambda t, y: 0.5 * t, pivot=("x", 1.0), length=2.0)])
    _, bob, joint = movie.figure.axes[0].lines
    movie.update(40)
    assert (*joint.get_xdata(), *joint.get_ydata()) == pytest.approx((0.4, 1.0))
    assert (*bob.get_xdata(), *bob.get_ydata()) == pytest.approx(
        (0.4 + 2 * math.sin(1), 1 - 2 * math.cos(1))
    )
