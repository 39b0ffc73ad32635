"""Verdicts of the trial of the fused executor: kept if they are verdicts, and read strictly."""

import concurrent.futures
import json
import subprocess
import threading
import time
import warnings

import jax
import pytest

import stickslip as ss
from stickslip.sweep import _canary, _shift


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, no wish in the environment, and a compiler that shifts rightly."""
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path))
    monkeypatch.delenv("STICKSLIP_EXECUTOR", raising=False)
    monkeypatch.setattr(_shift, "shift_is_right", lambda: True)
    _canary._trial_succeeds.cache_clear()
    yield tmp_path
    _canary._trial_succeeds.cache_clear()


def tried(monkeypatch, verdict):
    """How often the trial runs if it says `verdict`, in three processes, and what they are told."""
    runs = []

    def trial(timeout):
        runs.append(timeout)
        return verdict

    monkeypatch.setattr(_canary, "run_trial", trial)
    answers = []
    for _ in range(3):
        _canary._trial_succeeds.cache_clear()
        answers.append(_canary.fused_is_trusted())
    return len(runs), answers


@pytest.mark.parametrize("verdict", [True, False])
def test_a_verdict_is_kept(verdict, cache, monkeypatch):
    assert tried(monkeypatch, verdict) == (1, [verdict] * 3)
    assert json.loads(_canary._cache_file().read_text())["trusted"] is verdict


def test_a_compiler_that_shifts_wrongly_is_named_once(cache, monkeypatch):
    monkeypatch.setattr(_shift, "shift_is_right", lambda: False)
    with pytest.warns(RuntimeWarning, match=r"b\.at\[1:\]\.set.* write jnp\.roll or jnp\.conc") as said:
        assert tried(monkeypatch, True) == (1, [True] * 3)
    assert len(said) == 1


def test_a_warning_made_an_error_leaves_the_verdict(cache, monkeypatch):
    monkeypatch.setattr(_shift, "shift_is_right", lambda: False)
    with warnings.catch_warnings(action="error"), pytest.raises(RuntimeWarning, match="issue 49176"):
        tried(monkeypatch, True)
    assert tried(monkeypatch, True) == (0, [True] * 3)


def test_the_shift_is_tried_in_the_middle_of_a_trace():
    """Whoever builds `map_lanes` while tracing gets an answer, not a tracer."""
    answers = []
    jax.jit(lambda x: answers.append(_shift.shift_is_right()) or x)(1.0)
    assert answers == [_shift.shift_is_right()]


def test_a_trial_without_end_is_no_verdict(cache, monkeypatch):
    with pytest.warns(RuntimeWarning, match="the portable one, the next tries again"):
        assert tried(monkeypatch, None) == (3, [False] * 3)
    assert not _canary._cache_file().exists()


@pytest.mark.parametrize(
    ("end", "verdict"),
    [
        (subprocess.TimeoutExpired("python", 1.0), None),
        (OSError(12, "Cannot allocate memory"), None),
        ((-9, b""), None),
        ((-15, b""), None),
        ((-6, b"fused agrees\n"), False),
        ((-11, b""), False),
        ((1, b""), False),
        ((0, b""), False),
        ((0, b"fused agrees\n"), True),
    ],
)
def test_what_ends_the_trial_from_outside_is_no_verdict(end, verdict, monkeypatch):
    def run(*_, **__):
        if isinstance(end, Exception):
            raise end
        return subprocess.CompletedProcess([], *end)

    monkeypatch.setattr(_canary.subprocess, "run", run)
    assert _canary.run_trial() is verdict


SAID = [
    "", "{", "null", "[]", "true", "[" * 100_000, '{"trusted":' * 50_000, "\x00\xff",
    '{"trusted": true}', '{"trusted": "no", "jaxlib": "%s"}', '{"trusted": "false", "jaxlib": "%s"}',
    '{"trusted": 1, "jaxlib": "%s"}', '{"trusted": null, "jaxlib": "%s"}',
    '{"trusted": true, "jaxlib": "0.0.1"}', '{"trusted": true, "jaxlib": ["%s"]}',
]  # fmt: skip


@pytest.mark.parametrize("said", SAID, ids=range(len(SAID)))
def test_what_is_not_clearly_a_verdict_is_none(said, cache, monkeypatch):
    path = _canary._cache_file()
    path.write_bytes(said.replace("%s", _canary._jaxlib()).encode("latin-1"))
    assert tried(monkeypatch, False) == (1, [False] * 3)


def test_a_folder_in_the_verdict_s_place_costs_a_trial_per_process(cache, monkeypatch):
    _canary._cache_file().mkdir()
    assert tried(monkeypatch, True) == (3, [True] * 3)
    assert sorted(p.suffix for p in cache.iterdir()) == [".json", ".lock"]


def test_no_link_is_written_through(cache, monkeypatch):
    (cache / "thesis.tex").write_text("three years of work")
    _canary._cache_file().symlink_to(cache / "thesis.tex")
    assert tried(monkeypatch, True) == (1, [True] * 3)
    assert (cache / "thesis.tex").read_text() == "three years of work"


def test_a_cache_that_cannot_be_written_costs_a_trial_per_process(cache, monkeypatch):
    (cache / "file").write_text("")
    monkeypatch.setenv("STICKSLIP_CACHE", str(cache / "file" / "cache"))
    assert tried(monkeypatch, True) == (3, [True] * 3)


def test_two_first_starts_at_once_share_one_trial(cache, monkeypatch):
    """Threads stand for processes: the lock is one of the open file, not of the process."""
    pytest.importorskip("fcntl")
    together, runs = threading.Barrier(2), []

    def trial(timeout):
        runs.append(timeout)
        time.sleep(0.5)
        return True

    def first_start(_):
        together.wait()
        return _canary._trial_succeeds.__wrapped__()

    monkeypatch.setattr(_canary, "run_trial", trial)
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        assert list(pool.map(first_start, range(2))) == [True, True]
    assert len(runs) == 1


def test_who_waits_for_another_s_trial_gives_up_in_time(cache, monkeypatch):
    fcntl = pytest.importorskip("fcntl")
    monkeypatch.setattr(_canary, "TIMEOUT", 0.3)
    with open(_canary._cache_file().with_suffix(".lock"), "w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.warns(RuntimeWarning, match="did not end"):
            assert tried(monkeypatch, True) == (0, [False] * 3)


@pytest.mark.parametrize("wish", ["Portabel", "no", "1", "fused,portable"])
def test_a_wish_that_is_none_is_refused_by_name(wish, monkeypatch):
    monkeypatch.setenv("STICKSLIP_EXECUTOR", wish)
    for executor in ("auto", "portable"):
        with pytest.raises(ValueError, match=r"STICKSLIP_EXECUTOR = .*'auto', 'fused', 'portable'"):
            ss.map_lanes(abs, executor=executor)


@pytest.mark.parametrize(
    ("wish", "executor"), [("portable", "portable"), ("Portable ", "portable"), ("FUSED", "fused")]
)
def test_a_wish_does_without_a_trial(wish, executor, cache, monkeypatch):
    monkeypatch.setenv("STICKSLIP_EXECUTOR", wish)
    assert ss.map_lanes(abs).executor == executor
    assert list(cache.iterdir()) == []


@pytest.mark.parametrize("wish", ["", "Auto"])
def test_no_wish_leaves_it_to_the_trial(wish, cache, monkeypatch):
    monkeypatch.setenv("STICKSLIP_EXECUTOR", wish)
    assert tried(monkeypatch, True) == (1, [True] * 3)


@pytest.mark.slow
def test_this_compiler_passes_the_trial():
    assert _canary.run_trial() is True
