"""The records in the repository, and the pages written from them."""

import dataclasses
import json

import pytest
from PIL import Image

from experiments import __main__ as command
from experiments._experiment import Statement, load
from experiments._output import run, write_record
from experiments._records import FOLDER, WIDTH, keep, read
from experiments._results_page import results, thresholds, write
from experiments._scoreboard import rows
from experiments._statement import CLAIMS
from tests.experiments.test_commands import LINE

PAGES = FOLDER.parent


def test_the_pages_are_those_of_the_records():
    experiments = load()
    records = read()
    assert (PAGES / "RESULTS.md").read_text(encoding="utf-8") == results(records, experiments)
    assert (PAGES / "THRESHOLDS.md").read_text(encoding="utf-8") == thresholds()
    assert set(records) <= set(experiments)


def test_claims_in_the_records_are_those_of_the_code():
    """A claim reworded or renamed asks for the records to be taken anew."""
    load()
    for row in rows(read().values()):
        if row.id in CLAIMS:
            assert row.claim == CLAIMS[row.id].text, row.id


def test_each_record_has_a_small_picture():
    names = {path.stem for path in FOLDER.glob("*.json")}
    pictures = sorted(FOLDER.glob("*.png"))
    assert {path.stem for path in pictures} == names
    for path in pictures:
        with Image.open(path) as picture:
            assert picture.width in (WIDTH, WIDTH // 2)  # half of it before it was doubled
            assert picture.mode == "P"
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 3e6


def test_full_runs_are_taken_over_and_others_left(tmp_path):
    out, folder = tmp_path / "out", tmp_path / "records"
    steep = dataclasses.replace(LINE, name="test-steep")
    small = dataclasses.replace(LINE, name="test-small")
    experiments = {e.name: e for e in (LINE, steep, small)}
    run(LINE, out)
    run(steep, out, changes=["slope=3"])
    run(small, out, quick=True)
    taken, left = keep(out, experiments, folder)
    assert taken == ["test-line"]
    assert left == ["test-steep: not a full run", "test-small: not a full run"]
    record = read(folder)["test-line"]
    assert record["statements"][0]["measured"] == "by 2 m"
    assert record["results"]["y"]["greatest"] == 2.0
    # Judged anew from the data: another predicate, the same run.
    judged = dataclasses.replace(LINE, judge=lambda d: [Statement("B1", "It falls.", False, "no")])
    keep(out, {"test-line": judged}, folder)
    assert read(folder)["test-line"]["statements"][0]["claim"] == "It falls."


def test_the_page_tells_what_was_not_run(tmp_path):
    write({}, load(), tmp_path)
    text = (tmp_path / "RESULTS.md").read_text(encoding="utf-8")
    assert "Not run for this page: `block-branches`, `block-fig02`, " in text
    assert "| holds |" not in text


@pytest.mark.parametrize("change", [{"quick": True}, {"changed": {"h": 1.0}}, {"name": "other"}])
def test_a_record_that_is_not_of_a_full_run_is_named(tmp_path, change):
    record = json.loads((FOLDER / "corexy-fig04.json").read_text(encoding="utf-8"))
    write_record(record, tmp_path / "corexy-fig04.json")
    assert list(read(tmp_path)) == ["corexy-fig04"]
    write_record(record | change, tmp_path / "corexy-fig04.json")
    with pytest.raises(ValueError, match=r"corexy-fig04\.json: it must be the record of a full run"):
        read(tmp_path)


def test_there_is_nothing_to_take_from_no_directory(tmp_path, capsys):
    assert command.main(["record", "--out", str(tmp_path / "none")]) == 2
    assert "none: it must be a directory of results" in capsys.readouterr().err


def test_the_page_of_benchmarks_is_that_of_their_records(tmp_path):
    from experiments.benchmarks import _records
    from experiments.benchmarks.__main__ import BENCHMARKS

    assert _records.PAGE.read_text(encoding="utf-8") == _records.page(BENCHMARKS)
    entry = _records.record("chain", "full", ["head", "a row"], 12.0, 0.5, None)
    _records.keep(entry, tmp_path)
    text = _records.page(BENCHMARKS, tmp_path)
    assert "`python -m experiments.benchmarks chain --full`, 12 s on " in text
    assert "```text\nhead\na row\n```" in text
    assert "Not run for this page: stick-slip, derivatives, " in text


def test_a_first_look_at_a_benchmark_is_not_kept(capsys):
    from experiments.benchmarks.__main__ import main

    with pytest.raises(SystemExit):
        main(["chain", "--quick", "--record"])
    assert "--record: it must be without --quick" in capsys.readouterr().err
