"""Records come in: text and MATLAB files, units, marks of the instrument, noise from the data."""

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io

from stickslip.identification import Observed, Problem, Record, noise_level, read_table
from stickslip.systems import CoulombOscillator, Motion

T = np.arange(200) * 5.0  # [ms]
ANGLE = 90.0 * np.sin(0.01 * T)  # [deg]

TEXTS = {
    "comma.csv": ("# a log\nt_ms,phi\n", ",", ".", {}),
    "german.csv": ("t_ms; phi\n", ";", ",", {"decimal": ","}),
    "tabs.tsv": ("t_ms\tphi\n", "\t", ".", {}),
    "tabs.txt": ("t_ms\tphi\n", "\t", ",", {"decimal": ","}),
    "spaces.txt": ("  t_ms   phi\n", "   ", ".", {}),
    "bare.dat": ("", ",", ".", {"columns": ("t_ms", "phi")}),
    "bom.csv": ("\ufefft_ms,phi\n", ",", ".", {}),
}


@pytest.mark.parametrize("name", TEXTS)
def test_text(name, tmp_path):
    head, mark, point, options = TEXTS[name]
    lines = [
        f"{t!r}{mark}{a!r}".replace(".", point) for t, a in zip(T.tolist(), ANGLE.tolist(), strict=True)
    ]
    path = tmp_path / name
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    table = read_table(path, **options)
    assert list(table) == ["t_ms", "phi"]
    np.testing.assert_array_equal(table["t_ms"], T)
    np.testing.assert_array_equal(table["phi"], ANGLE)


def test_matlab(tmp_path):
    """Structures, cells, texts beside numbers, and the format of version 7.3."""
    path = tmp_path / "a.mat"
    cells = np.empty(2, object)
    cells[:] = [T, ANGLE[:3]]
    scipy.io.savemat(path, {"log": {"t": T, "phi": ANGLE}, "runs": cells, "who": "me", "one": 3.0})
    table = read_table(path)
    assert set(table) == {"log.t", "log.phi", "runs[0]", "runs[1]", "one", "who"}
    assert str(table["who"]) == "me"
    np.testing.assert_array_equal(table["log.phi"], ANGLE)
    np.testing.assert_array_equal(table["runs[1]"], ANGLE[:3])
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as data:
        data["log/phi"] = ANGLE[:, None]  # as MATLAB writes a row
    with (tmp_path / "b.mat").open("r+b") as data:
        data.write(b"MATLAB 7.3 MAT-file".ljust(116) + b" " * 8 + b"\x00\x02IM")
    np.testing.assert_array_equal(read_table(tmp_path / "b.mat")["log.phi"], ANGLE)


def test_texts_and_the_rest_of_a_matlab_file(tmp_path):
    path, names = tmp_path / "a.mat", np.empty(2, object)
    names[:] = ["phi", "psi"]
    scipy.io.savemat(path, {"head": {"names": names}, "lines": ["ab", "cd"], "z": [1.0 + 2.0j]})
    table = read_table(path)
    assert table["head.names"].tolist() == ["phi", "psi"] == list(table["head.names"])
    assert table["lines"].tolist() == ["ab", "cd"]
    assert table["z"] == 1.0 + 2.0j


def test_texts_and_the_rest_of_a_file_of_version_7_3(tmp_path):
    """As MATLAB writes it: texts are numbers of letters, cells references, and an object is neither."""
    path = tmp_path / "b.mat"

    def letters(text):
        return np.array([[ord(x)] for x in text], np.uint16)

    with h5py.File(path, "w", userblock_size=512) as data:
        data["who"] = letters("me")
        data["who"].attrs["MATLAB_class"] = np.bytes_("char")
        data["#refs#/a"], data["#refs#/b"] = letters("phi"), letters("psi")
        for name in "ab":
            data[f"#refs#/{name}"].attrs["MATLAB_class"] = np.bytes_("char")
        data["#refs#/c"] = ANGLE[:, None]
        for name, those in (("names", "ab"), ("runs", "ca")):
            cells = np.array([[data[f"#refs#/{x}"].ref] for x in those], h5py.ref_dtype)
            data.create_dataset(name, data=cells, dtype=h5py.ref_dtype)
            data[name].attrs["MATLAB_class"] = np.bytes_("cell")
        data["nothing"] = np.array([0, 0], np.uint64)
        data["nothing"].attrs["MATLAB_empty"] = 1
        data["title"] = np.array([[0xDD000000, 2, 1, 1, 1, 1]], np.uint32)
        data["title"].attrs["MATLAB_object_decode"] = 3
        data["title"].attrs["MATLAB_class"] = np.bytes_("string")
    with path.open("r+b") as data:
        data.write(b"MATLAB 7.3 MAT-file".ljust(116) + b" " * 8 + b"\x00\x02IM")
    with pytest.warns(
        UserWarning, match=r"b\.mat: left out title, which are neither numbers nor texts"
    ):
        table = read_table(path)
    assert list(table) == ["names", "nothing", "runs[0]", "runs[1]", "who"]
    assert (str(table["who"]), str(table["runs[1]"])) == ("me", "phi")
    assert table["names"].tolist() == ["phi", "psi"]
    assert table["nothing"].size == 0
    np.testing.assert_array_equal(table["runs[0]"], ANGLE)


