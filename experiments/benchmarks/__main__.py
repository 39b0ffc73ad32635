"""`python -m experiments.benchmarks [NAME ...]`: run the benchmarks and print their tables."""

import argparse
import os
import time

# Both cores as devices; read by XLA before the first array.
os.environ.setdefault("XLA_FLAGS", f"--xla_force_host_platform_device_count={os.cpu_count()}")

from stickslip.sweep import code_revision

from . import beam, chain, corexy, derivatives, diagram, fit, latency, orbits, stick_slip, workers
from ._harness import machine
from ._records import keep, record, write

BENCHMARKS = {
    "stick-slip": stick_slip.main,
    "derivatives": derivatives.main,
    "diagram": diagram.main,
    "beam": beam.main,
    "corexy": corexy.main,
    "chain": chain.main,
    "fit": fit.main,
    "latency": latency.main,
    "orbits": orbits.main,
    "workers": workers.main,
}


def main(arguments: list[str] | None = None) -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m experiments.benchmarks", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME",
        help=f"any of: {', '.join(BENCHMARKS)}; or 'results' to write RESULTS.md from what is kept",
    )  # fmt: skip
    sizes = parser.add_mutually_exclusive_group()
    sizes.add_argument("--quick", action="store_true", help="a fraction of the lanes")
    sizes.add_argument("--full", action="store_true", help="all lanes, where that takes long")
    parser.add_argument(
        "--record", action="store_true", help="keep the tables in the repository, and write RESULTS.md"
    )
    options = parser.parse_args(arguments)
    if options.names == ["results"]:
        print(f"wrote {write(BENCHMARKS)}")
        return
    unknown = [name for name in options.names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"unknown benchmark {unknown[0]!r}; allowed: {', '.join(BENCHMARKS)}, results")
    if options.record and options.quick:
        parser.error("--record: it must be without --quick, which is a first look")
    size = "quick" if options.quick else "full" if options.full else "normal"
    print(machine(), flush=True)
    revision = code_revision()  # now: what is kept changes the checkout
    for name in options.names or BENCHMARKS:
        print()
        kept, begin, load = [], time.monotonic(), os.getloadavg()[0]
        parts = BENCHMARKS[name](size)
        for part in [parts] if isinstance(parts, str) else parts:
            print(part, flush=True)
            kept.append(part)
        if options.record:
            entry = record(name, size, kept, time.monotonic() - begin, load, revision)
            print(f"kept {keep(entry)}")
    if options.record:
        print(f"wrote {write(BENCHMARKS)}")


if __name__ == "__main__":
    main()
