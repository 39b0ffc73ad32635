"""G-code: units, relative and absolute places, arcs, what is not read."""

import numpy as np
import pytest

from corexy_jax.elastic import read_gcode, trajectory

TEXT = """
; a square and an arc
M104 S200 (heater)
G21
G90
G0 X10 Y10 F6000
G1 X30 E1.2 F3000
N5 G1 Y30*71
X10
G91
G1 Y-20 F1200
G1 Z0.2
G90
G92 X0 Y0
G1 X5
G2 X15 Y0 I5 J0
"""


def test_lines_and_their_speeds():
    moves = read_gcode(TEXT, chord=1e-6)
    np.testing.assert_allclose(
        moves.points[:7] * 1e3,
        [[0, 0], [10, 10], [30, 10], [30, 30], [10, 30], [10, 10], [15, 10]], atol=1e-12,
    )  # fmt: skip
    np.testing.assert_allclose(moves.speeds[:6], [0.1, 0.05, 0.05, 0.05, 0.02, 0.02])
    assert moves.rows[:6].tolist() == [6, 7, 8, 9, 11, 15]
    assert moves.ignored == {"M104": 1}
    # Half a circle about (20, 10) mm, clockwise: above its centre.
    arc = moves.points[6:] * 1e3 - np.array([20.0, 10.0])
    np.testing.assert_allclose(np.hypot(*arc.T), 5.0, rtol=1e-12)
    assert np.all(arc[1:-1, 1] > 0.0)
    np.testing.assert_allclose(arc[-1], [5.0, 0.0], atol=1e-12)
    chords = np.hypot(*(0.5 * (arc[1:] + arc[:-1])).T)
    assert 4e-4 < np.max(5.0 - chords) <= 1.0001e-3
    whole = trajectory(moves.points, moves.speeds, acceleration=3.0, corner_speed=0.005)
    assert float(whole.duration) > 0.02 / 0.02


@pytest.mark.parametrize(("code", "side"), [("G2", -1.0), ("G3", 1.0)])
def test_arcs_by_radius_and_by_centre_agree(code, side):
    by_radius = read_gcode(f"G1 X10 Y0\n{code} X0 Y10 R10\n")
    centre = "I-10 J0" if code == "G3" else "I0 J10"
    by_centre = read_gcode(f"G1 X10 Y0\n{code} X0 Y10 {centre}\n")
    np.testing.assert_allclose(by_radius.points, by_centre.points, atol=1e-15)
    middle = by_radius.points[len(by_radius.points) // 2 + 1] * 1e3
    assert side * (np.sum(middle) - 10.0) > 0.0
    long = read_gcode(f"G1 X10 Y0\n{code} X0 Y10 R-10\n")
    assert len(long.points) > 2.5 * len(by_radius.points)
    circle = read_gcode(f"G1 X10 Y0\n{code} I-10 J0\n").points[1:] * 1e3
    turned = np.sum(circle[:-1, 0] * circle[1:, 1] - circle[1:, 0] * circle[:-1, 1]) / 2.0
    assert turned == pytest.approx(side * np.pi * 100.0, rel=2e-3)


def test_inches_macros_and_files(tmp_path):
    path = tmp_path / "part.gcode"
    path.write_text("START_PRINT BED=60\nG20\nG1 X1 F60\nM84\n")
    moves = read_gcode(path)
    np.testing.assert_allclose(moves.points, [[0.0, 0.0], [0.0254, 0.0]])
    np.testing.assert_allclose(moves.speeds, [0.0254])
    assert moves.ignored == {"START_PRINT": 1, "M84": 1}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G1 X1\nG5 X2 Y3\n", r"row 2 = 'G5'"), ("G1 X1\n?? !!\n", r"row 2 = '\?\? !!'"),
        ("G1 X1 F0\n", r"F in row 1 = 0.0"), ("M84\n\n", r"source = .* moves in the plane"),
        ("G1 X10,5\n", r"row 1 = 'G1 X10,5'"), ("G1 X1\nG41 X3\n", r"row 2 = 'G41'"),
        ("G1 X1 X2\n", r"row 1 = .*one motion"), ("G1 X1\nG2 X3 I5 J1\n", r"row 2 = .*as far from"),
        ("G92 X1 G1 X3\n", r"row 1 = .*one motion"), ("G1 X\n", r"row 1 = 'G1 X'"),
        ("G1 X1\nG2 X3 R0.5\n", r"R in row 2 = 0.5"), ("G1 X1\nG2 X3\n", r"row 2 = .*an arc with"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_named(text, words):
    with pytest.raises(ValueError, match=words):
        read_gcode(text)


def test_compact_rows_and_those_that_repeat():
    """An extruder's word is no exponent; several commands in a row; an arc goes on as one."""
    moves = read_gcode(
        "G21 G90 G17 G1X10E2F600\nM117 Layer 1/10, X5\nG90 Y.5\nG2 X11. Y1.5 I1 J0\nX12 Y.5 I0 J-1\n"
    )
    np.testing.assert_allclose(moves.points[:3] * 1e3, [[0, 0], [10, 0], [10, 0.5]], atol=1e-15)
    np.testing.assert_allclose(moves.speeds, 0.01)
    arc = moves.points[3:] * 1e3 - np.array([11.0, 0.5])
    np.testing.assert_allclose(np.hypot(*arc.T), 1.0, rtol=1e-9)
    np.testing.assert_allclose(arc[-1], [1.0, 0.0], atol=1e-12)
    assert moves.ignored == {"G17": 1, "M117": 1}


def test_lines_with_filament_are_drawn():
    """Absolute and relative, set anew, taken back, with a wipe; without filament all but `G0`."""
    moves = read_gcode(
        "G1 X1 E1\nG1 X2\nG1 X3 E0.5\nG92 E0\nG1 X4 E0.2\nG1 E-1\nG1 X5 E-0.5\n"
        "M83\nG1 X6 E0.1\nG1 X7 E-0.1\nM82\nG91\nG1 X1 E0.1\nG90\nG1 X9 E0.05\nG0 X10 E1\n"
    )
    drawn = [True, False, False, True, True, True, False, True, True, True]
    assert moves.drawn.tolist() == drawn
    assert read_gcode("G1 X1\nG0 X2\nG3 X2 Y2 I0 J1\n").drawn[:3].tolist() == [True, False, True]