def test_refused(tmp_path):
    (tmp_path / "no_head.csv").write_text("1,2\n3,4\n")
    with pytest.raises(ValueError, match=r"begins with '1,2'.*whose first line names its columns"):
        read_table(tmp_path / "no_head.csv")
    (tmp_path / "empty.csv").write_text("a,b\n")
    with pytest.raises(ValueError, match="a table with rows"):
        read_table(tmp_path / "empty.csv")
    (tmp_path / "none.csv").write_text("")
    with pytest.raises(ValueError, match="path"):
        read_table(tmp_path / "none.csv")
    (tmp_path / "x.mat").write_bytes(b"nothing of the kind" * 20)
    with pytest.raises(ValueError, match="a MATLAB file"):
        read_table(tmp_path / "x.mat")
    (tmp_path / "logger.txt").write_text("made by\nno. 3; of 4\nt;x\n0,0;1,5\n4,0;2,5\n")
    np.testing.assert_array_equal(
        read_table(tmp_path / "logger.txt", decimal=",", skip=2)["x"], [1.5, 2.5]
    )
    with pytest.raises(
        ValueError, match=r"decimal = '\.', and t holds '0,0': it must be ',' for this file"
    ):
        read_table(tmp_path / "logger.txt", skip=2)
    (tmp_path / "old.csv").write_bytes("t;\u03b1 [\u00b0]\n0;1;\n1;2;\n".encode("latin-1", "replace"))
    assert list(read_table(tmp_path / "old.csv")) == ["t", "? [\u00b0]"]
    (tmp_path / "ragged.csv").write_text("by, someone\na,b,c\n1,2,3\n")
    with pytest.raises(ValueError, match=r"unreadable .*skip=N leaves out N lines before it\.$"):
        read_table(tmp_path / "ragged.csv")
    with pytest.raises(ValueError, match=r"absent.csv', no file: it must be the path of a table"):
        read_table(tmp_path / "absent.csv")


UNITS = {
    "ms": (1e-3, "s"), "deg": (np.pi / 180.0, "rad"), "rpm": (np.pi / 30.0, "rad/s"),
    "mm/s": (1e-3, "m/s"), "kN": (1e3, "N"), "mA": (1e-3, "A"), "N": (1.0, "N"), "mV": (1e-3, "V"),
    "g": (1e-3, "kg"), "kg": (1.0, "kg"), "inch": (0.0254, "m"), "um": (1e-6, "m"),
}  # fmt: skip


@pytest.mark.parametrize("unit", UNITS)
def test_units(unit):
    factor, si = UNITS[unit]
    record = Record.from_table(
        {"t": T, "a": ANGLE}, time="t", values={"x": "a"}, from_units={"time": "ms", "x": unit}
    )
    np.testing.assert_allclose(record.values["x"], factor * ANGLE, rtol=1e-14)
    np.testing.assert_allclose(record.times, 1e-3 * T, rtol=1e-14)
    assert record.units == {"x": si}


def test_units_refused():
    for given, words in (({"y": "mm"}, "named after one of time, x"), ({"x": "furz"}, "furz")):
        with pytest.raises(ValueError, match=words):
            Record.from_table({"t": T, "x": T}, time="t", values=("x",), from_units=given)


def test_units_in_names():
    """What stands in brackets is the unit, if it is one: nothing in millimetres is taken for metres."""
    table = {"Zeit [ms]": T, "Weg [mm]": ANGLE, "Kraft (N)": ANGLE, "a (filtered)": ANGLE}
    with pytest.raises(ValueError, match=r"time = 'Zeit \[ms\]', in 'ms': .*from_units"):
        Record.from_table(table, time="Zeit [ms]", values={"x": "Weg [mm]"})
    record = Record.from_table(
        table, time="Zeit [ms]", from_units={"time": "ms"},
        values={"x": "Weg [mm]", "f": "Kraft (N)", "a": "a (filtered)"},
    )  # fmt: skip
    assert record.units == {"x": "mm", "f": "N"}
    with pytest.raises(ValueError, match=r"units\['x'\] = 'mm': it must be in 'm'.*from_units"):
        problem(0.1).with_records(Record(record.times, {"x": ANGLE}, units={"x": "mm"}))


