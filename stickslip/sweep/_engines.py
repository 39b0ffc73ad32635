"""Workers started by an engine of the user's: Dask, submitit, or a pool of the standard library."""

import inspect
import os
from typing import Any

from .._paths import the_directory
from .._types import Given, Path
from .._validation import check_count, check_flag, one_static, refusal
from ._claims import EXPIRY
from ._many import planned, work_on


def work_with(
    client: Given[Any],
    store: Path,
    *,
    tasks: Given[int],
    seconds: float | None = None,
    wait: Given[bool] = True,
    expiry: float = EXPIRY,
) -> dict[str, int]:
    """Compute what is left of a planned sweep by `tasks` workers that `client` starts.

    The engine only starts processes and looks after them; what is claimed and finished stands in the
    store. So tasks may be started again, come late or be lost, and other workers may help.

    **Arguments**

    - `client`: with a method `submit(function, ...)` that returns a future: a `Client` of Dask
      distributed, an executor of submitit, or a `ProcessPoolExecutor` of the context `"spawn"`. A pool
      that forks hangs: JAX has threads.
    - `store`: made by `plan_sweep`, at a path that the client's processes see too.
    - `tasks`: number of workers, each with one thread.
    - `seconds`, `wait`, `expiry`: as for `work_on`.

    **Returns** how many units were `computed`, and how many are `left`.

    **Errors** `TypeError` if the client has no `submit`; else as `work_on`, and what the engine raises.
    """
    submit: Any = getattr(client, "submit", None)
    if not callable(submit):
        raise refusal("client", client, "one with a method `submit`, as a Client of Dask", TypeError)
    path = the_directory("store", store)
    check_count("tasks", tasks, 1)
    if seconds is not None:
        one_static("seconds", seconds, "positive")
    check_flag("wait", wait)
    one_static("expiry", expiry, "positive")
    planned(path)
    # Dask takes calls that look alike for one, and would run them once.
    engine = {"pure": False} if "pure" in inspect.signature(submit).parameters else {}
    options = {"seconds": seconds, "wait": wait, "expiry": expiry, "progress": False}
    futures: list[Any] = [
        submit(work_on, os.path.abspath(path), **options, **engine) for _ in range(tasks)
    ]
    found = [future.result() for future in futures]
    return {"computed": sum(f["computed"] for f in found), "left": min(f["left"] for f in found)}
