"""A process that takes structures by their number and answers with what came of them."""

import contextlib
import gc
import os
import time

RENEWED = 25  # structures a process takes, so that programs do not fill the memory
SHRINKING = 240.0  # seconds of the processor


def work(pipe, seed: int) -> None:
    """Answer numbers of structures with what came of them."""
    os.environ["XLA_FLAGS"] = " ".join(
        [os.environ.get("XLA_FLAGS", ""), "--xla_cpu_parallel_codegen_split_count=1"]
    )
    import jax

    jax.config.update("jax_disable_most_optimizations", True)
    gc.set_threshold(100_000, 20, 100)
    from ._one import attack

    with contextlib.suppress(EOFError, KeyboardInterrupt):
        while True:
            number = pipe.recv()
            pipe.send((number, attack(seed, number, SHRINKING)))
            jax.clear_caches()


class Worker:
    """A process, and the structure that it is at."""

    def __init__(self, context, seed: int):
        self.context, self.seed = context, seed
        self._begin()

    def _begin(self):
        self.pipe, other = self.context.Pipe()
        self.process = self.context.Process(target=work, args=(other, self.seed), daemon=True)
        self.process.start()
        other.close()
        self.count, self.number, self.since = 0, -1, time.monotonic()

    def give(self, number: int):
        if self.count >= RENEWED:
            self.end()
            self._begin()
        self.pipe.send(number)
        self.count, self.number, self.since = self.count + 1, number, time.monotonic()

    def renew(self):
        self.end()
        self._begin()

    def end(self):
        self.process.kill()
        self.process.join()
        self.pipe.close()
