"""The line about a long call: when it comes, what it says, and the one switch that silences it."""

import io
import time

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip import map_lanes, progress
from stickslip._compiled_once import compiled_once
from stickslip._jit_by_code import jit_by_code
from stickslip.progress import Progress, clock, showing, tell


@pytest.fixture
def quick(monkeypatch):
    """Lines come after hundredths of a second."""
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    short = {"patience": 0.04, "look": 0.02, "log": 0.0, "nothing_new": 10.0}
    monkeypatch.setattr(progress._here, "pace", progress.Pace(**short))


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_line_tells_rate_and_time_left(monkeypatch):
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    stream = io.StringIO()
    meter = Progress("diagram", 1000, 200, shown=True, stream=stream)
    meter.begin = meter.since = meter.begin - 10.0
    meter.advance(400)
    assert stream.getvalue() == "diagram: 600 of 1,000 lanes (60%), 40 per s, 0:10 gone, 0:10 left\n"
    assert clock(4000.0) == "1:06:40"


def test_a_terminal_has_one_line(monkeypatch):
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    stream = Terminal()
    with Progress("diagram", 2, shown=True, pause=0.0, stream=stream) as meter:
        meter.advance(1)
        meter.note = "a note"
        meter.advance(1)
    assert stream.getvalue().startswith("\rdiagram: 1 of 2 lanes (50%), ")
    assert stream.getvalue().endswith("\n")
    assert stream.getvalue().count("\n") == 1
    assert stream.getvalue().rpartition("\r")[2].startswith("diagram: 2 of 2 lanes (100%), ")


def test_a_short_call_says_nothing(monkeypatch, capsys):
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    with Progress("diagram", 2) as meter:
        meter.advance(2)
    assert capsys.readouterr().err == ""


def slow_to_trace(x):
    time.sleep(0.3)
    return 2.0 * x


@pytest.mark.parametrize("make", [jit_by_code, lambda f: lambda x: compiled_once(f, x), map_lanes])
def test_a_first_call_says_that_it_compiles_and_later_ones_do_not(make, quick, capsys):
    def function(x):
        return slow_to_trace(x)

    with showing("a fit"):
        call = make(function)
        call(jnp.ones(2))
    first = capsys.readouterr().err
    assert first.startswith("a fit: compiling ..., ")
    if make is not jit_by_code and make is not map_lanes:
        return  # a function that comes anew is traced anew
    with showing("a fit"):
        for _ in range(8):
            call(jnp.ones(2))
            time.sleep(0.02)
    again = capsys.readouterr().err
    assert "compiling" not in again
    assert "a fit: running, " in again


def test_a_first_run_alone_says_so_too(quick, capsys):
    jit_by_code(slow_to_trace)(jnp.ones(2))
    first, last = capsys.readouterr().err.splitlines()
    assert first.startswith("stickslip: compiling ..., ")
    assert last.startswith("stickslip: done in ")
    assert not progress.is_showing()


def test_a_first_run_that_fails_leaves_no_meter(quick, capsys):
    def wrong(x):
        slow_to_trace(x)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        jit_by_code(wrong)(jnp.ones(2))
    assert "done" not in capsys.readouterr().err
    assert not progress.is_showing()


def test_within_another_call_what_counts_is_said(quick, capsys):
    with showing("outer"):
        time.sleep(0.1)
        tell("5 points, k = 2")
        with Progress("inner", 10, things="starts") as meter:
            for _ in range(10):
                meter.advance(1)
                time.sleep(0.01)
        time.sleep(0.1)
    lines = capsys.readouterr().err.splitlines()
    assert any(line.startswith("outer: 5 points, k = 2, ") for line in lines)
    assert any(line.startswith("inner: 10 of 10 starts (100%), ") for line in lines)
    assert lines[-1].startswith("inner: ")


def test_one_switch_silences_all(quick, monkeypatch, capsys):
    for shown in (None, True):
        monkeypatch.setenv("STICKSLIP_PROGRESS", "off")
        with Progress("diagram", 2, shown=shown) as meter:
            time.sleep(0.1)
            meter.advance(2)
        assert capsys.readouterr().err == ""
    monkeypatch.setenv("STICKSLIP_PROGRESS", "quiet")
    with pytest.raises(ValueError, match="STICKSLIP_PROGRESS = 'quiet': it must be one of 'on', 'off'"):
        Progress("diagram")


def test_the_outermost_says_whether_anything_is_shown(quick, capsys):
    with Progress("outer", shown=False), Progress("inner", 2) as meter:
        time.sleep(0.1)
        meter.advance(2)
    assert capsys.readouterr().err == ""


def test_a_reader_that_is_gone_ends_nothing(quick):
    class Gone(io.StringIO):
        def write(self, _):
            raise BrokenPipeError

    with Progress("diagram", 2, shown=True, stream=Gone()) as meter:
        meter.advance(2)
    assert meter.done == 2


def test_pauses_of_a_log_grow_with_the_time_gone(monkeypatch):
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    stream = io.StringIO()
    meter = Progress("night", 86_400, things="s", stream=stream)
    for second in np.arange(1.0, 86_401.0):
        now[0] = second
        meter.advance(1)
    assert 100 < stream.getvalue().count("\n") < 250
