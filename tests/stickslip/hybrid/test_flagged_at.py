"""A run that has no derivative says at which guard that was seen first, and when."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss

MISSED = 1.0 + 1e-9
NEVER = 2.0
HALF = np.pi / 2.0


class Hands(ss.AbstractHybridSystem):
    """x = sin(t), y = sin(t - 1), each with a wall; z = 1e-7 exp(-4 t) is nearest to zero."""

    walls: Any

    mode_names: ClassVar = ("runs",)
    guard_names: ClassVar = ("x meets its wall", "y meets its wall", "z ends")
    guard_scales: ClassVar = (1.0, 1.0, 1.0)

    def vector_field(self, t, y, mode, args):
        return {"x": y["u"], "u": -y["x"], "y": y["v"], "v": -y["y"], "z": -4.0 * y["z"]}

    def guards(self, t, y, mode, args):
        return self.walls[0] - y["x"], self.walls[1] - y["y"], y["z"]

    def transition(self, t, y, mode, guard, args):
        far = jnp.where(guard == jnp.arange(2, dtype=guard.dtype), 9.0, 0.0)
        return {**y, "x": y["x"] - far[0], "y": y["y"] - far[1]}, mode

    def initial_mode(self, t, y, args):
        return 0


def run(walls):
    start = {"x": 0.0, "u": 1.0, "y": -np.sin(1.0), "v": np.cos(1.0), "z": 1e-7}
    return ss.simulate(Hands(walls), 0.0, 2.8, start, throw=False)


@pytest.mark.more
def test_the_first_flag_names_its_guard_and_time():
    cases = [
        ((NEVER, NEVER), 0, np.nan, -1),
        ((MISSED, NEVER), 1, HALF, 0),
        ((NEVER, MISSED), 1, 1.0 + HALF, 1),
        ((MISSED, MISSED), 1, HALF, 0),
        # After an event z, which is as good as zero, is flagged too.
        ((NEVER, -0.9), 4 | 1, 0.0, 1),
        ((-0.1, MISSED), 4 | 1, 0.0, 0),
    ]
    walls, flags, times, guards = map(np.asarray, zip(*cases, strict=True))
    found = jax.vmap(run)(walls)
    np.testing.assert_array_equal(found.flags, flags)
    np.testing.assert_array_equal(found.flagged_guard, guards)
    np.testing.assert_allclose(found.flagged_at, times, atol=0.05)  # within a step

    both = run(np.array([np.sin(0.8), -np.sin(0.2)]))
    assert int(both.flags) & 2
    np.testing.assert_allclose(both.flagged_at, 0.8, rtol=1e-8)
    assert int(both.flagged_guard) in (0, 1)

    # A program for many lanes keeps the same numbers.
    def first(walls):
        solution = run(walls)
        return solution.flagged_at, solution.flagged_guard

    at, guard = ss.map_lanes(first, executor="fused")(walls)
    np.testing.assert_allclose(at, found.flagged_at, rtol=1e-3)
    np.testing.assert_array_equal(guard, found.flagged_guard)

    second = jax.tree.map(lambda a: a[2], found)
    words = f"(first at t = {float(second.flagged_at):.6g} s, guard 'y meets its wall')"
    assert words in str(second)
    assert words in second._repr_html_().replace("&#x27;", "'")
    assert "first at" not in str(jax.tree.map(lambda a: a[0], found))
    table = found.to_dataset(Hands(walls[0]))
    assert table.flagged_at.attrs["units"] == "s"
    np.testing.assert_array_equal(table.flagged_guard, guards)
