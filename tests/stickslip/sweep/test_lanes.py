"""`map_lanes` is `vmap`, whatever the number of lanes, the size of a chunk and who does the work."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss


def lane(key, x):
    """Typed keys go in and come out as arrays do."""
    out = {"sum": x["a"] + jax.random.uniform(key), "key": jax.random.split(key)[0]}
    return {**out, "pair": jnp.stack([x["a"], x["b"][1]])}


def inputs(n):
    x = {"a": jnp.linspace(0.0, 1.0, n), "b": jnp.arange(2.0 * n).reshape(n, 2)}
    return jax.random.split(jax.random.key(0), n), x


def on(kind, **options):
    mapped = ss.map_lanes(lane, executor="portable", **options)
    if kind == "threads":  # as in a process with one device
        mapped.devices, mapped.threads = mapped.devices[:1], 2
    return mapped


@pytest.mark.more
@pytest.mark.parametrize("kind", ["devices", "threads"])
@pytest.mark.parametrize(("n", "options"), [(1, {}), (3, {}), (11, {"chunk_size": 4}), (40, {})])
def test_it_is_vmap(kind, n, options):
    found, want = on(kind, **options)(*inputs(n)), jax.vmap(lane)(*inputs(n))
    assert jax.tree.structure(found) == jax.tree.structure(want)
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(want), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        keys = not isinstance(a.dtype, np.dtype)
        assert np.array_equal(*((jax.random.key_data(c) if keys else c) for c in (a, b)))


def test_chunks_are_filled():
    """25,001 lanes for two workers: 26 chunks of 968, not 26 of 1,024."""
    mapped = ss.map_lanes(lane, executor="portable")
    assert mapped._chunk(25_001, 2) == 968
    assert mapped._chunk(5, 2) == 3
    assert mapped._chunk(1, 2) == 2


def test_numbers_that_fill_the_same_chunks_share_a_program():
    mapped = ss.map_lanes(lane, executor="portable")
    for n in (39, 40, 42):
        mapped(*inputs(n))
    assert len(mapped._compiled) == 1


@pytest.mark.parametrize("outer", [jax.jit, lambda f: f], ids=["jit", "plain"])
def test_derivatives_by_a_number_that_the_function_closes_over(outer):
    def total(a):
        return ss.map_lanes(lambda x: a * x**2, workers=2)(jnp.arange(5.0)).sum()

    assert float(outer(total)(3.0)) == 90.0
    assert float(outer(jax.grad(total))(3.0)) == 30.0


def test_inside_a_transformation():
    mapped = ss.map_lanes(lane, executor="portable", chunk_size=4)
    keys, x = inputs(11)
    slope = jax.grad(lambda a: mapped(keys, {**x, "a": a})["sum"].sum())(x["a"])
    assert np.array_equal(slope, np.ones(11))
