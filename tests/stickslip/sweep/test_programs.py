"""A compiled program serves no function but those that come to the same; nor does a store."""

import subprocess
import sys
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.sweep import SweepMismatchError, _programs, run_sweep
from tests.house._repository import ROOT
from tests.stickslip.sweep._options import options

X = jnp.arange(3.0)
GRID = {"k": [1.0, 2.0]}
NUMBER = jax.ShapeDtypeStruct((), jnp.float64)


def mapped(function):
    return ss.map_lanes(function, executor="portable")(X)


def compiled_anew(function):
    """Whether the call compiles a program that is kept."""
    before = set(_programs._PROGRAMS)
    mapped(function)
    return not set(_programs._PROGRAMS) <= before


def constant(values):
    return lambda x: jnp.sum(x * values)


class One(NamedTuple):
    x: Any


class Two(NamedTuple):
    x: Any


class Named(eqx.Module):
    x: Any
    name: str = eqx.field(static=True)


def test_equal_programs_are_compiled_once():
    assert compiled_anew(constant(np.linspace(0.0, 7.0, 5000)))
    assert not compiled_anew(constant(np.linspace(0.0, 7.0, 5000)))


@pytest.mark.parametrize("size", [1, 7, 5000])
def test_constants_count(size):
    a, b = np.linspace(0.0, 1.0, size), np.linspace(0.0, 1.0, size)
    b[size // 2] += 1.0
    np.testing.assert_allclose(mapped(constant(b)) - mapped(constant(a)), X)


@pytest.mark.parametrize("kind", ["pure", "io", "vectorized"])
def test_host_callbacks_count(kind):
    def host(value):
        def called(x):
            return np.full_like(x, value)

        if kind == "io":
            return lambda x: jax.experimental.io_callback(called, NUMBER, x)
        method = "sequential" if kind == "pure" else "expand_dims"
        return lambda x: jax.pure_callback(called, NUMBER, x, vmap_method=method)

    for value in (1.0, 100.0):
        np.testing.assert_array_equal(mapped(host(value)), np.full(3, value))


def test_what_is_only_printed_counts():
    seen = []

    def told(name):
        def lane(x):
            jax.debug.callback(lambda _: seen.append(name), x)
            return x

        return lane

    for name in ("first", "second"):
        seen.clear()
        mapped(told(name))
        jax.effects_barrier()
        assert set(seen) == {name}


def test_classes_of_results_count():
    for kind in (One, Two):
        assert type(mapped(lambda x, kind=kind: kind(2.0 * x))) is kind
    for name in ("a", "b"):
        assert mapped(lambda x, name=name: Named(3.0 * x, name)).name == name


def test_messages_of_errors_count():
    def checked(message):
        return lambda x: eqx.error_if(x, x > 1.5, message)

    for message in ("the first is too large", "the second is too large"):
        with pytest.raises(Exception, match=message):
            jax.block_until_ready(mapped(checked(message)))


def test_programs_with_equal_errors_are_shared():
    """`simulate` raises so by default."""

    def checked():
        return lambda x: eqx.error_if(x, x > 9.5, "too large")

    assert compiled_anew(checked())
    assert not compiled_anew(checked())


@pytest.mark.parametrize("what", ["name", "dictionary", "array", "object"])
def test_what_was_altered_since_counts(what, tmp_path):
    """`jax.jit` would not look again, for the same function is given twice."""
    factor, table, array = 1.0, {"factor": 1.0}, np.ones(3000)

    class Line:
        slope = 1.0

        def __call__(self, k):
            return self.slope * k

    line = Line()
    lanes = {
        "name": lambda k: factor * k,
        "dictionary": lambda k: table["factor"] * k,
        "array": lambda k: jnp.mean(array * k),
        "object": line,
    }
    store = tmp_path / "s"
    run_sweep(lanes[what], GRID, **options())
    run_sweep(lanes[what], GRID, **options(store))
    factor = table["factor"] = line.slope = 5.0
    array *= 5.0
    np.testing.assert_allclose(run_sweep(lanes[what], GRID, **options()).value, [5.0, 10.0])
    with pytest.raises(SweepMismatchError, match="program is"):
        run_sweep(lanes[what], GRID, **options(store))


def measured(value):
    def instrument(k):
        return np.full_like(k, value)

    return lambda k: jax.pure_callback(instrument, NUMBER, k, vmap_method="expand_dims")


def test_a_sweep_that_calls_the_host_is_stored_but_not_resumed(tmp_path):
    store = tmp_path / "s"
    run_sweep(measured(1.0), GRID, **options(store))
    for value in (1.0, 100.0):
        with pytest.raises(
            SweepMismatchError, match=r"calls the host \(pure_callback of .*instrument\)"
        ):
            run_sweep(measured(value), GRID, **options(store))
    assert (run_sweep(measured(100.0), GRID, **options(store, resume=False)).value == 100.0).all()


@pytest.mark.parametrize("change", [1e-12, np.nan])
def test_a_constant_that_differs_is_another_sweep(change, tmp_path):
    store = tmp_path / "s"
    values = np.linspace(0.0, 1.0, 3000)
    run_sweep(constant_lane(values), GRID, **options(store))
    run_sweep(constant_lane(values.copy()), GRID, **options(store))
    other = values.copy()
    other[1234] += change
    with pytest.raises(SweepMismatchError, match="program is"):
        run_sweep(constant_lane(other), GRID, **options(store))


def constant_lane(values):
    return lambda k: jnp.sum(k * values)


DIGEST = """
import jax, jax.numpy as jnp, numpy as np, equinox as eqx
from stickslip.sweep._programs import identify
def lane(k):
    jax.debug.print("{}", k)
    return eqx.error_if(jnp.sum(k * np.linspace(0.0, 1.0, 3000)), k > 5.0, "too large")
traced = jax.jit(lane).trace(1.0)
found = identify(traced, traced.lower())
assert found.unknown == () and found.silent == ("debug_print",), found
print(found.digest)
"""


@pytest.mark.more
def test_the_digest_is_that_of_another_process(capsys):
    """Printing and the errors of equinox do not keep a sweep from being resumed."""
    exec(DIGEST, {})
    other = subprocess.run(
        [sys.executable, "-c", DIGEST], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    assert len(other.strip()) == 64
    assert capsys.readouterr().out == other
