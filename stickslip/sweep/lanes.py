"""Many independent lanes of one function: small chunks, all cores, the fast executor."""

import concurrent.futures
import contextlib
import os
import threading
import warnings
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import PyTree

from .._blas import one_thread
from .._code import code_and_traced, code_key
from .._validation import (
    check_callable,
    check_count,
    check_in,
    is_concrete,
    leaves_of,
    refusal,
    shape_refusal,
)
from ..hybrid.executor import FUSED, PORTABLE, use_executor, wished_executor
from ..hybrid.one_call import LANES
from ..progress import Progress, ready
from ._canary import fused_is_trusted
from ._fit import (
    CHUNK_PORTABLE,
    PORTABLE_INSTEAD,
    VECTOR,
    Fit,
    MustBeAlone,
    NotWorthCompiling,
    TooManyMotions,
    check_alone,
    check_motions,
    check_worth,
    smaller,
)
from ._programs import UNKNOWN_OPERATION, compiled_program, refused_to_fuse
from .grid import block_lanes

EXECUTORS = ("auto", "fused", "portable")
# Lanes have threads of their own. Operations that share XLA's pool from within it, such as a Fourier
# transform, may wait for ever (https://github.com/PyAutoLabs/PyAutoFit/issues/1530).
ON_CPU = {"xla_cpu_prefer_vector_width": "512", "xla_cpu_multi_thread_eigen": False}
# Within a fused loop the compiler has no code for the products and sums that it hands to a library.
ON_CPU_FUSED = {**ON_CPU, "xla_cpu_experimental_ynn_fusion_type": ""}
_ALONE = threading.Lock()  # of the programs that must not run side by side, in all threads of a process