def test_frames_and_summary():
    """Rate, gaps, jitter, quantum of an encoder, and an amplifier that clips."""
    rng = np.random.default_rng(0)
    times = np.delete(1e-3 * np.arange(4001), range(1000, 1021))
    turns = np.round(3.0 * np.sin(2.0 * times) / 1e-3) * 1e-3
    clipped = np.clip(3.0 * np.sin(5.0 * times), -2.5, 2.5)
    rests = np.where(times < 2.0, times - times**2 / 4.0, 1.0)
    noisy = np.cos(2.0 * times) + 0.01 * rng.normal(size=times.size)
    frame = pd.DataFrame({"time": times, "turn": turns, "u": clipped, "x": rests, "y": noisy})
    seen = Record.from_table(frame, values=("turn", "u", "x", "y")).summary()
    assert (seen.samples, seen.gaps) == (3980, 1)
    assert seen.rate == pytest.approx(1000.0)
    assert seen.longest == pytest.approx(0.022)
    assert seen.series["turn"].quantum == pytest.approx(1e-3, rel=1e-6)
    assert [seen.series[name].quantum for name in ("u", "x", "y")] == [None] * 3
    share = np.mean(np.abs(clipped) == 2.5)
    assert seen.series["u"].saturated == pytest.approx(share, abs=0.002)
    assert [seen.series[name].saturated for name in ("turn", "x", "y")] == [0.0] * 3
    assert seen.series["y"].noise == pytest.approx(0.01, rel=0.1)
    for text in ("3,980 samples in 4 s at 1000 Hz", "1 gap, the longest 0.022 s", "saturated"):
        assert text in str(seen)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("noise", [1e-1, 1e-2, 1e-4])
def test_noise_level_is_that_of_the_noise(noise, size):
    """Of 100 draws: the mean to 3%, and none off by more than six standard deviations."""
    t = np.linspace(0.0, 6.0, 600)
    rng = np.random.default_rng(2)
    found = [
        noise_level(size * (np.sin(3.0 * t) + t + noise * rng.normal(size=t.size))) / (noise * size)
        for _ in range(100)
    ]
    assert np.mean(found) == pytest.approx(1.0, abs=0.03)
    assert max(np.abs(np.array(found) - 1.0)) < 0.3


def test_noise_level_of_an_encoder():
    """Of a slow motion the differences see less than the steps leave: q/sqrt(12) is the least."""
    t = np.linspace(0.0, 1.0, 2000)
    row = np.round(0.5 * t / 1e-2) * 1e-2
    assert noise_level(row) < 1e-2 / np.sqrt(12.0)
    assert noise_level(row, 1e-2) == pytest.approx(1e-2 / np.sqrt(12.0))
    with pytest.raises(ValueError, match="changes"):
        noise_level(np.ones(20))


def problem(sd, **options):
    times = np.linspace(0.0, 10.0, 400)
    clean = 1.0 - np.cos(times)
    data = clean + 0.02 * np.random.default_rng(4).normal(size=times.size)
    return Problem(
        lambda p, inputs: CoulombOscillator(p["mass"], 1.0, 1e-12, 1e-12, 0.0),
        lambda p, inputs: Motion(0.0, 0.0),
        {"mass": 1.1},
        {"x": Observed(lambda t, y, system: 1.0 + y.x, sd, "m", **options)},
        Record(times, {"x": data}),
    )


def test_a_problem_finds_the_noise_of_its_records():
    found = problem(None)
    assert float(found.observed["x"].sd) == pytest.approx(0.02, rel=0.15)
    assert float(problem(None, quantum=0.5).observed["x"].sd) == pytest.approx(0.5 / np.sqrt(12.0))
    assert float(problem(0.3).observed["x"].sd) == 0.3
    other = found.with_records(Record([0.0, 1.0], {"x": [0.0, 1.0]}))
    assert float(other.observed["x"].sd) == float(found.observed["x"].sd)
    with pytest.raises(ValueError, match=r"observed\['x'\]\.sd.*stated"):
        Problem(
            lambda p, inputs: CoulombOscillator(1.0, p["k"], 1.0, 0.5, 0.2),
            lambda p, inputs: Motion(0.0, 0.0),
            {"k": 1.0},
            {"x": Observed(lambda t, y, system: y.x)},
            Record([0.0, 1.0, 2.0], {"x": [0.0, 1.0, 2.0]}),
        )
