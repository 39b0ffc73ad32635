"""Solutions as datasets and tables: what they hold is the solution, with names and units."""

import math
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

BLOCK = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
TIMES = jnp.linspace(0.0, 30.0, 31)
SPEEDS = jnp.asarray([0.2, 0.3])


@pytest.fixture(scope="module")
def batch():
    @jax.jit
    @jax.vmap
    def runs(belt_speed):
        block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, belt_speed)
        section = ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.5, "rising")
        return ss.simulate(
            block, 0.0, 30.0, Motion(x=0.0, v=belt_speed),
            saveat=ss.SaveAt(ts=TIMES, sections=section, max_events=8, max_crossings=8),
        )  # fmt: skip

    return runs(SPEEDS)


@pytest.fixture(scope="module")
def run(batch):
    # By NumPy: a program for each shape else.
    return jax.tree.map(lambda a: jax.device_put(np.asarray(a)[0]), batch)


@pytest.mark.more
def test_one_run(run):
    data = run.to_dataset(BLOCK)
    np.testing.assert_array_equal(data.time, TIMES)
    for name, values, unit in (
        ("x", run.outputs.y.x, "m"),
        ("slope_of_v", run.outputs.dy.v, "m/s/s"),
    ):
        assert data[name].dims == ("time",)
        np.testing.assert_array_equal(data[name], values)
        assert data[name].attrs["units"] == unit
    # Rows that no event filled are gone; it sticks for 5 s first.
    assert data.sizes["event"] == int(run.num_events) == 6
    assert float(data.event_t[0]) == pytest.approx(5.0, abs=1e-9)
    assert float(data.after_x[0]) == pytest.approx(1.0, abs=1e-9)
    assert [data.attrs["mode_names"][m] for m in data.event_mode_after.values[:2]] == [
        "slip backward", "stick",
    ]  # fmt: skip
    np.testing.assert_allclose(data.crossing_0_x, 0.5, atol=1e-12)
    assert data.crossing_0_t.attrs["units"] == "s"
    assert float(data.end_x) == float(run.y1.x)
    assert data.result.attrs["flag_meanings"].split()[int(data.result)] == "successful"


@pytest.mark.more
def test_a_batch(batch):
    data = batch.to_dataset(BLOCK, batch={"belt_speed": SPEEDS})
    assert data.x.dims == ("belt_speed", "time")
    assert data.belt_speed.attrs["units"] == "m/s"
    np.testing.assert_array_equal(data.x.sel(belt_speed=0.3), batch.outputs.y.x[1])
    assert data.event_t.dims == ("belt_speed", "event")
    assert batch.to_dataset(BLOCK).x.dims == ("run", "time")
    apart = batch.outputs.t + np.array([[0.0], [0.5]])
    moved = jax.tree.map(lambda a: apart if a is batch.outputs.t else a, batch)
    own = moved.to_dataset(BLOCK, batch=["case"])
    assert own.t.dims == own.x.dims == ("case", "row")


@pytest.mark.more
def test_the_motion_as_a_table_has_a_row_for_each_time(run, batch):
    """The dataset as a table had one for each time and event: 3,606 for 601."""
    table = run.to_dataframe(BLOCK)
    assert list(table.columns) == ["t", "mode", "x", "v"]
    np.testing.assert_array_equal(table.t, TIMES)
    np.testing.assert_array_equal(table.x, run.outputs.y.x)
    assert table.attrs["units"] == {"t": "s", "x": "m", "v": "m/s"}
    assert list(table["mode"][:7]) == ["stick"] * 6 + ["slip backward"]
    both = batch.to_dataframe(BLOCK)
    assert both.index.names == ["run", "row"]
    np.testing.assert_array_equal(both.loc[1].v, batch.outputs.y.v[1])
    ended = ss.simulate(BLOCK, 0.0, 1.0, Motion(x=0.0, v=0.2))
    with pytest.raises(ValueError, match=r"outputs = None: it must be a run that kept states"):
        ended.to_dataframe(BLOCK)


def test_the_events_as_a_table(batch, run):
    table = run.events.to_dataframe(BLOCK)
    assert list(table.columns) == [
        "t", "guard", "mode_before", "mode_after", "x_before", "v_before", "x_after", "v_after",
    ]  # fmt: skip
    assert list(table.mode_after[:2]) == ["slip backward", "stick"]
    np.testing.assert_array_equal(table.t, run.events.t[:6])
    assert table.attrs["units"]["v_after"] == "m/s"
    both = batch.events.to_dataframe(BLOCK)
    assert len(both) == int(batch.num_events.sum())
    np.testing.assert_array_equal(both.loc[1].x_after, batch.events.y_after.x[1][: len(both.loc[1])])
    assert both.index.names == ["run", "event"]


class Rod(NamedTuple):
    theta: Any
    parts: Any


class Turning(ss.AbstractSmoothSystem):
    """An angle, and three numbers in an array."""

    units: ClassVar = {"theta": "rad", "parts": "K"}
    periods: ClassVar = {"theta": 2 * math.pi}

    def vector_field(self, t, y, mode, args):
        return Rod(jnp.ones(()), -y.parts)


def test_arrays_and_periods():
    start = Rod(0.0, jnp.arange(3.0))
    run = ss.simulate(
        Turning(),
        0.0,
        1.0,
        start,
        saveat=ss.SaveAt(steps=True, max_events=None),
    )
    data = run.to_dataset(Turning())
    assert data.parts.dims == ("time", "parts_0")
    assert data.theta.attrs == {"units": "rad", "period": 2 * math.pi}
    assert data.sizes["time"] == int(run.steps.count)
    assert "event_t" not in data


def test_wrong_arguments(batch, run):
    with pytest.raises(TypeError, match="system = 3: it must be an AbstractHybridSystem"):
        run.to_dataset(3)
    with pytest.raises(ValueError, match=r"batch = .*: it must be 1 names of batch axes"):
        batch.to_dataset(BLOCK, batch=["a", "b"])
    with pytest.raises(ValueError, match=r"batch\['k'\] = .*: it must be of shape \(2,\)"):
        batch.to_dataset(BLOCK, batch={"k": [1.0]})
    with pytest.raises(TypeError, match=r"events = .*: it must be known"):
        jax.jit(lambda run: run.events.to_dataframe(BLOCK))(run)
