"""A file of G-code by one command: what it says of a print, and what it refuses."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest

from experiments._experiment import Context, chosen
from experiments.corexy._printer import read_printer
from experiments.corexy.print_gcode import EXPERIMENT, animate, draw, read_file, table

L = "G0 X20 Y20 F12000\nG1 X40 E1 F6000\nG1 Y40 E2\nG0 X38 Y38\nG1 X22 E3\n"


def run(tmp_path, *changes, text=L, **printer):
    path, machine = tmp_path / "a.gcode", tmp_path / "printer.json"
    path.write_text(text, encoding="utf-8")
    machine.write_text(json.dumps(printer), encoding="utf-8")
    changes = [f"file={path}", f"machine={machine}", "rate=1000", "frames=3", *changes]
    return EXPERIMENT.compute(chosen(EXPERIMENT, False, changes), Context(tmp_path))


@pytest.mark.more
def test_a_print_and_what_is_said_of_it(tmp_path, capsys):
    data = run(tmp_path, mu_s=0.0, mu_k=0.0)
    assert data.attrs["report"].startswith("5 lines, 0.09 m")
    assert "loses no step" in data.attrs["report"]
    assert data.attrs["report"] in capsys.readouterr().out
    # Without friction it comes to rest where the file ends, 22 mm and 38 mm from a corner of the bed.
    np.testing.assert_allclose(data.place[-1] + 0.125, [0.022, 0.038], atol=2e-7)
    x, y = (data.place.values + 0.125).T
    along = data.drawn.values & (y < 0.0205) & (x > 0.021) & (x < 0.039)
    np.testing.assert_allclose(data.off.values[along], np.abs(y - 0.02)[along], atol=1e-12)
    assert not data.drawn.values[(x < 0.019) & (y < 0.019)].any()
    assert 1e-6 < np.max(data.off.values[data.drawn.values]) < 1e-3
    # Power is what the motors do: their torque at a constant speed is that of their damping.
    even = np.flatnonzero(
        np.ptp(np.stack([data.motor_speed[i : i - 20] for i in range(20)]), axis=0).max(1) < 0.05
    )
    torque = float(json.loads((tmp_path / "printer.json").read_text()).get("torque", 0.4 / np.sqrt(2)))
    assert even.size
    held = torque * np.sin(data.load_angle.values[even]) - 1e-3 * data.motor_speed.values[even]
    assert np.max(np.abs(held)) < 0.02 * torque
    plt.close(draw(data))
    film = animate(data)
    film.still()
    plt.close("all")
    assert list(table(data)) == ["time", "x", "y", "off"]


@pytest.mark.more
def test_a_weak_motor_loses_steps(tmp_path):
    data = run(tmp_path, "acceleration=20", torque=0.02)
    assert "LOSES STEPS" in data.attrs["report"]
    lost = 4.0 * np.round(data.load_angle.values[-1] / (2.0 * np.pi))
    assert np.max(np.abs(lost)) >= 4.0
    assert f"{abs(lost[0]):.0f} off at the end" in data.attrs["report"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["file=nowhere.gcode"], "file=nowhere.gcode"),
        (["shaper=XY"], "shaper=XY.*MZV"),
        (["acceleration=0"], "acceleration=0"),
        (["frequency_x=-1"], "frequency_x=-1"),
        (["machine=nowhere.json"], "machine=nowhere.json"),
    ],
)
def test_wrong_settings_are_named(changes, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        EXPERIMENT.compute(chosen(EXPERIMENT, True, changes), Context(tmp_path))


def test_files_that_cannot_be(tmp_path):
    with pytest.raises(ValueError, match="row 2 leaves the frame"):
        run(tmp_path, text="G1 X20\nG1 X500\n")
    for printer, words in (
        ({"mass": 1.0}, "machine=.*among"),
        ({"EA_1": -1.0}, "machine=.*EA_1 = -1"),
        ({"torque": "a"}, "machine=.*torque"),
    ):
        (tmp_path / "odd.json").write_text(json.dumps(printer), encoding="utf-8")
        with pytest.raises(ValueError, match=words):
            read_printer(str(tmp_path / "odd.json"))
    assert read_file("").speeds.size == 75
