"""`python -m experiments.benchmarks [NAME ...]`: run the benchmarks and print their tables."""

import argparse
import os

# Both cores as devices; read by XLA before the first array.
os.environ.setdefault("XLA_FLAGS", f"--xla_force_host_platform_device_count={os.cpu_count()}")

from . import beam, chain, corexy, derivatives, diagram, fit, latency, stick_slip
from ._harness import machine

BENCHMARKS = {
    "stick-slip": stick_slip.main,
    "derivatives": derivatives.main,
    "diagram": diagram.main,
    "beam": beam.main,
    "corexy": corexy.main,
    "chain": chain.main,
    "fit": fit.main,
    "latency": latency.main,
}


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m experiments.benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"any of: {', '.join(BENCHMARKS)}")
    sizes = parser.add_mutually_exclusive_group()
    sizes.add_argument("--quick", action="store_true", help="a fraction of the lanes")
    sizes.add_argument("--full", action="store_true", help="all lanes, where that takes long")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"unknown benchmark {unknown[0]!r}; allowed: {', '.join(BENCHMARKS)}")
    size = "quick" if options.quick else "full" if options.full else "normal"
    print(machine(), flush=True)
    for name in options.names or BENCHMARKS:
        print()
        parts = BENCHMARKS[name](size)
        for part in [parts] if isinstance(parts, str) else parts:
            print(part, flush=True)


if __name__ == "__main__":
    main()
