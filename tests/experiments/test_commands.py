"""The command line and the files of an experiment, on one that takes no time."""

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
        Statement("T1", "The line rises.", bool(d.y[-1] > d.y[0]), f"by {float(d.y[-1]):g} m"),
        Statement("T2", "It is green.", None, "not looked at"),
    ],
)


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
        "id": "T1", "claim": "The line rises.", "holds": True, "measured": "by 3 m"
    }  # fmt: skip


def test_equal_runs_draw_equal_pictures(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    run(LINE, one)
    run(LINE, other)
    assert (one / "test-line.svg").read_bytes() == (other / "test-line.svg").read_bytes()


def test_scoreboard(tmp_path):
    assert "No statements" in scoreboard(tmp_path)
    run(LINE, tmp_path, changes=["slope=-1"])
    text = scoreboard(tmp_path)
    assert "T1               does not hold  test-line" in text
    assert "the papers' statements: 0 holds, 1 does not hold, 1 open" in text


def _record(out, name, holds, **more):
    statements = [{"id": "B1", "claim": "It moves.", "holds": holds, "measured": "by 1 m"}]
    record = {"name": name, "statements": statements, "quick": False, "parameters": {}, **more}
    (out / f"{name}.json").write_text(json.dumps(record))


def test_scoreboard_counts_full_runs_of_the_papers_apart(tmp_path):
    """Neither a quick run, nor the demo, nor a set that we found says anything on the papers."""
    _record(tmp_path, "block-fig02", True)
    _record(tmp_path, "block-fig03", True)
    _record(tmp_path, "block-fig04", False, quick=True)
    _record(tmp_path, "demo", False)
    _record(tmp_path, "block-search", True)
    _record(tmp_path, "block-fig05", False, parameters={"set": "found"})
    _record(tmp_path, "mechanism-froude", False)
    text = scoreboard(tmp_path)
    assert "the papers' statements: 1 holds, 0 does not hold, 0 open" in text
    assert "quick runs and demo, a first look: 0 holds, 1 does not hold, 0 open" in text
    apart = "0 holds, 0 does not hold, 1 open (1 of these because records do not agree)"
    assert f"found by our searches: {apart}" in text
    assert "known results of declared machines: 0 holds, 1 does not hold, 0 open" in text


def test_scoreboard_passes_over_what_is_no_record(tmp_path):
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


@pytest.mark.parametrize(
    "record", ["[]", "{}", "3", '{"statements": [{"id": "x"}]}', '{"statements": 3}', "{", "null",
               '{"name": "a", "statements": [{"id": "b", "claim": "c", "holds": "maybe",'
               ' "measured": "d"}]}'],
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


@pytest.mark.usefixtures("only_line")
def test_commands(tmp_path, capsys):
    out = ["--out", str(tmp_path)]
    assert command.main(["--list"]) == 0
    assert "test-line" in capsys.readouterr().out
    assert command.main(["test-line", "--quick", *out]) == 0
    assert "test-line.png" in capsys.readouterr().out
    assert command.main(["statements", *out]) == 0
    assert "1 holds" in capsys.readouterr().out
    assert command.main(["no-such", *out]) == 2
    assert "'no-such' is not an experiment" in capsys.readouterr().err
    assert command.main(["test-line", "--set", "points=x", *out]) == 2
    assert command.main(["all", "--set", "points=3", *out]) == 2


def test_every_figure_of_the_paper_is_listed():
    names = [name for name in load() if name.startswith("block-")]
    assert names[:10] == [f"block-fig{n:02d}" for n in range(2, 12)]
    for name, experiment in load().items():
        assert experiment.name == name
        assert set(experiment.quick) <= set(experiment.parameters)
