"""The command line and the files of an experiment, on one that takes no time."""

import dataclasses
import json
import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from experiments import __main__ as command
from experiments import _experiment, _settings
from experiments._experiment import Experiment, Statement, chosen, load
from experiments._output import run
from experiments._scoreboard import scoreboard


def _compute(parameters, context):
    x = np.linspace(0.0, 1.0, parameters["points"])
    return xr.Dataset(
        {"y": ("x", parameters["slope"] * x, {"units": "m"})}, {"x": ("x", x, {"units": "s"})}
    )


def _draw(dataset):
    figure = Figure()
    figure.add_subplot().plot(dataset.x, dataset.y)
    return figure


LINE = Experiment(
    name="test-line",
    title="A line",
    parameters={"points": 100, "slope": 2.0},
    quick={"points": 5},
    compute=_compute,
    draw=_draw,
    judge=lambda d: [
        Statement("B1", "The line rises.", bool(d.y[-1] > d.y[0]), f"by {float(d.y[-1]):g} m"),
        Statement("B2", "It is green.", None, "not looked at"),
    ],
)


FALLING = dataclasses.replace(LINE, parameters={"points": 100, "slope": -1.0})


@pytest.fixture
def only_line(monkeypatch):
    monkeypatch.setattr(_experiment, "load", lambda: {"test-line": LINE})
    monkeypatch.setattr(command, "DEMO", "test-line")
    monkeypatch.setattr(command, "_keep_compiled", lambda: None)


def test_files_of_a_run(tmp_path):
    files = run(LINE, tmp_path, quick=True, changes=["slope=3"])
    assert sorted(p.name for p in files) == [f"test-line.{k}" for k in ("json", "nc", "png", "svg")]
    with xr.open_dataset(tmp_path / "test-line.nc", engine="h5netcdf") as data:
        assert data.y.attrs["units"] == "m"
        np.testing.assert_allclose(data.y, 3.0 * data.x)
    record = json.loads((tmp_path / "test-line.json").read_text())
    assert record["parameters"] == {"points": 5, "slope": 3.0}
    assert record["quick"] is True
    assert record["wall_time_s"]["total"] >= record["wall_time_s"]["compute"]
    assert record["statements"][0] == {
        "id": "B1", "claim": "The line rises.", "holds": True, "measured": "by 3 m", "reading": "",
        "found": False,
    }  # fmt: skip
    assert record["changed"] == {"points": 5, "slope": 3.0}
    assert record["results"]["y"] == {
        "shape": [5], "units": "m", "finite": 5, "least": 0.0, "greatest": 3.0
    }  # fmt: skip