class map_lanes:
    """`jax.vmap` for many lanes: `map_lanes(function)(inputs)` maps over the leading axis.

    A lane is one element of the batch: one run among many, with its own parameters, events and result
    code. The lanes are cut into chunks of `chunk_size`, one after the other on each core or device, so
    that memory does not grow with their number and a chunk's working set stays in the cache. Every
    `simulate` inside `function` uses the chosen executor. Results do not depend on chunk size,
    number of cores or executor beyond rounding.

    **Arguments**

    - `function(*inputs)`: what one lane does, e.g. `lambda k: simulate(...).y1.x`; inputs and
      results are pytrees of arrays.
    - `chunk_size`: most lanes per chunk; by default 64 fused, 1,024 portable on a CPU and 65,536
      elsewhere. Fused chunks are made smaller where the function runs several motions at once or has
      derivatives along three directions and more, and where the compiler does not take them.
    - `executor`: `"fused"` compiles the time loop to one function (3 to 6 times faster on a CPU);
      `"portable"` uses nothing but public JAX; `"auto"` is `"fused"` on a CPU if a trial in a
      subprocess has shown that this jaxlib compiles it and agrees in value. The trial cannot cover
      every program: should XLA ever abort while compiling yours, use `"portable"` here or
      `STICKSLIP_EXECUTOR=portable` in the environment, which may also be `fused` (without a trial)
      or `auto`. A program that the compiler does not fuse, such as one with thousands of rows per
      lane, is computed by the portable executor, and a warning says so; with `"auto"` so is one with
      more products of matrices in its time loop than lanes, which would compile for long.
    - `workers`: devices or, with a single CPU device, threads to use; by default all.

    **Returns** a callable with the results' leading axis as long as the inputs'. It is compiled on
    first use; keep it to use it again. Its attribute `executor` says which one is used. Inside `jit`,
    `vmap` or `grad` it maps chunk by chunk with the portable executor.

    **Errors** `ValueError` for an unknown executor, here or in `STICKSLIP_EXECUTOR`, a chunk size or
    number of workers below 1, or inputs whose leading axes differ; `TypeError` for inputs that are
    not arrays of numbers.
    """

    def __init__(
        self,
        function: Callable,
        *,
        chunk_size: int | None = None,
        executor: str = "auto",
        workers: int | None = None,
    ):
        check_callable("function", function, "f(*inputs)")
        check_in("executor", executor, EXECUTORS)
        for name, value in (("chunk_size", chunk_size), ("workers", workers)):
            if value is not None:
                check_count(name, value, 1)
        wished_executor()  # nonsense in the environment raises an error, whether it would matter or not
        cpu = jax.default_backend() == "cpu"
        self._chooses = executor == "auto"
        if executor == "auto":
            executor = "fused" if cpu and fused_is_trusted() else "portable"
        self.function = function
        self.executor = executor
        fitting = LANES if executor == "fused" else CHUNK_PORTABLE
        self.chunk_size = chunk_size or (fitting if cpu else block_lanes())
        if executor == "fused":
            # The compiler does not take a fused loop over single numbers.
            self.chunk_size = max(self.chunk_size, 2)
        devices = jax.local_devices()
        self.devices = devices[: workers or len(devices)]
        self.threads = 1
        if cpu and len(devices) == 1:
            self.threads = workers or os.cpu_count() or 1
        self._compiled: dict = {}
        self._fits: dict = {}  # what the compiler was found to take, by form of the inputs

    def __call__(self, *inputs: PyTree) -> PyTree:
        n = _lanes_in(inputs)
        inputs = jax.tree.map(jnp.asarray, inputs)
        # No more threads than lanes.
        parts = len(self.devices) if len(self.devices) > 1 else min(self.threads, n)
        if not is_concrete(inputs) or code_and_traced(self.function)[1]:
            out = self._chunks(PORTABLE)(self._pad(inputs, n, self._chunk(n, parts)))
            return jax.tree.map(lambda a: _lanes(a)[:n], out)
        # A call of few lanes that is compiled is shorter than a meter takes to begin.
        with Progress("map_lanes") if self._takes_long(inputs, n, parts) else contextlib.nullcontext():
            program, cut, fit = self._fitting_program(inputs, n, parts)
            ready()
            with _ALONE if fit.alone else contextlib.nullcontext():
                return self._join_chunks(self._run(program, cut), n)

    def tracing(self):
        """Context in which `simulate` is traced for the executor of these lanes."""
        return use_executor(self._executor)

    @property
    def _executor(self):
        return FUSED if self.executor == "fused" else PORTABLE

    def _chunk(self, n, parts, most=None):
        """Lanes per chunk, `most` of them, such that as few as possible have to be filled up."""
        most = most or self.chunk_size
        rounds = -(-n // (most * parts))
        lanes = -(-n // (rounds * parts))
        if lanes > VECTOR:
            lanes = -(-lanes // VECTOR) * VECTOR
        return min(most, max(lanes, 2))

    def _takes_long(self, inputs, n, parts):
        """Whether a call may: it compiles, or has more lanes than one chunk for each thread."""
        return n > self.chunk_size * parts or _form(inputs, n) not in self._fits

    def _fitting_program(self, inputs, n, parts):
        """Program, the inputs cut into chunks, one part for each thread, and the fit of both."""
        form = _form(inputs, n)
        if form in self._fits:
            fit = self._fits[form]
            cut = self._cut_into_chunks(inputs, n, parts, fit)
            return self._program(cut[0], fit), cut, fit
        fit = Fit(self.executor, self.chunk_size)
        while True:
            cut = self._cut_into_chunks(inputs, n, parts, fit)
            lanes = jax.tree.leaves(cut)[0].shape[1]
            try:
                program = self._program(cut[0], fit, n if self._chooses else None)
            except TooManyMotions as error:
                fit = fit._replace(lanes=error.lanes)
            except NotWorthCompiling:
                fit = Fit("portable", CHUNK_PORTABLE)
            except MustBeAlone:
                fit = fit._replace(alone=True)
            except jax.errors.JaxRuntimeError as error:
                if fit.executor != "fused" or not refused_to_fuse(error):
                    raise
                fit = smaller(fit, 0 if UNKNOWN_OPERATION in str(error) else lanes)
                if fit.executor != "fused":
                    warnings.warn(PORTABLE_INSTEAD, stacklevel=3)
            else:
                self._fits[form] = fit
                return program, cut, fit

    def _cut_into_chunks(self, inputs, n, parts, fit):
        """Inputs as `[chunks, chunk, ...]`, one part for each thread."""
        parts = 1 if fit.alone else parts
        chunk = self._chunk(n, parts, fit.lanes)
        chunks = self._pad(jax.tree.map(self._on_host, inputs), n, chunk, parts)
        if len(self._devices(fit)) > 1 or parts == 1:
            return [jax.device_put(chunks)]
        count = jax.tree.leaves(chunks)[0].shape[0] // parts
        return [
            jax.device_put(jax.tree.map(lambda a, i=i: a[i * count : (i + 1) * count], chunks))
            for i in range(parts)
        ]

    def _pad(self, inputs, n, chunk, parts=1):
        """Inputs as `[chunks, chunk, ...]`, the last lane repeated to fill the last chunks."""
        count = -(-n // chunk)
        count = -(-count // parts) * parts
        index = np.minimum(np.arange(count * chunk), n - 1)
        return jax.tree.map(lambda a: a[index].reshape(count, chunk, *a.shape[1:]), inputs)

    def _join_chunks(self, out, n):
        """Results of `n` lanes from `[chunks, chunk, ...]`."""
        return jax.device_put(jax.tree.map(lambda a: _lanes(self._on_host(a))[:n], out))

    def _on_host(self, a):
        """Through NumPy: to cut or join on host devices takes a compiled program for each shape."""
        on_cpu = self.devices[0].platform == "cpu"
        return np.asarray(a) if on_cpu and isinstance(a.dtype, np.dtype) else a  # keys are not

    def _devices(self, fit):
        return self.devices[:1] if fit.alone else self.devices

    def _chunks(self, executor):
        def run(chunks):
            with use_executor(executor):
                return jax.lax.map(lambda lanes: jax.vmap(self.function)(*lanes), chunks)

        return run

    def _program(self, chunks, fit, lanes=None):
        """Compiled program for this shape; raises `TooManyMotions` for chunks that are too large, and
        `NotWorthCompiling` for so few `lanes` of what compiles for long."""
        leaves = jax.tree.leaves(chunks)
        shapes = ((a.shape, a.dtype) for a in leaves)
        key = (fit.executor, jax.tree.structure(chunks), *shapes, code_key(self.function), fit.alone)
        if key not in self._compiled:
            executor = FUSED if fit.executor == "fused" else PORTABLE
            run, devices = self._chunks(executor), self._devices(fit)
            if len(devices) > 1:
                mesh = Mesh(np.array(devices), ("lanes",))
                spec = PartitionSpec("lanes")
                run = jax.shard_map(run, mesh=mesh, in_specs=spec, out_specs=spec, check_vma=False)
            on_cpu = devices[0].platform == "cpu"
            options = (ON_CPU_FUSED if fit.executor == "fused" else ON_CPU) if on_cpu else None
            # Some of the engine is traced only as the program is lowered.
            with use_executor(executor):
                traced = jax.jit(run, compiler_options=options).trace(chunks)
                if on_cpu and not fit.alone:
                    check_alone(traced.jaxpr)
                if fit.executor == "fused":
                    check_motions(traced.jaxpr, leaves[0].shape[1])
                    if lanes is not None:
                        check_worth(traced.jaxpr, lanes)
                lowered = traced.lower()
            self._compiled[key] = compiled_program(traced, lowered, devices)
        return self._compiled[key]

    def _run(self, program, parts):
        def outputs(part):
            return jax.block_until_ready(program(part))

        with one_thread:
            if len(parts) == 1:
                return outputs(parts[0])
            with concurrent.futures.ThreadPoolExecutor(len(parts)) as pool:
                outs = list(pool.map(outputs, parts))
        return jax.tree.map(lambda *a: jnp.concatenate(a), *outs)


def _form(inputs, n):
    """Shapes and types of the inputs of `n` lanes, by which the compiler was asked."""
    leaves = jax.tree.leaves(inputs)
    return (n, jax.tree.structure(inputs), *((a.shape[1:], a.dtype) for a in leaves))


def _lanes_in(inputs):
    """Length of the leading axis that all inputs share."""
    sizes = set()
    inputs = inputs[0] if len(inputs) == 1 else inputs
    for name, leaf in leaves_of("inputs", inputs):
        try:
            if isinstance(leaf, np.ma.MaskedArray):
                raise TypeError
            # PRNG keys are arrays, but not numeric.
            shape = (leaf if isinstance(leaf, jax.Array) else np.asarray(leaf)).shape
            jnp.result_type(leaf)
        except (TypeError, ValueError, OverflowError):
            raise refusal(name, leaf, "an array of numbers", TypeError) from None
        if shape[:1] in ((), (0,)):
            raise shape_refusal(name, leaf, "an array with one lane or more in front")
        sizes.add(shape[0])
    if not sizes:
        raise refusal("inputs", inputs, "a pytree with an array to map over")
    if len(sizes) != 1:
        some = f"with leading axes of {sorted(sizes)} lanes"
        raise refusal("inputs", inputs, "arrays of one length", but=some)
    return sizes.pop()


def _lanes(a):
    """The leading axes of chunks and lanes as one."""
    return a.reshape(a.shape[0] * a.shape[1], *a.shape[2:])
