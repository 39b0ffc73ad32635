"""Strict mode for every test: 64 bit, no silent promotion, warnings are errors.

`make test-all` also checks shape and type annotations of both packages at call time, by the import
hook that its option installs before this file is read.
"""

import gc
import importlib
import os
import zlib

import hypothesis
import jax
import jax.monitoring
import matplotlib
import pytest

from tests._budget import Budget
from tests._compiler import xla_flags

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")

matplotlib.use("agg")

MOST_MAPS = 20_000

# The same examples on every run, and no deadline: the first call of a jitted function compiles.
hypothesis.settings.register_profile("reproducible", derandomize=True, deadline=None)
hypothesis.settings.load_profile("reproducible")


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "of the tests marked `more` those in a share of the files alone: 2/5 is the second fifth"
    parser.addoption("--share", default="1/1", metavar="I/N", help=text)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the `more` tests of other shares; which share a file is in follows from its name."""
    part, parts = map(int, config.getoption("share").split("/"))

    def is_in(item: pytest.Item) -> bool:
        file = zlib.crc32(item.nodeid.split("::")[0].encode())
        return item.get_closest_marker("more") is None or file % parts == part - 1

    left_out = [item for item in items if not is_in(item)]
    config.hook.pytest_deselected(items=left_out)
    items[:] = filter(is_in, items)


def pytest_configure(config: pytest.Config) -> None:
    """Two host devices on any machine; programs compiled cheaply, or kept between runs.

    XLA reads its flags when the first array is made, which is later. Most of the quick suite's time is
    compilation of programs that run once. `make test-all` compiles as users do, and so do the quick
    tests that run the programs users start with in a process of their own.

    Programs with host callbacks, diffrax's own loop among them, are never kept by JAX. Processes that
    the tests start keep theirs in the same directory, which git ignores, and not in the home directory.
    """
    config.pluginmanager.register(Budget(config), "budget")
    flags, quick = ["--xla_force_host_platform_device_count=2"], "not slow" in config.option.markexpr
    if quick:
        jax.config.update("jax_disable_most_optimizations", True)
        jax.config.update("jax_traceback_in_locations_limit", 0)  # no line of source for each operation
        flags += xla_flags()
    # Tracing makes millions of small objects that live on; to look through them all again and again
    # takes a sixth of its time.
    gc.set_threshold(100_000, 20, 100)
    os.environ["STICKSLIP_PROGRESS"] = "off"
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # of a worker, which has one core, for NumPy and SciPy too
    os.environ["XLA_FLAGS"] = " ".join([os.environ.get("XLA_FLAGS", ""), *flags])
    if getattr(config, "cache", None) is not None:  # absent with `-p no:cacheprovider`
        os.environ["STICKSLIP_CACHE"] = str(config.cache.mkdir("programs"))
        if not quick:  # to write what is compiled cheaply takes up to a fifth of the time
            # Only now: the import hook and JAX's settings are in place.
            importlib.import_module("stickslip").enable_compilation_cache()


@pytest.fixture(autouse=True, scope="module")
def room_for_programs():
    """Compiled programs are dropped after a file that leaves a third of the maps of memory that may be.

    Every program takes some twenty; where there is no room for one more, 65,530 on Linux, XLA ends the
    process by a segmentation fault. A worker of the suite would come to that, and to 10 GB, at two
    thirds of it. Files share few programs.
    """
    yield
    if memory_maps() > MOST_MAPS:
        jax.clear_caches()
        gc.collect()


def memory_maps() -> int:
    """Maps of memory that this process has; 0 where the system does not say."""
    try:
        with open("/proc/self/maps", "rb") as lines:
            return sum(1 for _ in lines)
    except OSError:
        return 0


@pytest.fixture
def standard_dtype_promotion():
    """For tests that call optax, which adds its integer step count to floats."""
    with jax.numpy_dtype_promotion("standard"):
        yield


@pytest.fixture
def compiled():
    """A list that grows by one entry with every program that is compiled or read from a cache."""
    events: list[str] = []

    def hear(event, seconds, **_):
        if event.endswith("backend_compile_duration"):
            events.append(event)

    jax.monitoring.register_event_duration_secs_listener(hear)
    yield events
    jax.monitoring.unregister_event_duration_listener(hear)
