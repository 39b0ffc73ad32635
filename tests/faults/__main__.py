"""Plant faults one by one in a copy of the tree, and say which of them the quick tests catch.

    python -m tests.faults               all of them, hours on two cores
    python -m tests.faults --only ball   those with this word in their name or file
    python -m tests.faults --every       of those not caught by their own tests, the whole quick suite

A test file must pass without a fault before it can catch one, so each runs once as it is.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests._budget import QUICK
from tests.faults._table import Fault, faults, faulty
from tests.house._repository import ROOT, tracked_files

NO_TESTS = 5  # pytest's code where all tests of the files are outside the quick suite


def copy_tree(target: Path) -> None:
    for path in tracked_files():
        place = target / path.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path, place)


def passes(tree: Path, *paths: str) -> bool:
    """Whether these quick tests pass in `tree`, at the first failure not."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-m", QUICK, *paths]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, check=False)
    if done.returncode == NO_TESTS:
        return True
    if done.returncode > 1 and b"error" not in done.stdout.lower():
        raise SystemExit(f"pytest did not run: {done.stdout.decode()}{done.stderr.decode()}")
    return done.returncode == 0


def verdict(tree: Path, fault: Fault, sound: dict[str, bool], every: bool) -> str:
    """Plant, run, and take the fault out again."""
    path = tree / fault.file
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    try:
        planted = faulty(fault, text)
    except ValueError as error:
        return f"DOES NOT APPLY: {error}"
    files = [f"tests/{name}.py" for name in fault.tests]
    for name in files:
        if name not in sound:
            sound[name] = passes(tree, name)
    if not all(sound[name] for name in files):
        return "UNKNOWN: its tests fail without it"
    path.write_text(planted, encoding="utf-8")
    try:
        for name in files:
            if not passes(tree, name):
                return f"caught by {name}"
        return "caught by another" if every and not passes(tree) else "NOT CAUGHT"
    finally:
        path.write_text(text, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--only", action="append", default=[], help="a word of a name or a file")
    parser.add_argument("--every", action="store_true", help="the whole quick suite where need be")
    given = parser.parse_args()
    chosen = [f for f in faults() if not given.only or any(w in f.name + f.file for w in given.only)]
    sound: dict[str, bool] = {}
    caught = 0
    with tempfile.TemporaryDirectory() as folder:
        copy_tree(Path(folder))
        for fault in chosen:
            begin = time.monotonic()
            said = verdict(Path(folder), fault, sound, given.every)
            caught += said.startswith("caught")
            print(f"{fault.name} ({fault.file}): {said}, {time.monotonic() - begin:.0f} s", flush=True)
    print(f"{caught} of {len(chosen)} caught")
    return int(caught < len(chosen))


if __name__ == "__main__":
    sys.exit(main())