def test_equal_runs_draw_equal_pictures(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    run(LINE, one)
    run(LINE, other)
    assert (one / "test-line.svg").read_bytes() == (other / "test-line.svg").read_bytes()


def test_scoreboard(tmp_path):
    assert "No statements" in scoreboard(tmp_path)
    run(FALLING, tmp_path)
    text = scoreboard(tmp_path)
    assert re.search(r"^B1 +does not hold$", text, re.MULTILINE)
    assert "measured by test-line: by -1 m" in text
    assert "the papers' statements: 0 holds, 1 does not hold, 1 open" in text


def _record(out, name, holds, *, id="B1", reading="", found=False, **more):
    statements = [
        {"id": id, "claim": "It moves.", "holds": holds, "measured": "by 1 m", "reading": reading,
         "found": found},
    ]  # fmt: skip
    record = {"name": name, "statements": statements, "quick": False, "changed": {}, **more}
    (out / f"{name}.json").write_text(json.dumps(record))


def test_scoreboard_counts_each_statement_once_and_full_runs_only(tmp_path):
    """Three figures judge B1 in one reading, one of them does so in another."""
    _record(tmp_path, "block-fig02", True, reading="simplified")
    _record(tmp_path, "block-fig03", True, reading="printed sign")
    _record(tmp_path, "block-fig04", True, reading="printed sign")
    _record(tmp_path, "block-fig05", False, reading="printed sign", quick=True)
    _record(tmp_path, "block-fig06", False, reading="printed sign", changed={"duration": 1.0})
    _record(tmp_path, "demo", False, reading="simplified")
    text = scoreboard(tmp_path)
    assert "the papers' statements: 2 holds, 0 does not hold, 0 open" in text
    assert len(re.findall(r"^B1 .* holds", text, re.MULTILINE)) == 2
    assert "block-fig05 (quick)" in text
    assert "block-fig06 (not at full size)" in text
    _record(tmp_path, "block-fig04", False, reading="printed sign")
    apart = "1 holds, 0 does not hold, 1 open (1 of these because records do not agree)"
    assert f"the papers' statements: {apart}" in scoreboard(tmp_path)


def test_scoreboard_keeps_apart_who_claims_what(tmp_path):
    """What we claim of our searches, sets that they found, machines, measured records and fits."""
    _record(tmp_path, "block-fig04", False)
    _record(tmp_path, "beam-search", True, id="C1", found=True)
    _record(tmp_path, "block-search", True, id="X1")
    _record(tmp_path, "corexy-feedforward", True, id="F1")
    _record(tmp_path, "mechanism-froude", True, id="M1.1")
    _record(tmp_path, "identify-rock", True, id="R3.1")
    _record(tmp_path, "identify-coverage", True, id="Y1.1")
    text = scoreboard(tmp_path)
    assert "the papers' statements: 0 holds, 1 does not hold, 0 open" in text
    assert "parameters that our searches found: 1 holds" in text
    assert "our own searches, plans and designs: 2 holds" in text
    assert text.count(": 1 holds, 0 does not hold, 0 open") == 4


def test_scoreboard_passes_over_other_files(tmp_path):
    _record(tmp_path, "block-fig02", "maybe")
    (tmp_path / "other.json").write_text('{"name": "x", "statements": [{"id": "B1"}]}')
    (tmp_path / "list.json").write_text("[1]")
    assert "No statements" in scoreboard(tmp_path)
    _record(tmp_path, "block-fig03", None)
    text = scoreboard(tmp_path)
    assert text.count("not a record of an experiment") == 3
    assert "the papers' statements: 0 holds, 0 does not hold, 1 open" in text


@pytest.mark.parametrize(
    ("change", "text"),
    [("depth=3", "one of the keys points, slope"), ("slope", "must be key=value"),
     ("points=3.5", "must be an integer"), ("slope=steep", "must be a number")],
)  # fmt: skip
def test_wrong_settings_are_named(change, text):
    with pytest.raises(ValueError, match=f"--set {change}: .*{text}"):
        chosen(LINE, False, [change])


@pytest.mark.parametrize(
    "change",
    ["k3_step=0", "k3_step=-0.25", "k3_step=nan", "k3_step=1e-300", "k3_step=100", "k3_min=99",
     "k3_max=72", "tolerance=-1", "tolerance=nan", "method=euler", "set=B", "h=0", "transient=-1",
     "max_points=0", "exponents=-1", "duration=0", "duration=inf"],
)  # fmt: skip
def test_values_that_no_diagram_can_have_are_named(change, capsys):
    key = change.partition("=")[0]
    assert command.main(["block-fig02", "--quick", "--set", change]) == 2
    assert re.match(rf"--set {key}=\S+: it must be .+\.\n$", capsys.readouterr().err)


def test_a_window_that_is_empty_is_named_by_its_end(capsys):
    assert command.main(["block-fig02", "--set", "k3_min=99", "--set", "k3_max=72"]) == 2
    assert capsys.readouterr().err == "--set k3_max=72: it must be above k3_min = 99.0.\n"


def test_all_parameters_are_of_the_kind_that_is_allowed():
    for experiment in load().values():
        for quick in (False, True):
            values = chosen(experiment, quick, [])
            _settings.check(values, {key: str(value) for key, value in values.items()})


@pytest.mark.more
@pytest.mark.parametrize(
    "record", ["[]", "{}", "3", '{"statements": [{"id": "x"}]}', '{"statements": 3}', "{", "null",
               '{"name": "a", "quick": false, "statements": [{"id": "B1", "claim": "c",'
               ' "holds": "maybe", "measured": "d"}]}',
               '{"name": "a", "quick": false, "statements": [{"id": "Q1", "claim": "c",'
               ' "holds": true, "measured": "d"}]}'],
)  # fmt: skip
def test_other_json_is_no_record(record, tmp_path):
    (tmp_path / "other.json").write_text(record)
    run(LINE, tmp_path)
    text = scoreboard(tmp_path)
    assert "other.json: not a record of an experiment" in text
    assert "1 holds, 0 does not hold, 1 open" in text


def test_statements_of_no_directory(tmp_path, capsys):
    assert command.main(["statements", "--out", str(tmp_path / "none")]) == 2
    assert "none: it must be a directory of results" in capsys.readouterr().err


def test_help_says_what_can_be_set(capsys):
    assert command.main(["-h"]) == 0
    assert "keys of --set:" not in capsys.readouterr().out
    assert command.main(["block-fig02", "--help"]) == 0
    told = capsys.readouterr().out
    assert "k3_step=0.001, with --quick 0.5" in told
    assert "method=tsit5; one of dop853, tsit5, rk4" in told
    assert command.main(["identify-corexy", "-h"]) == 0
    own = capsys.readouterr().out.split("keys of --set with --data FILE:")[1]
    assert "  scored=" in own


@pytest.mark.usefixtures("only_line")
def test_commands(tmp_path, capsys):
    out = ["--out", str(tmp_path)]
    assert command.main(["--list"]) == 0
    assert "test-line" in capsys.readouterr().out
    assert command.main(["test-line", "--quick", *out]) == 0
    assert "test-line.png" in capsys.readouterr().out
    assert command.main(["statements", *out]) == 0
    assert "test-line (quick)" in capsys.readouterr().out
    assert command.main(["no-such", *out]) == 2
    assert "'no-such' is not an experiment" in capsys.readouterr().err
    assert command.main(["test-line", "--set", "points=x", *out]) == 2
    assert command.main(["all", "--set", "points=3", *out]) == 2


def test_every_figure_of_the_paper_is_listed():
    names = [name for name in load() if name.startswith("block-fig")]
    assert names == [f"block-fig{n:02d}" for n in range(2, 12)]
    for name, experiment in load().items():
        assert experiment.name == name
        assert set(experiment.quick) <= set(experiment.parameters)
