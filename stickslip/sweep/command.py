"""`python -m stickslip plan | work | status | verify`: sweeps by many workers."""

import argparse
import json
import re
import signal
import sys
import time
from typing import Any

from .._compilation_cache import enable_compilation_cache
from ._claims import EXPIRY
from ._many import plan_sweep, work_on
from ._needs import needs, needs_lines
from ._reference import function_of
from ._status import status_lines, sweep_status
from ._verify import verify_store

_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
STOPPED = 128 + signal.SIGTERM


class _Terminated(KeyboardInterrupt):
    """A signal asked for the end; what is claimed is given back on the way."""


def main(given: list[str]) -> int:
    """Run a command; returns the exit status: 0, 1 for what went wrong, 2 for a wrong argument."""
    options = _parser().parse_args(given)
    try:
        signal.signal(signal.SIGTERM, _terminate)
        return options.run(options)
    except _Terminated:
        print("ended by a signal: what was finished is kept, the same command goes on", file=sys.stderr)
        return STOPPED
    except KeyboardInterrupt:
        print("interrupted: what was finished is kept, the same command goes on", file=sys.stderr)
        return 130
    except (ValueError, TypeError) as error:
        print(error, file=sys.stderr)
        return 2
    except (OSError, RuntimeError) as error:
        print(getattr(error, "strerror", None) or error, file=sys.stderr)
        return 1


def _terminate(*_: object) -> None:
    raise _Terminated


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m stickslip", description=__doc__)
    commands = parser.add_subparsers(required=True)
    plan = commands.add_parser("plan", help="make a store, without computing")
    plan.add_argument(
        "function", metavar="MODULE:FUNCTION", help="called as FUNCTION(store=STORE, ...)"
    )
    plan.add_argument("store", metavar="STORE")
    plan.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="a parameter, in JSON or a text"
    )
    plan.set_defaults(run=_plan)
    work = commands.add_parser("work", help="compute what is left, beside any others who do")
    work.add_argument("store", metavar="STORE")
    work.add_argument(
        "--until",
        metavar="WHEN",
        help="end by then: a span, as 90m or 1h30m, or a time of day, as 18:30",
    )
    work.add_argument("--processes", type=int, metavar="N", help="workers on this host (default: this)")
    work.add_argument(
        "--no-wait", action="store_true", help="end when nothing is free, though others still compute"
    )
    work.add_argument(
        "--expiry", type=float, default=EXPIRY, metavar="SECONDS",
        help="after which a claim that is not touched is another's (default: %(default)g)",
    )  # fmt: skip
    work.add_argument("--quiet", action="store_true", help="show no progress")
    work.set_defaults(run=_work)
    status = commands.add_parser("status", help="what is finished, failed, claimed and left")
    status.add_argument("store", metavar="STORE")
    status.add_argument("--json", action="store_true", help="all of it, for programs")
    status.add_argument("--plan", action="store_true", help="cores, hours and bytes of the whole sweep")
    status.add_argument("--lanes", type=int, metavar="N", help="of a sweep of N lanes like this one")
    status.set_defaults(run=_status)
    verify = commands.add_parser("verify", help="compute all checksums; 1 if a file is damaged")
    verify.add_argument("store", metavar="STORE")
    verify.add_argument(
        "--repair", action="store_true", help="have `work` compute again what is damaged"
    )
    verify.set_defaults(run=_verify)
    return parser


def _plan(options: Any) -> int:
    parameters = {}
    for text in options.set:
        key, equals, value = text.partition("=")
        if not equals or not key.isidentifier():
            raise ValueError(f"set = {text!r}: it must be a name, an equals sign and a value.")
        try:
            parameters[key] = json.loads(value)
        except ValueError:
            parameters[key] = value
    function = function_of(options.function)
    found = plan_sweep(function, options.store, **parameters)
    print(f"{options.store}: {found['lanes']:,} lanes in {found['units']:,} units")
    return 0


def _work(options: Any) -> int:
    # Compiled once, not by every worker.
    enable_compilation_cache()
    found = work_on(
        options.store,
        processes=options.processes,
        seconds=None if options.until is None else _seconds(options.until),
        wait=not options.no_wait,
        expiry=options.expiry,
        progress=False if options.quiet else None,
    )
    print(f"{options.store}: {found['computed']:,} units computed, {found['left']:,} left")
    return 0


def _status(options: Any) -> int:
    found = sweep_status(options.store)
    needed = None
    if options.plan or options.lanes is not None:
        needed = needs(options.store, found["lanes"] if options.lanes is None else options.lanes)
    if options.json:
        print(json.dumps(found if needed is None else {**found, "plan": needed}, indent=1))
        return 0
    print("\n".join([*status_lines(found), *([] if needed is None else needs_lines(needed))]))
    return 0


def _verify(options: Any) -> int:
    damaged = verify_store(options.store, repair=options.repair)
    for name in damaged:
        print(name)
    if not damaged:
        print(f"{options.store}: every file is as it was written")
        return 0
    many = "1 file" if len(damaged) == 1 else f"{len(damaged):,} files"
    what = "to be computed again by `work`" if options.repair else "damaged"
    print(f"{options.store}: {many} {what}", file=sys.stderr)
    return 1


def _seconds(text: str) -> float:
    """Seconds from now until a time of day, the next one, or for a span."""
    if re.fullmatch(r"(\d+(\.\d*)?[dhms])+", text):
        parts = re.findall(r"(\d+(?:\.\d*)?)([dhms])", text)
        return sum(float(number) * _UNITS[unit] for number, unit in parts)
    day = re.fullmatch(r"([01]?\d|2[0-3]):([0-5]\d)", text)
    if day is None:
        allowed = "a span, as 90m or 1h30m, or a time of day, as 18:30"
        raise ValueError(f"until = {text!r}: it must be {allowed}.")
    now = time.localtime()
    wanted = int(day[1]) * 3600 + int(day[2]) * 60
    return float((wanted - now.tm_hour * 3600 - now.tm_min * 60 - now.tm_sec) % 86400)
