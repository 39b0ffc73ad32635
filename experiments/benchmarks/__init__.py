"""Speed against peers, always with the error beside it; `python -m experiments.benchmarks`."""
