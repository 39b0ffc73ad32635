"""Sweeps in memory: blocks, carried lanes, labels, progress, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.sweep import Carried, Variable, run_sweep
from stickslip.sweep.grid import block_shape, blocks
from tests.stickslip.sweep._killable import sweep
from tests.stickslip.sweep._options import options

GRID = {"k": np.linspace(0.0, 1.0, 23), "b": np.array([1.0, 2.0, 3.0])}


@pytest.mark.parametrize("shape", [(1,), (17,), (5, 7), (3, 1, 4)])
@pytest.mark.parametrize("chunk", [1, 4, 6, 1000])
@pytest.mark.parametrize("first", [None, 0])
def test_blocks_cover_the_grid_once(shape, chunk, first):
    sides = block_shape(shape, chunk, first)
    assert np.prod(sides) <= chunk
    seen = np.zeros(shape, int)
    pieces = blocks(shape, sides)
    for block in pieces:
        seen[block.region] += 1
    assert (seen == 1).all()
    assert [block.number for block in pieces] == list(range(len(pieces)))


@pytest.mark.parametrize("how", [{"chunk": 1}, {"chunk": 50}, {"chunk": 4096}, {"workers": 2}])
def test_results_do_not_depend_on_how_they_are_cut(how):
    ours, other = sweep(None), sweep(None, **how)
    for name in ours.data_vars:
        np.testing.assert_allclose(other[name], ours[name], rtol=1e-12)


def carried(carry, k, b):
    state = 0.5 * carry["s"] + k * b
    return {"s": state}, {"y": state}


def by_hand(backward):
    out, state = np.zeros((23, 3)), np.ones(3)
    for i in range(22, -1, -1) if backward else range(23):
        state = 0.5 * state + GRID["k"][i] * GRID["b"]
        out[i] = state
    return out


@pytest.mark.more
@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("chunk", [2, 12, 1000])
def test_carried_lanes_follow_each_other(backward, chunk, tmp_path):
    call = {"carry": {"s": 1.0}, "carried": Carried("downwards" if backward else "upwards")}
    memory = run_sweep(carried, GRID, **call, **options(chunk=chunk))
    np.testing.assert_allclose(memory.y, by_hand(backward), rtol=1e-14)
    stored = run_sweep(carried, GRID, **call, **options(tmp_path / "store", chunk=chunk))
    assert stored.load().equals(memory)


def test_a_carried_sweep_goes_on_from_the_state_in_the_store(tmp_path):
    call = {"carry": {"s": 1.0}, **options(tmp_path / "s", chunk=12)}
    whole = run_sweep(carried, GRID, **call).load()
    (tmp_path / "s" / "finished" / "000002.json").unlink()
    assert run_sweep(carried, GRID, **call).load().equals(whole)


def test_carried_along_the_second_coordinate():
    along = Carried(along="b")
    result = run_sweep(carried, GRID, carry={"s": 1.0}, carried=along, **options(chunk=7))
    state = np.ones(23)
    for j, b in enumerate(GRID["b"]):
        state = 0.5 * state + GRID["k"] * b
        np.testing.assert_allclose(result.y[:, j], state, rtol=1e-14)


def test_inputs_differ_from_lane_to_lane():
    start = {"u": np.arange(69.0).reshape(23, 3)}
    result = run_sweep(
        lambda k, b, start: start["u"] + 0.0 * k * b, GRID, inputs={"start": start},
        **options(chunk=10),
    )  # fmt: skip
    np.testing.assert_array_equal(result.value, start["u"])


def test_a_lane_that_is_not_finite_leaves_its_neighbours_alone():
    plain = run_sweep(lambda k: jnp.exp(k), {"k": GRID["k"]}, **options())
    odd = run_sweep(
        lambda k: jnp.exp(jnp.where(k == GRID["k"][5], jnp.inf, k)),
        {"k": GRID["k"]},
        **options(),
    )
    others = np.arange(23) != 5
    np.testing.assert_array_equal(odd.value[others], plain.value[others])
    assert np.isinf(odd.value[5])


DIRECT = ("function", "grid", "carry", "carried", "inputs")


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"grid": {}}, TypeError, "grid = {}"),
        ({"grid": {"k": []}}, ValueError, r"grid\['k'\] = .*, of shape \(0,\)"),
        ({"grid": {"k": [[1.0]]}}, ValueError, r"grid\['k'\] = .*, of shape \(1, 1\)"),
        ({"grid": {"k": [0.0, np.nan]}}, ValueError, r"grid\['k'\]\[1\] = nan: it must be finite"),
        ({"grid": {"k": "abc"}}, TypeError, r"grid\['k'\] = 'abc'"),
        ({"grid": {"k": [1j]}}, TypeError, r"grid\['k'\] = \[1j\]"),
        (
            {"grid": {"k 3": [1.0]}},
            ValueError,
            r"grid\['k 3'\].*: it must be named by a Python identifier",
        ),
        ({"function": 3}, TypeError, "function = 3"),
        ({"chunk": 0}, ValueError, "chunk = 0: it must be an integer of at least 1"),
        ({"chunk": 2.5}, ValueError, "chunk = 2.5"),
        ({"resume": "yes"}, TypeError, "resume = 'yes'"),
        ({"carried": Carried()}, ValueError, "without a carry"),
        (
            {"carry": 1.0, "carried": Carried(along="z")},
            ValueError,
            "along = 'z': it must be one",
        ),
        ({"inputs": {"u": np.zeros(3)}}, ValueError, r"inputs\['u'\] = .*, of shape \(3,\)"),
        ({"variables": {"w": Variable()}}, ValueError, r"variables\['w'\] = Variable"),
        ({"variables": {"value": Variable(("p",))}}, ValueError, r"variables\['value'\].dims"),
        ({"function": lambda k: {}}, ValueError, "returned no array"),
        ({"function": lambda k: {"k": k}}, ValueError, "function = 'k': it must be one whose results"),
    ],
)
def test_wrong_arguments_are_named(change, error, text):
    call = {"function": lambda k: k, "grid": {"k": [1.0, 2.0]}, **change}
    direct = {name: call.pop(name) for name in [*call] if name in DIRECT}
    with pytest.raises(error, match=text):
        run_sweep(**direct, **options(**call))


def test_progress_is_silent_of_a_short_sweep_unless_asked(monkeypatch, capsys):
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    sweep(None, progress=False)
    assert capsys.readouterr().err == ""
    sweep(None, progress=True)
    assert "309 of 309 lanes (100%)" in capsys.readouterr().err
