"""Kinds of damage to a store: each a function of the store's path, by name."""

import functools
import json
import os
import pathlib
import shutil

import jax.numpy as jnp
import numpy as np

from stickslip.sweep import Variable, run_sweep
from tests.stickslip.sweep._options import options

GRID = {"k": np.array([1.0, 2.0, 4.0, 8.0, 16.0]), "q": np.array([0.5, 0.25])}
THESIS = "three years of work"


def lane(k, q):
    """A number, a vector and a code of every point."""
    return {"x": k + q, "pair": jnp.stack([k * q, k - q]), "code": (k > 3.0).astype(jnp.int32)}


def other_lane(k, q):
    """Other numbers of the same shapes."""
    return {name: value + 1 for name, value in lane(k, q).items()}


def sweep(store, function=lane, **more):
    """Five by two lanes in three blocks, the last of which is at the edge of the grid."""
    about = {"settings": {"seed": 1}, "variables": {"x": Variable(units="m")}}
    return run_sweep(function, GRID, **options(store, chunk=4, **about, **more))


def truth():
    """The results, by NumPy."""
    k, q = np.meshgrid(*GRID.values(), indexing="ij")
    return {"k": GRID["k"], "q": GRID["q"], "x": k + q, "pair": np.stack([k * q, k - q], -1),
            "code": (k > 3.0).astype(np.int32)}  # fmt: skip


FILES = {
    "manifest": "manifest.json",
    "record": "finished/000001.json",
    "group header": "data.zarr/zarr.json",
    "coordinate header": "data.zarr/k/zarr.json",
    "variable header": "data.zarr/x/zarr.json",
    "coordinate": "data.zarr/k/c/0",
    "chunk": "data.zarr/pair/c/1/0/0",
    "chunk at the edge": "data.zarr/x/c/2/0",
    "lock": "lock",
    "diary": "runs.jsonl",
}
FOLDERS = ["finished", "data.zarr", "data.zarr/k", "data.zarr/x", "data.zarr/x/c", "data.zarr/x/c/1"]


def _flip(path, where, bit=16):
    data = bytearray(path.read_bytes())
    if data:
        data[int(where * (len(data) - 1))] ^= bit
    path.write_bytes(bytes(data))


def _folder(path, thesis=False):
    path.unlink()
    path.mkdir()
    if thesis:
        (path / "thesis.tex").write_text(THESIS)


def _link(path, what):
    beside = path.parents[len(path.relative_to(_store_of(path)).parts)] / "beside"
    beside.mkdir(exist_ok=True)
    target = beside / path.name
    if what == "sound":
        shutil.move(path, target)
    else:
        path.unlink()
        if what == "thesis":
            target.write_text(THESIS)
    path.symlink_to(target)


def _store_of(path):
    return next(p for p in path.parents if p.name == "store")


