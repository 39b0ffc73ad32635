"""Programs and CPU seconds of each test file: printed after a run, and held to `budget.toml`.

A program is what XLA compiles, or reads from a cache; their number does not depend on the load of the
machine, and is what most of the suite's time goes into. Seconds are only shown.
"""

import time
import tomllib
from collections import defaultdict
from pathlib import Path

import jax
import jax.monitoring
import pytest

TABLE = Path(__file__).parent / "budget.toml"
SHOWN = 60
QUICK = "not slow and not more"


def _children_and_self() -> float:
    """CPU seconds of this process and of the children it has waited for."""
    used = time.process_time()
    try:
        import resource
    except ImportError:  # not on Windows
        return used
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used + children.ru_utime + children.ru_stime


class Budget:
    """A plugin of pytest; with xdist each worker measures and the controller adds up."""

    def __init__(self, config: pytest.Config):
        self.config = config
        table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
        self.limits, self.otherwise = table["files"], table["otherwise"]
        self.programs = 0
        self.seen = (0, _children_and_self())
        self.files: dict[str, list[float]] = defaultdict(lambda: [0, 0.0])
        jax.monitoring.register_event_duration_secs_listener(self._hear)

    def _hear(self, event, seconds, **_):
        self.programs += event.endswith("backend_compile_duration")

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_makereport(self):
        report = (yield).get_result()
        now = (self.programs, _children_and_self())
        report.cost = [b - a for a, b in zip(self.seen, now, strict=True)]
        self.seen = now

    def pytest_runtest_logreport(self, report):
        path = report.nodeid.split("::")[0]
        for i, amount in enumerate(getattr(report, "cost", ())):
            self.files[path][i] += amount

    def _limit(self, path: str) -> int:
        return self.limits.get(path, self.otherwise)

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        if hasattr(self.config, "workerinput"):  # the longest files first, so that none ends alone
            items.sort(key=lambda item: -self._limit(item.nodeid.split("::")[0]))

    def above(self) -> dict[str, tuple[int, int]]:
        """Files of the quick suite that need more programs than they may, with both numbers."""
        # The numbers are those of one JAX: others make more programs of the same tests.
        if self.config.option.markexpr != QUICK or jax.version.__version_info__ >= (0, 11):
            return {}
        return {
            path: (int(used[0]), self._limit(path))
            for path, used in self.files.items()
            if used[0] > self._limit(path)
        }

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session):
        if not hasattr(self.config, "workerinput") and self.above() and session.exitstatus == 0:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter):
        write = terminalreporter.write_line
        programs, seconds = (sum(used[i] for used in self.files.values()) for i in (0, 1))
        write(f"{programs} programs, {seconds:.0f} CPU s in {len(self.files)} files; most:")
        most = sorted(self.files.items(), key=lambda item: -item[1][1])
        for path, (count, cpu) in most[:SHOWN]:
            write(f"{count:6} {cpu:8.1f} s  {path}")
        for path, (count, limit) in self.above().items():
            write(
                f"ABOVE ITS NUMBER: {path} needs {count} programs, {TABLE.name} allows {limit}",
                red=True,
            )
