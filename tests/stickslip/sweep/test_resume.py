"""A sweep that is called again: what may differ, where its store may lie, how it is interrupted."""

import errno
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from stickslip.sweep import SweepMismatchError, SweepWriteError, Variable, open_dataset, run_sweep
from stickslip.sweep import _store as store_module
from stickslip.sweep.evaluate import Evaluate
from tests.house._repository import ROOT
from tests.stickslip.sweep._damage import lane, sweep, truth
from tests.stickslip.sweep._options import options

SQUARE = {"k": np.linspace(0.0, 1.0, 8), "q": np.linspace(5.0, 6.0, 8)}


def plane(k, q):
    return {"x": 100.0 * k + q}


def assert_sound(dataset):
    for name, want in truth().items():
        np.testing.assert_array_equal(dataset[name], want)


@pytest.fixture
def counted(monkeypatch):
    """Numbers of the blocks that are computed."""
    numbers, evaluate = [], Evaluate.__call__

    def counting(self, block, read):
        numbers.append(block.number)
        return evaluate(self, block, read)

    monkeypatch.setattr(Evaluate, "__call__", counting)
    return numbers


def test_coordinates_in_another_order_are_another_sweep(tmp_path):
    how = options(tmp_path / "s", chunk=8)
    run_sweep(plane, SQUARE, **how)
    for path in sorted((tmp_path / "s" / "finished").iterdir())[4:]:
        path.unlink()
    turned = {name: SQUARE[name] for name in ("q", "k")}
    with pytest.raises(SweepMismatchError, match=r"coordinates is .*'k', 'q'.* in the store"):
        run_sweep(plane, turned, **how)
    k, q = np.meshgrid(*SQUARE.values(), indexing="ij")
    np.testing.assert_allclose(run_sweep(plane, SQUARE, **how).x, 100.0 * k + q)


def test_labels_may_differ_and_are_written_into_the_store(tmp_path, counted):
    store = tmp_path / "s"
    sweep(store)
    counted.clear()
    grid = {name: truth()[name] for name in ("k", "q")}
    variables = {"x": Variable(units="mm", attrs={"flags": np.arange(3)}), "k": Variable(units="N/m")}
    about = {"variables": variables, "name": "new", "attrs": {"by": "me"}, "settings": {"seed": 1}}
    new = run_sweep(lane, grid, **options(store, chunk=4, **about))
    assert counted == []
    for dataset in (new, open_dataset(store)):
        assert_sound(dataset)
        assert dataset.x.attrs == {"units": "mm", "flags": [0, 1, 2]}
        assert dataset.k.attrs == {"units": "N/m"}
        assert dataset.attrs["title"] == "new"
        assert dataset.attrs["by"] == "me"
    sweep(store)
    assert open_dataset(store).x.attrs == {"units": "m"}


def test_a_sign_of_zero_in_the_carry_is_another_sweep(tmp_path):
    def step(carry, k):
        return carry, {"x": k + 1.0 / carry}

    call = {"grid": {"k": [1.0]}, **options(tmp_path / "s")}
    assert run_sweep(step, carry=0.0, **call).x == np.inf
    with pytest.raises(SweepMismatchError, match=r"carried.sha256"):
        run_sweep(step, carry=-0.0, **call)


def test_an_unfinished_store_says_so_and_shows_what_it_has(tmp_path):
    sweep(tmp_path / "s")
    (tmp_path / "s" / "finished" / "000001.json").unlink()
    dataset = open_dataset(tmp_path / "s")
    assert dataset.attrs["sweep_state"] == "unfinished: 2 of 3 blocks"
    assert np.isnan(dataset.x[2:4]).all()
    assert (dataset.code[2:4] == -1).all()
    for rows in (slice(0, 2), slice(4, 5)):
        np.testing.assert_array_equal(dataset.pair[rows], truth()["pair"][rows])


def test_unverified_is_read_as_it_is_and_says_so(tmp_path):
    sweep(tmp_path / "s")
    header = tmp_path / "s" / "data.zarr" / "x" / "zarr.json"
    header.write_text(header.read_text().replace('"m"', '"mm"'))
    with pytest.raises(ValueError, match=r"is damaged, data.zarr/x/zarr.json is not as it was written"):
        open_dataset(tmp_path / "s")
    dataset = open_dataset(tmp_path / "s", verify=False)
    assert dataset.attrs["sweep_verified"] == "no"
    assert_sound(dataset)
    assert dataset.x.attrs == {"units": "mm"}
    header.write_text("{")
    with pytest.raises(ValueError, match=r"^path = .* cannot be read \(\w+: "):
        open_dataset(tmp_path / "s", verify=False)


@pytest.mark.parametrize(
    "label",
    [
        Variable(units="days"),
        Variable(units="days since 2000-01-01"),
        Variable(attrs={"scale_factor": 3.0}),
    ],
    ids=["span", "date", "scale"],
)
def test_labels_leave_numbers_alone(label, tmp_path):
    """By default xarray would make dates of them, or scale them."""
    how = options(tmp_path / "s", variables={"value": label})
    run_sweep(lambda k: 2.0 * k, {"k": [1.0, 2.0]}, **how)
    dataset = open_dataset(tmp_path / "s")
    np.testing.assert_array_equal(dataset.value, [2.0, 4.0])
    assert dataset.value.dtype == np.float64
    assert dataset.value.attrs == label.attributes()