ON_FILES = {
    "deleted": lambda p: p.unlink(),
    "emptied": lambda p: p.write_bytes(b""),
    "halved": lambda p: p.write_bytes(p.read_bytes()[: p.stat().st_size // 2]),
    "one byte short": lambda p: p.write_bytes(p.read_bytes()[:-1]),
    "longer": lambda p: p.write_bytes(p.read_bytes() + b"\n{}"),
    "first byte": lambda p: _flip(p, 0.0),
    "middle byte": lambda p: _flip(p, 0.5, 1),
    "byte at a third": lambda p: _flip(p, 0.33, 2),
    "byte at four fifths": lambda p: _flip(p, 0.8, 64),
    "last byte": lambda p: _flip(p, 1.0, 128),
    "zeros": lambda p: p.write_bytes(bytes(p.stat().st_size)),
    "null": lambda p: p.write_text("null"),
    "number": lambda p: p.write_text("3"),
    "list": lambda p: p.write_text("[{}]"),
    "empty object": lambda p: p.write_text("{}"),
    "nested": lambda p: p.write_text("[" * 200_000),
    "nested objects": lambda p: p.write_text('{"grid":' * 100_000),
    "not text": lambda p: p.write_bytes(b"\xff\xfe\x00binary"),
    "folder": _folder,
    "folder with a thesis": lambda p: _folder(p, thesis=True),
    "dangling link": lambda p: _link(p, "dangling"),
    "link to a thesis": lambda p: _link(p, "thesis"),
    "link to the sound file": lambda p: _link(p, "sound"),
    "link to itself": lambda p: (p.unlink(), p.symlink_to(p)),
    "read only": lambda p: p.chmod(0o444),
    "forbidden": lambda p: p.chmod(0),
}


def _foreign(path, other):
    """The folder of another sweep in this one's place."""
    shutil.rmtree(path)
    shutil.copytree(other, path)


def _folder_link(path, target):
    shutil.rmtree(path)
    path.symlink_to(target)


ON_FOLDERS = {
    "deleted": lambda p, other: shutil.rmtree(p),
    "emptied": lambda p, other: (shutil.rmtree(p), p.mkdir()),
    "file": lambda p, other: (shutil.rmtree(p), p.write_text(THESIS)),
    "another sweep's": _foreign,
    "link to another sweep's": _folder_link,
    "dangling link": lambda p, other: _folder_link(p, p.parent / "nowhere"),
    "link to itself": lambda p, other: _folder_link(p, p),
    "thesis inside": lambda p, other: (p / "thesis.tex").write_text(THESIS),
    "folder inside": lambda p, other: (p / "c9").mkdir(),
    "numbered file inside": lambda p, other: (p / "7").write_text(THESIS),
}


def _edit(store, file, *keys, value):
    path = store / file
    whole = json.loads(path.read_text())
    part = whole
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    path.write_text(json.dumps(whole, indent=1) + "\n")


def _drop(store, file, key):
    path = store / file
    whole = json.loads(path.read_text())
    del whole[key]
    path.write_text(json.dumps(whole, indent=1) + "\n")


def _exchange(store, one, other):
    for a, b in zip(one.split(), other.split(), strict=True):
        os.replace(store / a, store / "kept")
        os.replace(store / b, store / a)
        os.replace(store / "kept", store / b)


def _copied(store, source, *files):
    for file in files:
        if (source / file).is_dir():
            _foreign(store / file, source / file)
        else:
            shutil.copy(source / file, store / file)


def _array_more(store):
    shutil.copytree(store / "data.zarr" / "x", store / "data.zarr" / "y")


def _chunks(number):
    names = {"x": "0", "pair": "0/0", "code": "0"}
    return " ".join(f"data.zarr/{name}/c/{number}/{rest}" for name, rest in names.items())


EDITS = {
    "manifest without a seal": ("manifest.json", "seal"),
    "manifest without grid": ("manifest.json", "grid"),
    "manifest without files": ("manifest.json", "files"),
    "record without files": ("finished/000001.json", "files"),
    "record without block": ("finished/000001.json", "block"),
    "header without shape": ("data.zarr/x/zarr.json", "shape"),
}
VALUES = {
    "old format": ("manifest.json", "format", 1),
    "format of tomorrow": ("manifest.json", "format", 99),
    "format true": ("manifest.json", "format", True),
    "coordinates in other order": ("manifest.json", "coordinates", ["q", "k"]),
    "size in manifest": ("manifest.json", "grid", "k", "size", 2),
    "block in manifest": ("manifest.json", "block", [5, 2]),
    "program in manifest": ("manifest.json", "program", "0" * 64),
    "seed in manifest": ("manifest.json", "settings", "seed", 2),
    "units in manifest": ("manifest.json", "attributes", "array x", "units", "mm"),
    "no checksums in manifest": ("manifest.json", "files", {}),
    "seal null": ("manifest.json", "seal", None),
    "files outside": ("manifest.json", "files", {"../beside/thesis.tex": "0"}),
    "record of another block": ("finished/000001.json", "block", 2),
    "record of another sweep": ("finished/000001.json", "sweep", "0" * 64),
    "record of no file": ("finished/000001.json", "files", {}),
    "record with null": ("finished/000001.json", "files", "data.zarr/x/c/1/0", None),
    "byte order": ("data.zarr/x/zarr.json", "codecs", 0, "configuration", "endian", "big"),
    "type": ("data.zarr/x/zarr.json", "data_type", "int64"),
    "shape": ("data.zarr/x/zarr.json", "shape", [4, 2]),
    "fill value": ("data.zarr/x/zarr.json", "fill_value", 0.0),
    "units in header": ("data.zarr/x/zarr.json", "attributes", "units", "mm"),
    "dimension names": ("data.zarr/x/zarr.json", "dimension_names", ["q", "k"]),
    "scale in header": ("data.zarr/x/zarr.json", "attributes", "scale_factor", 2.0),
}
STRUCTURE = {
    "records exchanged": lambda s, o: _exchange(s, "finished/000000.json", "finished/000001.json"),
    "chunks exchanged": lambda s, o: _exchange(s, "data.zarr/x/c/0/0", "data.zarr/x/c/1/0"),
    "blocks exchanged with their records": lambda s, o: _exchange(
        s, f"{_chunks(0)} finished/000000.json", f"{_chunks(1)} finished/000001.json"
    ),
    "chunks of two variables exchanged": lambda s, o: _exchange(
        s, "data.zarr/x/c/0/0", "data.zarr/code/c/0/0"
    ),
    "variables exchanged": lambda s, o: _exchange(s, "data.zarr/x", "data.zarr/code"),
    "coordinates exchanged": lambda s, o: _exchange(s, "data.zarr/k", "data.zarr/q"),
    "coordinate chunks exchanged": lambda s, o: _exchange(s, "data.zarr/k/c/0", "data.zarr/q/c/0"),
    "headers exchanged": lambda s, o: _exchange(s, "data.zarr/x/zarr.json", "data.zarr/code/zarr.json"),
    "another sweep's manifest": lambda s, o: _copied(s, o, "manifest.json"),
    "another sweep's data and records": lambda s, o: _copied(s, o, "data.zarr", "finished"),
    "another sweep's block": lambda s, o: _copied(s, o, *_chunks(1).split(), "finished/000001.json"),
    "an array more": lambda s, o: _array_more(s),
    "a broken array more": lambda s, o: (_array_more(s), (s / "data.zarr/y/zarr.json").write_text("{")),
    "a thesis beside": lambda s, o: (s / "thesis.tex").write_text(THESIS),
    "a system's file beside": lambda s, o: (s / ".DS_Store").write_bytes(b"\x00\x01"),
    "a system's file among records": lambda s, o: (s / "finished/.nfs01").write_bytes(b"\x00\x01"),
    "a record more": lambda s, o: (s / "finished/000099.json").write_text("{}"),
    "a half-written manifest": lambda s, o: (s / "manifest.json.part").write_text('{"format'),
    "a half-written record": lambda s, o: (s / "finished/000001.json.part").write_text("{"),
    "a half-written chunk": lambda s, o: (s / "data.zarr/x/c/1/0.0a1b.partial").write_bytes(b"\x01"),
    "a folder for a half-written manifest": lambda s, o: (s / "manifest.json.part").mkdir(),
    "a folder for a half-written record": lambda s, o: (
        (s / "finished/000001.json").unlink(), (s / "finished/000001.json.part").mkdir()
    ),
    "a thesis for a manifest": lambda s, o: (s / "manifest.json").write_text(THESIS),
    "all records lost": lambda s, o: [p.unlink() for p in (s / "finished").iterdir()],
    "manifest and lock lost": lambda s, o: ((s / "manifest.json").unlink(), (s / "lock").unlink()),
    "manifest and records lost": lambda s, o: (
        (s / "manifest.json").unlink(), shutil.rmtree(s / "finished")
    ),
    "lock and records lost": lambda s, o: ((s / "lock").unlink(), shutil.rmtree(s / "finished")),
    "manifest lost, thesis among records": lambda s, o: (
        (s / "manifest.json").unlink(), (s / "finished/thesis.tex").write_text(THESIS)
    ),
    "manifest null, thesis among records": lambda s, o: (
        (s / "manifest.json").write_text("null"), (s / "finished/000007.json").write_text(THESIS)
    ),
    "everything lost": lambda s, o: (shutil.rmtree(s), s.mkdir()),
    "all but the lock lost": lambda s, o: (
        shutil.rmtree(s / "data.zarr"), shutil.rmtree(s / "finished"), (s / "manifest.json").unlink(),
        (s / "runs.jsonl").unlink(),
    ),
}  # fmt: skip


def kinds():
    """Every kind of damage as a function of the store and of another sweep's store, by name."""
    every = {}
    for sort, file in FILES.items():
        for name, damage in ON_FILES.items():
            every[f"{sort}: {name}"] = lambda s, o, damage=damage, file=file: damage(s / file)
    for folder in FOLDERS:
        for name, damage in ON_FOLDERS.items():
            every[f"{folder}: {name}"] = lambda s, o, damage=damage, folder=folder: damage(
                s / folder, o / folder
            )
    for name, (file, key) in EDITS.items():
        every[name] = functools.partial(lambda s, o, file, key: _drop(s, file, key), file=file, key=key)
    for name, (file, *keys, value) in VALUES.items():
        every[name] = lambda s, o, file=file, keys=keys, value=value: _edit(s, file, *keys, value=value)
    return every | STRUCTURE


def theses(top: pathlib.Path) -> list[str]:
    """The user's own files below a directory, as far as they are whole, set aside or not."""
    return sorted(
        str(p.relative_to(top)).removesuffix(".damaged")
        for p in top.rglob("*")
        if not p.is_symlink() and p.is_file() and p.read_bytes() == THESIS.encode()
    )
