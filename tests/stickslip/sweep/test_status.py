"""What a store says of itself: how far it is, what is damaged, who computed it."""

import json
import os
import shutil

import numpy as np
import pytest

from stickslip.__main__ import main
from stickslip.sweep import (
    SweepMismatchError,
    open_dataset,
    run_sweep,
    sweep_status,
    verify_store,
)
from stickslip.sweep import _describe as describe_module
from tests.stickslip.sweep import _sweeps
from tests.stickslip.sweep._options import contents, options


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished store of one shard with two blocks, and of one at the edge."""
    path = tmp_path_factory.mktemp("status") / "store"
    _sweeps.small(path, chunk=3, shard=6)
    return path


def test_done_missing_and_damaged(whole, tmp_path):
    found = sweep_status(whole)
    # k > 1.5 for 1.75 and 2.0, of five, and two of q.
    assert found["codes"] == {"code": {"low": 6, "high": 4}}
    assert found["lanes"] == found["lanes_finished"] == 10
    assert found["units"] == found["units_finished"] == len(list((whole / "finished").iterdir()))
    assert (found["units_missing"], found["damaged"]) == (0, [])
    assert found["bytes"] == sum(p.stat().st_size for p in (whole / "data.zarr").rglob("c/*/0"))
    path = tmp_path / "store"
    shutil.copytree(whole, path)
    last = max(int(p.stem) for p in (path / "finished").iterdir())
    (path / "finished" / f"{last:06d}.json").unlink()
    (path / "data.zarr" / "x" / "c" / "0" / "0").write_bytes(b"short")
    found = sweep_status(path)
    assert (found["units_missing"], found["damaged"]) == (1, ["unit 0"])
    assert found["lanes_finished"] == 10 - 6 - 4 + sum(found["codes"].get("code", {}).values())
    assert json.loads(json.dumps(found)) == found
    _sweeps.small(path, chunk=3, shard=6)
    assert {**sweep_status(path), "bytes": 0} == {**sweep_status(whole), "bytes": 0}


@pytest.mark.parametrize(
    "places", [[0.5], pytest.param([0.0, 0.1, 0.33, 0.8, 1.0], marks=pytest.mark.slow)]
)
def test_a_flipped_byte_anywhere_is_found_and_computed_again(places, whole, tmp_path):
    """In every file of the store."""
    path, flipped = tmp_path / "store", 0
    shutil.copytree(whole, path)
    assert verify_store(path) == []
    for name, data in contents(whole).items():
        for where in [int(place * (len(data) - 1)) for place in places]:
            file = path / name
            times = os.stat(file)
            damaged = bytearray(data)
            damaged[where] ^= 1
            file.write_bytes(bytes(damaged))
            # As where a disk decays: no time shows it (but the one of change, which nobody can set).
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
            flipped += 1
            if name == "manifest.json":
                try:
                    assert verify_store(path) == [name]
                except ValueError as error:
                    assert "manifest.json" in str(error)  # noqa: PT017
                _sweeps.small(path, chunk=3, shard=6)
                (path / "manifest.json.damaged").unlink(missing_ok=True)
            else:
                assert verify_store(path) == [name]
                assert verify_store(path, repair=True) == [name]
                _sweeps.small(path, chunk=3, shard=6)
            assert verify_store(path) == [], (name, where)
    assert flipped >= 14 * len(places)
    for part in ("data.zarr", "finished"):
        assert contents(path / part) == contents(whole / part)


def test_decay_that_no_time_shows_is_left_to_verify(whole, tmp_path, monkeypatch):
    """`run_sweep` believes what is old and of the right size: so it says, and `verify` does not."""
    from stickslip.sweep import _records

    path = tmp_path / "store"
    shutil.copytree(whole, path)
    victim = next(iter(sorted((path / "data.zarr" / "x" / "c").rglob("0"))))
    victim = victim if victim.is_file() else next(p for p in victim.rglob("*") if p.is_file())
    data = bytearray(victim.read_bytes())
    data[len(data) // 2] ^= 4
    victim.write_bytes(bytes(data))
    with monkeypatch.context() as patch:
        patch.setattr(
            _records, "_time_of_change", lambda path: 0 if path == victim or path.is_dir() else 1
        )
        _sweeps.small(path, chunk=3, shard=6)
    assert verify_store(path) == [str(victim.relative_to(path))]
    assert verify_store(path, repair=True)
    _sweeps.small(path, chunk=3, shard=6)
    assert contents(path) == contents(whole)


def test_the_commands_for_people_and_programs(whole, tmp_path, capsys):
    path = tmp_path / "store"
    shutil.copytree(whole, path)
    assert main(["status", str(path)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("10 of 10 lanes (100.0%)")
    assert "code: 6 low, 4 high" in said
    assert main(["status", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == sweep_status(path)
    assert main(["verify", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}: every file is as it was written\n"
    (path / "data.zarr" / "zarr.json").write_text("{}")
    assert main(["verify", str(path)]) == 1
    assert capsys.readouterr().out == "data.zarr/zarr.json\n"
    assert main(["status", str(tmp_path)]) == 2
    assert "has no manifest.json" in capsys.readouterr().err


def test_a_host_that_differs_is_refused_by_name_or_recorded(tmp_path, monkeypatch):
    other = {**describe_module.versions(), "jaxlib": "0.0.1"}

    def sweep(store, hosts):
        return run_sweep(_sweeps.plain, _sweeps.SMALL, **options(store, chunk=2, hosts=hosts))

    for hosts in ("alike", "any"):
        path = tmp_path / hosts
        sweep(path, hosts)
        ours = (path / "finished" / "000000.json").read_text()
        (path / "finished" / "000001.json").unlink()
        with monkeypatch.context() as patch:
            patch.setattr(describe_module, "versions", lambda: other)
            if hosts == "alike":
                with pytest.raises(SweepMismatchError, match=r"computed_with\.jaxlib is .*0\.0\.1"):
                    sweep(path, hosts)
                continue
            sweep(path, hosts)
        record = json.loads((path / "finished" / "000001.json").read_text())
        assert record["computed_with"]["jaxlib"] == "0.0.1"
        assert json.loads(ours)["computed_with"]["jaxlib"] == describe_module.versions()["jaxlib"]
        assert verify_store(path) == []
        assert open_dataset(path).attrs["sweep_state"] == "finished"
        assert (path / "finished" / "000000.json").read_text() == ours
        sweep(path, hosts)
        with pytest.raises(SweepMismatchError, match="hosts = 'any' is in the store only"):
            sweep(path, "alike")


def test_a_store_of_format_2_is_gone_on_with_in_its_own_way(tmp_path):
    """As the version before wrote it: no shard, and records without sizes and seal."""
    from stickslip.sweep._manifest import identity, with_checksum

    path = tmp_path / "store"
    _sweeps.small(path)
    before = contents(path / "data.zarr")
    manifest = json.loads((path / "manifest.json").read_text())
    del manifest["shard"]
    manifest = with_checksum({**manifest, "format": 2})
    (path / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")
    for file in (path / "finished").iterdir():
        record = json.loads(file.read_text())
        record = {"sweep": identity(manifest), "block": record["block"], "files": record["files"]}
        file.write_text(json.dumps(record, indent=1) + "\n")
    old = contents(path)
    assert open_dataset(path).attrs["sweep_state"] == "finished"
    assert verify_store(path) == []
    (path / "finished" / "000002.json").unlink()
    victim = path / "data.zarr" / "x" / "c" / "4" / "0"
    victim.write_bytes(victim.read_bytes()[:-1] + b"?")
    np.testing.assert_array_equal(_sweeps.small(path).x, np.add.outer(*_sweeps.SMALL.values()))
    assert contents(path) == old
    assert contents(path / "data.zarr") == before
    with pytest.raises(SweepMismatchError, match=r"format is 2 in the store, 3 now; .*shard"):
        _sweeps.small(path, shard=4)
