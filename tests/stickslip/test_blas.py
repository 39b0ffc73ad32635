"""BLAS has one thread while a program runs, and as many as before afterwards."""

import os
import subprocess
import sys
import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from threadpoolctl import ThreadpoolController, threadpool_limits

from stickslip._blas import one_thread
from stickslip._compiled_once import compiled_once
from stickslip._jit_by_code import jit_by_code
from stickslip.progress import showing
from stickslip.sweep import map_lanes

assert scipy.linalg  # its library is loaded
LIBRARIES = ThreadpoolController().select(user_api="blas")


def threads():
    return max((library["num_threads"] for library in LIBRARIES.info()), default=0)


def threads_within(x):
    shape = jax.ShapeDtypeStruct(x.shape, jnp.int64)
    return jax.pure_callback(lambda x: np.full(x.shape, threads()), shape, x, vmap_method="expand_dims")


@pytest.fixture(autouse=True)
def two_threads():
    with threadpool_limits(2, user_api="blas"):
        if threads() != 2:
            pytest.skip("no BLAS here whose threads can be set")
        yield
        assert threads() == 2


def test_a_program_has_one_thread():
    assert jit_by_code(threads_within)(jnp.zeros(())) == 1
    assert threads() == 2
    assert compiled_once(threads_within, jnp.zeros(())) == 1
    assert threads() == 2
    assert jnp.all(map_lanes(threads_within, executor="portable")(jnp.zeros(5)) == 1)
    assert threads() == 2


def test_a_call_that_takes_long_has_one_thread():
    with showing("here"):
        assert threads() == 1
    assert threads() == 2


def test_a_program_within_a_program():
    inner = jit_by_code(threads_within)

    def outer(x):
        shape = jax.ShapeDtypeStruct((), jnp.int64)
        return jax.pure_callback(lambda x: inner(jnp.asarray(0.0)), shape, x), threads_within(x)

    assert [int(n) for n in jit_by_code(outer)(jnp.zeros(()))] == [1, 1]


def test_another_thread_changes_nothing():
    """The number of threads is that of the process: who has set it gives it back, however long another
    thread runs."""
    begun, end = threading.Event(), threading.Event()

    def wait(x):
        begun.set()
        assert end.wait(60.0)
        return np.asarray(x)

    @jit_by_code
    def slow(x):
        return jax.pure_callback(wait, jax.ShapeDtypeStruct((), x.dtype), x)

    with one_thread:
        assert threads() == 1
        thread = threading.Thread(target=slow, args=(jnp.zeros(()),))
        thread.start()
        assert begun.wait(60.0)
    assert threads() == 2
    with one_thread:
        assert threads() == 1
        end.set()
        thread.join()
        assert threads() == 1


def test_an_error_gives_the_threads_back():
    @jit_by_code
    def fails(x):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails(jnp.zeros(()))


def test_the_first_program_of_a_process_has_one_thread():
    """JAX loads the library while it compiles, within the call."""
    script = """
import sys
import jax
import jax.numpy as jnp
from threadpoolctl import ThreadpoolController
from stickslip._jit_by_code import jit_by_code

def show(x):
    info = ThreadpoolController().select(user_api="blas").info()
    print(max((i["num_threads"] for i in info if "scipy" in i["filepath"]), default=None))
    return x

assert "scipy.linalg" not in sys.modules
jit_by_code(lambda a: jax.pure_callback(show, a, jnp.linalg.qr(a)[1]))(jnp.eye(3))
show(None)
"""
    given = os.environ | {"OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=given
    )
    assert done.stdout.split() == ["1", "2"]
