"""Sweeps by many workers: a store that says which function makes it, and work on what is left."""

import pathlib
from collections.abc import Callable
from typing import Any

from .._paths import the_directory
from .._types import Given, Path
from .._validation import check_callable, check_count, check_flag, check_type, one_static, refusal
from ._claims import EXPIRY
from ._duty import Duty, on_duty
from ._files import read_json
from ._manifest import fault
from ._pool import run_processes
from ._reference import function_of, reference_to
from ._store import Store
from ._work import Worker
from .evaluate import Evaluate
from .grid import Block

_PLAN = "`python -m stickslip plan MODULE:FUNCTION STORE` writes that into it"


def plan_sweep(
    function: Given[Callable[..., Any]], store: Path, /, **parameters: Any
) -> dict[str, int]:
    """Make the store of a sweep that any number of processes on any hosts then compute.

    ```python
    # study.py
    def sweep(store, points=1000):
        return run_sweep(lane, {"k3": numpy.linspace(72.0, 97.0, points)}, store=store)
    ```

    `plan_sweep(study.sweep, "results/end", points=5000)`, or in a shell
    `python -m stickslip plan study:sweep results/end --set points=5000`, makes the store without
    computing a lane. Then `work_on`, or `python -m stickslip work results/end`, wherever the store and
    the module are seen.

    **Arguments**

    - `function(store=..., **parameters)`: calls `run_sweep`, `orbit_diagram`, `lyapunov_diagram` or
      what else sweeps into `store`. Its module and name go into the manifest, so it must stand at the
      top level of a module: not a lambda, nor in the script that is run. What it does after the sweep
      is left out.
    - `store`: directory of results, made if absent. If it holds this very sweep, finished in part or
      not, it keeps what is there.
    - `parameters`: numbers, texts, flags, lists and mappings, as JSON has them.

    **Returns** the number of `lanes`, and of `units`: what one worker computes at a time, a block or a
    shard of `run_sweep`.

    **Errors** `ValueError` for a function that another process would not find or that makes no sweep in
    the store, `TypeError` for a parameter that JSON does not have; `SweepMismatchError` if the store
    holds another sweep.
    """
    check_callable("function", function, "f(store, **parameters)", store, **parameters)
    path = the_directory("store", store)
    reference = reference_to(function, parameters)
    return _called(function, path, parameters, _Plan(reference))


def work_on(
    store: Path,
    *,
    processes: Given[int | None] = None,
    seconds: float | None = None,
    wait: Given[bool] = True,
    expiry: float = EXPIRY,
    progress: bool | None = None,
) -> dict[str, int]:
    """Compute what is left of a planned sweep, beside any others who do the same.

    A worker claims a unit, computes it with one thread, writes it and gives the claim back. Workers may
    come, go and be killed at any time: a claim that nobody touches expires, and the unit is computed
    by another. The results are those of a single worker, bit for bit on equal processors.

    **Arguments**

    - `store`: made by `plan_sweep`.
    - `processes`: so many workers on this host, each a new Python process; by default this process is
      the only one.
    - `seconds`: no unit is begun that would not end within this time, as far as those before show.
    - `wait`: until the units of other workers are finished too, to compute those whose worker dies.
    - `expiry`: seconds after which a claim of this worker that was not touched is another's. Longer
      than a network file system may show old times.
    - `progress`: as for `run_sweep`.

    **Returns** how many units were `computed`, and how many are `left` to others or to a later call.

    **Errors** `ValueError` if the store does not say which function makes it; `SweepMismatchError` (a
    `ValueError`) if that function, or this host, makes another sweep: the message names each
    difference; `SweepWriteError` (an `OSError`) on a full disk, where finished units are kept.
    `RuntimeError` if one of several `processes` fails.
    """
    path = the_directory("store", store)
    if processes is not None:
        check_count("processes", processes, 1)
    if seconds is not None:
        one_static("seconds", seconds, "positive")
    check_flag("wait", wait)
    one_static("expiry", expiry, "positive")
    check_type("progress", progress, bool | None, "True, False or None")
    function, parameters = planned(path)
    if processes is not None:
        return run_processes(path, processes, seconds, wait, expiry, progress)
    worker = Worker(expiry=expiry, seconds=seconds, wait=wait, progress=progress, threads=1)
    return _called(function, path, parameters, worker)


def planned(path: pathlib.Path) -> tuple[Callable[..., Any], dict[str, Any]]:
    """The function that makes a store, and its parameters; `ValueError` if the store does not say."""
    begin = f"store = {str(path)!r}"
    try:
        manifest = read_json(path / "manifest.json")
    except (FileNotFoundError, NotADirectoryError):
        raise refusal("store", str(path), "the directory of a sweep's store") from None
    except ValueError as error:
        raise ValueError(f"{begin} has an unreadable manifest.json ({error}).") from None
    why = fault(manifest)
    if why is not None:
        raise ValueError(f"{begin} {why}: it must be as plan_sweep made it.")
    reference = manifest.get("reference")
    if not isinstance(reference, dict):
        raise ValueError(
            f"{begin} does not say which function makes it: it must name one at the top level of a "
            f"module, and {_PLAN}, also where the sweep has begun."
        )
    return function_of(reference["function"], "function of the store"), reference["parameters"]


class _Plan:
    """Duty of who only makes the store."""

    mark = ""
    threads: int | None = None

    def __init__(self, reference: dict[str, Any]):
        self.reference = reference

    def do(self, store: Store, evaluate: Evaluate, units: list[Block]) -> dict[str, int]:
        if store.manifest["host_code"]:
            raise refusal(
                "function", ", ".join(store.manifest["host_code"]),
                "one without calls of the host, whose code has no digest to compare",
            )  # fmt: skip
        store.manifest["reference"] = self.reference
        with store:
            store.open(resume=True)
        return {"lanes": sum(unit.lanes for unit in units), "units": len(units)}

    def goes_on(self, found: Any) -> bool:
        return False  # what follows is planned by whoever finishes this


def _called(function, path: pathlib.Path, parameters, duty: Duty) -> Any:
    with on_duty(path, duty) as found:
        function(store=path, **parameters)
    if not found:
        raise refusal("function", function, f"one that sweeps into its `store`, {str(path)!r}")
    return found[0]
