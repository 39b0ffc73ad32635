"""Identity of a sweep: everything that decides its numbers, as JSON, and how two of them differ."""

import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import math
import pathlib
import platform
import subprocess
from collections.abc import Mapping, Sequence
from typing import Any

import diffrax
import equinox as eqx
import jax
import numpy as np
import xarray as xr
import zarr

from .. import _version

FORMAT = 3
BEFORE_SHARDS = 2  # the same, but for shards and for sizes in the records: such stores are gone on with
LONGEST_LIST = 64


def as_json(value: Any) -> Any:
    """`value` in JSON's terms: modules and dataclasses by field, arrays by value or digest.

    Functions are named only: what they compute is in the digest of the compiled program.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, np.generic):
        return as_json(value.item())
    if isinstance(value, np.ndarray | jax.Array):
        array = np.asarray(value)
        if array.size <= LONGEST_LIST:
            return as_json(array.tolist())
        return {"shape": list(array.shape), "dtype": str(array.dtype), "sha256": digest(array)}
    if isinstance(value, Mapping):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        fields: Any = value
        return {name: as_json(getattr(value, name)) for name in fields._fields}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: as_json(getattr(value, f.name, None)) for f in dataclasses.fields(value)}
        return {"class": type(value).__qualname__, **fields}
    if isinstance(value, Sequence | set | frozenset | range):
        return [as_json(item) for item in value]
    if callable(value):
        return getattr(value, "__qualname__", type(value).__qualname__)
    return str(value)


def digest(*values: Any) -> str:
    """SHA-256 over dtype, shape and bytes of arrays, and over texts."""
    total = hashlib.sha256()
    for value in values:
        if isinstance(value, str):
            total.update(b"text" + value.encode())
        else:
            array = np.ascontiguousarray(value)
            total.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
    return total.hexdigest()


@functools.cache
def code_revision() -> str | None:
    """Commit of the checkout this package runs from, with `+changes` if files differ from it.

    `None` for an installed copy: a repository that merely contains the environment is not ours.
    """
    here = pathlib.Path(_version.__file__).parent

    def git(*command: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(here), *command], capture_output=True, text=True, timeout=20, check=True
        )
        return done.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", "_version.py")
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "HEAD") + ("+changes" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None


def versions() -> dict[str, str]:
    """Versions of what the numbers go through."""
    return {
        "stickslip": _version.__version__,
        "python": platform.python_version(),
        "jax": jax.__version__,
        "jaxlib": importlib.metadata.version("jaxlib"),
        "diffrax": diffrax.__version__,
        "equinox": eqx.__version__,
        "numpy": np.__version__,
        "xarray": xr.__version__,
        "zarr": zarr.__version__,
    }


# Recorded, yet free to differ when a sweep is resumed: they do not reach the numbers, or do so only
# through the compiled program, which has a digest of its own.
FREE = ("information", "attributes", "files", "seal", "reference")  # the last: of earlier versions


def with_checksum(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest, or a record, with a checksum of itself, by which an alteration is found."""
    plain = {key: value for key, value in manifest.items() if key != "seal"}
    return {**plain, "seal": digest(json.dumps(plain, sort_keys=True))}


def free(manifest: Mapping[str, Any]) -> tuple[str, ...]:
    """Parts that may differ between two manifests of the same sweep."""
    return (*FREE, "computed_with") if manifest.get("hosts") == "any" else FREE


def identity(manifest: Mapping[str, Any]) -> str:
    """Digest of what decides the numbers."""
    deciding = {key: value for key, value in manifest.items() if key not in free(manifest)}
    return digest(json.dumps(deciding, sort_keys=True))


def as_stored(manifest: dict[str, Any], stored: Any) -> dict[str, Any]:
    """The manifest as the version that made the store would have written it, where it could."""
    if stored.get("format") != BEFORE_SHARDS or manifest["shard"] != manifest["block"]:
        return manifest
    return {
        **{key: value for key, value in manifest.items() if key != "shard"}, "format": BEFORE_SHARDS
    }  # fmt: skip


def is_manifest(value: Any) -> bool:
    """Whether this is the manifest of a sweep of any format, altered or not."""
    return (
        isinstance(value, dict)
        and isinstance(value.get("format"), int)
        and {"grid", "block", "outputs", "program"} <= set(value)
    )


def fault_of(value: Any) -> str | None:
    """Why a manifest cannot be relied on; `None` if it can."""
    if not is_manifest(value):
        return "has a manifest.json that is not of a sweep"
    if value["format"] is True or value["format"] not in (BEFORE_SHARDS, FORMAT):
        by = value.get("information")
        by = by.get("versions") if isinstance(by, dict) else None
        by = by.get("stickslip") if isinstance(by, dict) else None
        made = f", made by stickslip {by}" if isinstance(by, str) else ""
        return f"is of format {value['format']}{made}, and this stickslip goes on with format {FORMAT}"
    try:
        if with_checksum(value).get("seal") == value.get("seal"):
            return None
    except RecursionError:
        pass
    return "has a manifest.json that was altered"


def differences(stored: Any, wanted: Any, path: str = "") -> list[str]:
    """Each place where two manifests differ, in words."""
    if isinstance(stored, dict) and isinstance(wanted, dict):
        found = []
        for key in [*stored, *(k for k in wanted if k not in stored)]:
            if not path and key in free(stored):
                continue
            name = f"{path}.{key}" if path else key
            if key not in stored:
                found.append(f"{name} is new here ({_as_text(wanted[key])})")
            elif key not in wanted:
                found.append(f"{name} = {_as_text(stored[key])} is in the store only")
            else:
                found += differences(stored[key], wanted[key], name)
        return found
    if stored != wanted:
        return [f"{path} is {_as_text(stored)} in the store, {_as_text(wanted)} now"]
    return []


def _as_text(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 70 else text[:67] + "..."
