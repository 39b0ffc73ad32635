"""Many lanes at once, on all cores, in pieces that survive an interruption."""

import importlib
from typing import TYPE_CHECKING, Any

from .lanes import map_lanes as map_lanes

# xarray and zarr take longer to import than the rest of the package: they come with the first sweep.
if TYPE_CHECKING:
    from ._labels import Labels as Labels
    from ._labels import Variable as Variable
    from ._manifest import as_json as as_json
    from ._manifest import code_revision as code_revision
    from ._manifest import versions as versions
    from ._open import open_dataset as open_dataset
    from ._refine import refine_sweep as refine_sweep
    from ._run import run_sweep as run_sweep
    from ._status import sweep_status as sweep_status
    from ._store import SweepMismatchError as SweepMismatchError
    from ._store import SweepWriteError as SweepWriteError
    from ._verify import verify_store as verify_store
    from .settings import Carried as Carried
    from .settings import Compute as Compute
    from .settings import Storage as Storage

_LATER = {
    "run_sweep": "_run",
    "refine_sweep": "_refine",
    "Storage": "settings",
    "Compute": "settings",
    "Labels": "_labels",
    "Variable": "_labels",
    "Carried": "settings",
    "SweepMismatchError": "_store",
    "SweepWriteError": "_store",
    "open_dataset": "_open",
    "sweep_status": "_status",
    "verify_store": "_verify",
    "as_json": "_manifest",
    "code_revision": "_manifest",
    "versions": "_manifest",
}
__all__ = ["map_lanes", *_LATER]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    thing = getattr(importlib.import_module(f".{_LATER[name]}", __name__), name)
    globals()[name] = thing
    return thing


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATER})
