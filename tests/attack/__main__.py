"""A random attack: `python -m tests.attack --seed 1 --minutes 10 --workers 2`.

Draws machines and compares them with a slow independent reference, and with themselves said otherwise.
Prints what is wrong without a word, shrunk to a script, and how many came out how. `--only 17` repeats
structure 17 of a seed.
"""

import argparse
import multiprocessing
import multiprocessing.connection
import sys
import time
from collections import Counter

from ._one import table, tally
from ._worker import Worker

PATIENCE = 1800.0  # seconds a structure may take, before its process is ended
GRACE = 120.0  # seconds for what is at work when the time is over


def main(argv: list[str] | None = None) -> int:
    """Run the attack; 1 if something is wrong without a word, or crashes."""
    parser = argparse.ArgumentParser(prog="tests.attack", description=__doc__)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", type=int, help="one structure of the seed")
    asked = parser.parse_args(argv)
    print(f"seed {asked.seed}, {asked.minutes:g} minutes, {asked.workers} processes", flush=True)
    context = multiprocessing.get_context("spawn")
    count = 1 if asked.only is not None else asked.workers
    workers = [Worker(context, asked.seed) for _ in range(count)]
    end, following = time.monotonic() + 60.0 * asked.minutes, asked.only or 0
    end = end if asked.only is None else float("inf")
    verdicts: Counter = Counter()
    refusals: Counter = Counter()
    for worker in workers:
        worker.give(following)
        following += 1
    busy, told = list(workers), time.monotonic()
    while busy and time.monotonic() < end + GRACE:
        ready = multiprocessing.connection.wait([w.pipe for w in busy], timeout=5.0)
        for worker in list(busy):
            if worker.pipe in ready:
                try:
                    number, (lines, counts, refused) = worker.pipe.recv()
                except (EOFError, ConnectionResetError):
                    lines, counts, refused = ["the process died"], {("process", "crash"): 1}, {}
                    number = worker.number
                    worker.renew()
            elif time.monotonic() - worker.since > PATIENCE:
                lines, counts, refused = [f"no end in {PATIENCE:g} s"], {("process", "crash"): 1}, {}
                number = worker.number
                worker.renew()
            else:
                continue
            verdicts.update({("structures", "all"): 1, **counts})
            refusals.update(refused)
            if time.monotonic() > told + 60.0:
                told = time.monotonic()
                print(tally(verdicts), flush=True)
            for line in lines:
                print(f"[{asked.seed}:{number}] {line}", flush=True)
            if time.monotonic() < end and asked.only is None:
                worker.give(following)
                following += 1
            else:
                busy.remove(worker)
    for worker in workers:
        worker.end()
    print(table(verdicts, refusals))
    bad = sum(n for (_, verdict), n in verdicts.items() if verdict in ("SILENTLY WRONG", "crash"))
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
