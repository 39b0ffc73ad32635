"""Names, shapes and labels of what a sweep computes, and the files that hold them in a store."""

import dataclasses
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import zarr
from zarr.storage import MemoryStore

from ._labels import Variable
from ._manifest import as_json
from .grid import Block, blocks

DATA = "data.zarr"
FINISHED = "finished"
REFINE = "refine"
_FILL = {"f": np.nan, "c": np.nan, "i": -1, "u": 0, "b": False}


def _fill(dtype: np.dtype, attributes: Mapping[str, Any]) -> Any:
    """The value that stands where nothing is computed: of a code, none that has a meaning."""
    usual, taken = _FILL[dtype.kind], np.ravel(attributes.get("flag_values", []))
    if dtype.kind not in "iu" or usual not in taken:
        return usual
    return int(min(taken)) - 1 if dtype.kind == "i" else int(max(taken)) + 1


@dataclasses.dataclass(frozen=True)
class Layout:
    """Names, shapes and labels of everything in the store."""

    coords: Mapping[str, np.ndarray]
    outputs: Mapping[str, tuple[tuple[int, ...], np.dtype, Variable]]
    sides: tuple[int, ...]
    shard: tuple[int, ...]
    labels: Mapping[str, Variable]
    attrs: Mapping[str, Any]
    refine: Mapping[str, Any] | None = None  # what further points follow from the results, if any

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(values.size for values in self.coords.values())

    def dims(self, name: str) -> tuple[str, ...]:
        return (*self.coords, *self.outputs[name][2].dims)

    def attributes(self) -> dict[str, Any]:
        """Attributes of the dataset and of each array, in JSON's terms; they reach no number."""
        labels = {name: self.labels.get(name, Variable()) for name in self.coords}
        labels |= {name: label for name, (_, _, label) in self.outputs.items()}
        return {
            "dataset": as_json(self.attrs),
            **{f"array {name}": as_json(label.attributes()) for name, label in labels.items()},
            **({} if self.refine is None else {REFINE: as_json(self.refine)}),
        }

    def skeleton(self, attributes: Mapping[str, Any]) -> dict[str, bytes]:
        """Files of a store in which no block is finished: headers and coordinates, by their path."""
        files = self._made(attributes)
        return {f"{DATA}/{key}": buffer.to_bytes() for key, buffer in files.items()}

    def _made(self, attributes: Mapping[str, Any]) -> Any:
        files: Any = {}
        # Without this a chunk that equals the fill value is not a file, and could not have a checksum.
        with zarr.config.set({"array.write_empty_chunks": True}):
            group = zarr.create_group(
                MemoryStore(files), attributes=attributes["dataset"], zarr_format=3
            )
            for name, values in self.coords.items():
                group.create_array(
                    name, data=values, dimension_names=(name,), attributes=attributes[f"array {name}"]
                )
            for name, (tail, dtype, _) in self.outputs.items():
                whole = tuple(max(n, 1) for n in tail)
                group.create_array(
                    name,
                    shape=(*self.shape, *tail),
                    chunks=(*self.sides, *whole),
                    shards=None if self.shard == self.sides else (*self.shard, *whole),
                    dtype=dtype,
                    fill_value=_fill(dtype, attributes[f"array {name}"]),
                    dimension_names=self.dims(name),
                    attributes=attributes[f"array {name}"],
                )
        return files

    def encoder(self) -> "Encoder":
        """Maker of the files of one unit after another."""
        return Encoder(self._made(self.attributes()), self)


class Encoder:
    """Makes the bytes of a unit's files in memory, so that they reach the disk whole or not at all."""

    def __init__(self, files: Any, layout: Layout):
        self._files, self._outputs = files, layout.outputs
        group = zarr.open_group(MemoryStore(files), mode="r+")
        with zarr.config.set({"array.write_empty_chunks": True}):
            self._arrays: Any = {name: group[name] for name in layout.outputs}
        self._headers = {key for key in files if key.endswith("zarr.json")}
        self._clear()

    def _clear(self) -> None:
        for key in set(self._files) - self._headers:
            del self._files[key]

    def __call__(self, unit: Block, values: Mapping[str, np.ndarray]) -> dict[str, bytes]:
        """Files of a unit of which all `values` are known, by their path in the store."""
        try:
            for name, array in self._arrays.items():
                array[unit.region] = values[name]
            return {
                path: self._files[path.removeprefix(f"{DATA}/")].to_bytes()
                for name, (tail, _, _) in self._outputs.items()
                for path in [chunk_file(name, unit.place, len(tail))]
            }
        finally:
            self._clear()


def chunk_file(name: str, place: tuple[int, ...], tail: int) -> str:
    """Path of the file that holds a unit of a variable whose lanes have `tail` axes of their own."""
    return "/".join([DATA, name, "c", *(str(i) for i in (*place, *(0,) * tail))])


def record_file(number: int) -> str:
    """Path of the record that vouches for a unit."""
    return f"{FINISHED}/{number:06d}.json"


class Files:
    """Names of the files of a store, by its manifest alone."""

    def __init__(self, manifest: Mapping[str, Any]):
        grid = manifest["grid"]
        self.coords = list(manifest.get("coordinates", grid))  # format 1 had none
        self.shape = [grid[name]["size"] for name in self.coords]
        self.sides = manifest.get("shard", manifest["block"])  # formats 1 and 2 had no shards
        self.counts = [-(-n // side) for n, side in zip(self.shape, self.sides, strict=True)]
        self.total = math.prod(self.counts)
        self.tails = {name: len(output["shape"]) for name, output in manifest["outputs"].items()}

    def blocks(self) -> Iterator[tuple[int, list[str]]]:
        """Number of each unit, a block or a shard of blocks, and its files."""
        for block in blocks(self.shape, self.sides):
            yield (
                block.number,
                [chunk_file(name, block.place, tail) for name, tail in self.tails.items()],
            )

    def has(self, path: str) -> bool:
        """Whether a path relative to the store is that of one of its files, half-written or not."""
        path = re.sub(r"\.(([0-9a-f]+\.)?part|[0-9a-f]+\.partial)$", "", path)
        top, *rest = path.split("/")
        if top == "finished":
            number = re.fullmatch(r"finished/(\d{6,})\.json", path)
            return number is not None and int(number[1]) < self.total
        if top != DATA:
            return False
        if rest == ["zarr.json"]:
            return True
        name, *rest = rest
        if name in self.coords:
            return rest == ["zarr.json"] or re.fullmatch(r"c/\d+", "/".join(rest)) is not None
        if name not in self.tails or rest == ["zarr.json"]:
            return name in self.tails
        most = [*self.counts, *(1,) * self.tails[name]]
        if rest[:1] != ["c"] or len(rest) != 1 + len(most) or not all(map(str.isdecimal, rest[1:])):
            return False
        return all(int(i) < n for i, n in zip(rest[1:], most, strict=True))
