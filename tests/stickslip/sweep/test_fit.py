"""Fused chunks shrink where a lane holds many motions and where the compiler does not take them."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid import current_executor, time_loop
from stickslip.sweep import _programs, lanes
from stickslip.systems import CoulombOscillator, Motion

SPEEDS = jnp.linspace(0.1, 0.4, 128)


def motion(speed, x=0.0, **options):
    system = CoulombOscillator(1.0, 1.0, 1.0, 0.5, speed)
    return ss.simulate(system, 0.0, 8.0, Motion(x, speed), "stick", throw=False, **options)


def lanes_of(mapped):
    """Lanes per chunk of the programs that were compiled, by executor."""
    return [(key[0], key[2][0][1]) for key in mapped._compiled]


@pytest.mark.slow
@pytest.mark.parametrize(("motions", "lanes"), [(1, 64), (5, 8)])
def test_motions_inside_a_lane_count(motions, lanes):
    starts = jnp.linspace(0.0, 0.1, motions)

    def lane(speed):
        return jax.vmap(lambda x: motion(speed, x).y1.x)(starts)

    mapped = ss.map_lanes(lane, executor="fused", workers=1)
    found = mapped(SPEEDS[:64])
    assert lanes_of(mapped) == [("fused", lanes)]
    want = ss.map_lanes(lane, executor="portable", workers=1)(SPEEDS[:64])
    assert float(jnp.abs(found - want).max()) < 1e-12
    mapped(SPEEDS[:64])
    assert len(mapped._compiled) == 1


@pytest.mark.more
@pytest.mark.parametrize(("directions", "lanes"), [(2, 64), (6, 32)])
def test_many_directions_of_a_derivative_halve_a_chunk(directions, lanes):
    def lane(speed):
        start = jnp.zeros(directions).at[0].set(speed)
        return jax.jacfwd(lambda p: motion(p[0] + p[1:].sum()).y1.x)(start)

    mapped = ss.map_lanes(lane, executor="fused", workers=1)
    mapped(SPEEDS[:64])
    assert lanes_of(mapped) == [("fused", lanes)]


@time_loop
def steps(execute, start, *, lane):
    """A scan whose rows hold a whole number; its last value is not wanted."""

    def step(carry, number):
        return (carry[0] * 0.5 + lane, carry[1] + jnp.where(lane > 0.0, number, 0)), carry

    return jax.lax.scan(step, start, jnp.arange(3, dtype=jnp.int32))[1]


def test_rows_that_a_scan_stacks_are_no_motions():
    mapped = ss.map_lanes(
        lambda x: steps(current_executor(), (x, jnp.zeros((), jnp.int32)), lane=x),
        executor="fused", workers=1,
    )  # fmt: skip
    _, numbers = mapped(SPEEDS[:64])
    assert lanes_of(mapped) == [("fused", 64)]
    assert np.asarray(numbers[-1]).tolist() == [0, 0, 1]


def rows(speed, ts):
    return motion(speed, saveat=ss.SaveAt(ts=ts)).outputs.y.x


@pytest.mark.more
def test_what_does_not_fuse_is_computed_in_smaller_chunks():
    """Thousands of rows per lane: the compiler splits an operation and cannot link it."""
    ts = SPEEDS[:, None] * jnp.linspace(0.0, 20.0, 4001)[None]
    mapped = ss.map_lanes(rows, executor="fused", workers=1)
    with warnings.catch_warnings(record=True):
        found = mapped(SPEEDS, ts)
    # A host on which the compiler sees a single core never splits.
    assert lanes_of(mapped)[0] in (("fused", 16), ("portable", 64), ("fused", 64))
    want = ss.map_lanes(rows, executor="portable", workers=1)(SPEEDS, ts)
    assert float(jnp.abs(found - want).max()) < 1e-12


def refusing(monkeypatch, above):
    """A compiler that refuses to fuse more than so many lanes; the attempts that it saw."""
    seen = []
    compiled_program = lanes.compiled_program

    def compile_or_refuse(traced, lowered, devices):
        fused = "xla_cpu_small_call" in lowered.as_text()
        lanes = jax.tree.leaves(lowered.args_info)[0].shape[1]
        seen.append((fused, lanes))
        if fused and lanes > above:
            raise jax.errors.JaxRuntimeError(
                "INTERNAL: Failed to materialize symbols: { (<x>, { k }) }"
            )
        return compiled_program(traced, lowered, devices)

    monkeypatch.setattr(lanes, "compiled_program", compile_or_refuse)
    return seen


@pytest.mark.more
def test_smaller_chunks_are_tried_before_the_portable_executor(monkeypatch):
    seen = refusing(monkeypatch, above=16)
    mapped = ss.map_lanes(lambda v: motion(v).y1.x, executor="fused", workers=1)
    found = mapped(SPEEDS)
    assert seen == [(True, 64), (True, 16)]
    mapped(SPEEDS)
    assert len(seen) == 2
    want = ss.map_lanes(lambda v: motion(v).y1.x, executor="portable", workers=1)(SPEEDS)
    assert float(jnp.abs(found - want).max()) < 1e-12


@pytest.mark.more
def test_the_portable_executor_comes_last_and_says_so(monkeypatch):
    seen = refusing(monkeypatch, above=1)
    mapped = ss.map_lanes(lambda v: motion(v).y1.x, executor="fused", workers=1)
    with pytest.warns(UserWarning, match="portable executor"):
        found = mapped(SPEEDS)
    assert [fused for fused, _ in seen] == [True, True, False]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = mapped(SPEEDS)
    assert len(seen) == 3
    assert np.array_equal(found, again)


def test_other_errors_of_the_compiler_are_raised(monkeypatch):
    def broken(*_):
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory")

    monkeypatch.setattr(lanes, "compiled_program", broken)
    with pytest.raises(jax.errors.JaxRuntimeError, match="Out of memory"):
        ss.map_lanes(lambda v: motion(v).y1.x, executor="fused", workers=1)(SPEEDS)


@pytest.mark.more
def test_a_refusal_is_remembered(monkeypatch):
    """To find out again that a program does not compile would take as long as to compile it."""
    tries = []

    def refuse(self, *args, **kwargs):
        tries.append(1)
        raise jax.errors.JaxRuntimeError("INTERNAL: Failed to materialize symbols")

    monkeypatch.setattr(jax.stages.Lowered, "compile", refuse)
    monkeypatch.setattr(_programs, "_PROGRAMS", type(_programs._PROGRAMS)())
    for _ in range(2):
        traced = jax.jit(lambda x: 2.0 * x).trace(1.0)
        with pytest.raises(jax.errors.JaxRuntimeError, match="materialize"):
            _programs.compiled_program(traced, traced.lower(), ())
    assert len(tries) == 1
