"""`python -m stickslip status | verify STORE`: what a store holds, and whether it is sound."""

import argparse
import json
import sys
from typing import Any

from ._status import status_lines, sweep_status
from ._verify import verify_store


def main(given: list[str]) -> int:
    """Run a command; returns the exit status: 0, 1 for what went wrong, 2 for a wrong argument."""
    options = _parser().parse_args(given)
    try:
        return options.run(options)
    except (ValueError, TypeError) as error:
        print(error, file=sys.stderr)
        return 2
    except OSError as error:
        print(error.strerror or error, file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m stickslip", description=__doc__)
    commands = parser.add_subparsers(required=True)
    status = commands.add_parser("status", help="what is done, missing and damaged")
    status.add_argument("store", metavar="STORE")
    status.add_argument("--json", action="store_true", help="all of it, for programs")
    status.set_defaults(run=_status)
    verify = commands.add_parser("verify", help="compute all checksums; 1 if a file is damaged")
    verify.add_argument("store", metavar="STORE")
    verify.add_argument(
        "--repair", action="store_true", help="have the same sweep compute again what is damaged"
    )
    verify.set_defaults(run=_verify)
    return parser


def _status(options: Any) -> int:
    found = sweep_status(options.store)
    print(json.dumps(found, indent=1) if options.json else "\n".join(status_lines(found)))
    return 0


def _verify(options: Any) -> int:
    damaged = verify_store(options.store, repair=options.repair)
    for name in damaged:
        print(name)
    if not damaged:
        print(f"{options.store}: every file is as it was written")
        return 0
    many = "1 file" if len(damaged) == 1 else f"{len(damaged):,} files"
    what = "to be computed again by the same sweep" if options.repair else "damaged"
    print(f"{options.store}: {many} {what}", file=sys.stderr)
    return 1
