"""One thread of BLAS and LAPACK while a compiled program runs."""

import contextlib
import sys
import threading

import jax.monitoring
from threadpoolctl import ThreadpoolController

_COMPILED = "/jax/core/compile/backend_compile_duration"


class _OneThread:
    """A context in which BLAS and LAPACK compute with one thread; within itself it changes nothing.

    OpenBLAS shares the work on matrices of some 10,000 numbers between threads that wait for each other
    actively, hundreds of times in one factorisation. Where another process has the second core, each
    time is a time slice: the QR of 643 rows by 81 columns takes 0.6 ms with one thread, 20 ms with two
    on an idle machine and up to 1 s on a busy one. Our matrices are hardly larger, and where there is
    more to do, lanes are what cores share.

    The number of threads belongs to the whole process. It is that of the user before and after. Of
    several Python threads the first one sets it, until it leaves; the others run with what they find.
    """

    def __init__(self):
        self._turn = threading.Lock()
        self._thread: int | None = None
        self._entered = 0
        self._libraries: ThreadpoolController | None = None
        self._limit = contextlib.ExitStack()

    def __enter__(self):
        thread = threading.get_ident()
        with self._turn:
            if self._thread is None:
                self._thread = thread
            if self._thread == thread:
                self._entered += 1
                if self._entered == 1:
                    self._set()

    def __exit__(self, *_):
        with self._turn:
            if self._thread == threading.get_ident():
                self._entered -= 1
                if self._entered == 0:
                    self._thread = None
                    self._limit.close()

    def _set(self):
        # To load SciPy's library takes 0.15 s; JAX does it for the first program that calls LAPACK.
        if self._libraries is None and "scipy.linalg" in sys.modules:
            self._libraries = ThreadpoolController().select(user_api="blas")
        if self._libraries is not None:
            self._limit.enter_context(self._libraries.limit(limits=1))

    def set_after_compiling(self, event: str, duration_secs: float, **_: str | int) -> None:
        """Called by JAX between the compiling and the first run of a program."""
        with self._turn:
            if event == _COMPILED and self._libraries is None and self._thread == threading.get_ident():
                self._set()


one_thread = _OneThread()
jax.monitoring.register_event_duration_secs_listener(one_thread.set_after_compiling)