def test_format_1_is_refused_by_name(tmp_path):
    """As 0.1.0 wrote it: no order of coordinates, no seal, bare records."""
    store = tmp_path / "s"
    sweep(store)
    manifest = json.loads((store / "manifest.json").read_text())
    for key in ("coordinates", "host_code", "attributes", "files", "seal"):
        del manifest[key]
    (store / "manifest.json").write_text(json.dumps({**manifest, "format": 1}))
    for path in (store / "finished").iterdir():
        path.write_text(json.dumps(json.loads(path.read_text())["files"]))
    with pytest.raises(SweepMismatchError, match="is of format 1, made by stickslip"):
        sweep(store)
    with pytest.raises(ValueError, match="is of format 1"):
        open_dataset(store)
    assert_sound(open_dataset(store, verify=False))
    assert_sound(sweep(store, resume=False))


def test_the_home_directory_is_found(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert_sound(sweep("~/s"))
    assert (tmp_path / "s" / "manifest.json").exists()
    assert_sound(open_dataset("~/s"))
    assert not (tmp_path / "~").exists()


@pytest.mark.parametrize(
    ("store", "text"),
    [
        ("n" * 256, "at most 255 bytes"),
        ("\u00fc" * 200, "at most 255 bytes"),
        ("", "the path of a directory"),
        ("a\0b", "the path of a directory"),
        ("~nobody-of-this-name/s", "a user who has a home"),
    ],
)
def test_a_path_that_cannot_be_is_refused_by_name(store, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for call in (sweep, open_dataset):
        with pytest.raises(ValueError, match=rf"(?s)^path = '.*{text}"):
            call(store)
    with pytest.raises(ValueError, match=rf"(?s)^store = '.*{text}"):
        run_sweep(plane, SQUARE, store=store)
    with pytest.raises(TypeError, match="path = 3: it must be the path of a directory"):
        sweep(3)
    with pytest.raises(TypeError, match="store = 3: it must be the path of a directory, a Storage, or"):
        run_sweep(plane, SQUARE, store=3)


def test_what_is_no_store_is_not_opened(tmp_path):
    with pytest.raises(ValueError, match="it must be the directory of a sweep's store"):
        open_dataset(tmp_path / "nowhere")
    with pytest.raises(ValueError, match=r"has no manifest.json"):
        open_dataset(tmp_path)


def read_only(monkeypatch):
    """Every attempt to write fails as on a read-only file system."""
    original = os.open

    def refuse(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    def opened(path, flags, *rest, **named):
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            refuse()
        return original(path, flags, *rest, **named)

    monkeypatch.setattr(store_module.os, "open", opened)
    monkeypatch.setattr(store_module, "write_whole", refuse)
    for name in ("mkdir", "replace", "unlink"):
        monkeypatch.setattr(os, name, refuse)


@pytest.mark.parametrize("lost", [None, "lock", "runs.jsonl"])
def test_a_finished_store_on_a_read_only_file_system_is_read(lost, tmp_path, monkeypatch):
    store = tmp_path / "s"
    sweep(store)
    if lost:
        (store / lost).unlink()
    with monkeypatch.context() as patch:
        read_only(patch)
        assert_sound(sweep(store))
        assert_sound(open_dataset(store))
    (store / "finished" / "000001.json").unlink()
    with monkeypatch.context() as patch:
        read_only(patch)
        with pytest.raises(SweepWriteError, match="Read-only file system"):
            sweep(store)


def test_an_interruption_says_what_is_kept(tmp_path, monkeypatch):
    evaluate = Evaluate.__call__

    def stopped(self, block, read):
        if block.number == 2:
            raise KeyboardInterrupt
        return evaluate(self, block, read)

    with monkeypatch.context() as patch:
        patch.setattr(Evaluate, "__call__", stopped)
        with pytest.raises(KeyboardInterrupt, match=r"2 of 3 blocks are kept in store .*the same call"):
            sweep(tmp_path / "s")
        with pytest.raises(KeyboardInterrupt, match=r"8 of 10 lanes: nothing is kept, .* no store"):
            sweep(None)
    assert_sound(sweep(tmp_path / "s"))


INTERRUPTED = """
import runpy, sys
import stickslip.sweep
from experiments import _output
def run(*_, **__):
    raise KeyboardInterrupt("interrupted: 2 of 3 blocks are kept in store 's'")
_output.run = run
sys.argv = ["experiments", "demo", "--quick", "--out", sys.argv[1]]
runpy.run_module("experiments", run_name="__main__")
"""


@pytest.mark.slow
def test_the_command_line_says_so_too_and_ends_with_130(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, str(tmp_path)], cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, "STICKSLIP_CACHE": str(tmp_path / "cache")}, check=False,
    )  # fmt: skip
    assert done.returncode == 130
    assert done.stderr.endswith(
        "interrupted: 2 of 3 blocks are kept in store 's'\nthe same command goes on from here\n"
    )
    assert not (tmp_path / "stores" / "compiled").exists()
    assert (tmp_path / "cache" / "compiled").is_dir()


@pytest.mark.parametrize("resume", [True, False])
@pytest.mark.parametrize("own", ["data.zarr/zarr.json", "finished/000001.json", "manifest.json"])
def test_a_folder_that_only_looks_like_a_store_is_left_alone(own, resume, tmp_path):
    path = tmp_path / "s" / own
    path.parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "s" / "lock").touch()
    path.write_text('{"somebody": "else"}')
    with pytest.raises(ValueError, match=r"^store = .* has .*manifest.json"):
        sweep(tmp_path / "s", resume=resume)
    assert path.read_text() == '{"somebody": "else"}'
    assert {p.name for p in (tmp_path / "s").iterdir()} == {"lock", own.partition("/")[0]}
