"""Two blocks on rough ground, joined by a spring, the first under random loads: either may rest."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from tests.stickslip.hybrid._loads import END, random_loads

STATIC, MOVING = (1.0, 0.4), (0.5, 0.2)  # [N] friction of the two at rest and in motion
SPRING, TIE = 2.0, 0.5  # [N/m] between the blocks, of each to the ground


class Positions(NamedTuple):
    x1: Any
    v1: Any
    x2: Any
    v2: Any


class TwoBlocks(ss.AbstractHybridSystem):
    """1 kg each; the mode is 3 (s1 + 1) + s2 + 1, with s the direction of motion, 0 at rest."""

    load: Any

    mode_names: ClassVar = tuple(f"{a}{b}" for a in "-0+" for b in "-0+")
    guard_names: ClassVar = ("1 stops", "2 stops", "1 forth", "1 back", "2 forth", "2 back")

    def _forces(self, t, y):
        pull = SPRING * (y.x2 - y.x1)
        return self.load(t) + pull - TIE * y.x1, -pull - TIE * y.x2

    @staticmethod
    def _senses(mode):
        mode = jnp.asarray(mode, jnp.int32)
        return (mode // 3 - 1).astype(float), (mode % 3 - 1).astype(float)

    def vector_field(self, t, y, mode, args):
        speeds = [
            jnp.where(s == 0.0, 0.0, force - moving * s)
            for s, force, moving in zip(self._senses(mode), self._forces(t, y), MOVING, strict=True)
        ]
        return Positions(y.v1, speeds[0], y.v2, speeds[1])

    def guards(self, t, y, mode, args):
        senses, forces = self._senses(mode), self._forces(t, y)
        stops = [jnp.where(s == 0.0, 1.0, s * v) for s, v in zip(senses, (y.v1, y.v2), strict=True)]
        starts = [
            jnp.where(s == 0.0, static - way * force, 1.0)
            for s, force, static in zip(senses, forces, STATIC, strict=True)
            for way in (1.0, -1.0)
        ]
        return (*stops, *starts)

    def transition(self, t, y, mode, guard, args):
        senses = []
        for i, (s, force) in enumerate(zip(self._senses(mode), self._forces(t, y), strict=True)):
            go = jnp.where(force > STATIC[i], 1.0, jnp.where(force < -STATIC[i], -1.0, 0.0))
            s = jnp.where(guard == i, go, s)
            s = jnp.where(guard == 2 + 2 * i, 1.0, s)
            senses.append(jnp.where(guard == 3 + 2 * i, -1.0, s))
        y = y._replace(v1=jnp.where(guard == 0, 0.0, y.v1), v2=jnp.where(guard == 1, 0.0, y.v2))
        return y, (3.0 * (senses[0] + 1.0) + senses[1] + 1.0).astype(jnp.int32)

    def initial_mode(self, t, y, args):
        return 4


@pytest.mark.more
@pytest.mark.parametrize("number", [30, pytest.param(1000, marks=pytest.mark.slow)])
def test_two_blocks_under_random_loads_end_as_with_tiny_steps_or_are_flagged(number):
    loads, kinds = random_loads(number, seed=5)

    def ends(step):
        @jax.jit
        @jax.vmap
        def run(load):
            return ss.simulate(
                TwoBlocks(load), 0.0, END, Positions(0.0, 0.0, 0.0, 0.0), 4, throw=False,
                integrator=ss.Integrator(step=step), saveat=ss.SaveAt(max_events=None),
            )  # fmt: skip

        found = run(loads)
        return np.stack(jax.tree.leaves(found.y1)), np.asarray(found.num_events), found

    y, events, run = ends(ss.AdaptiveStep(1e-10))
    exact, true_events, _ = ends(ss.AdaptiveStep(1e-11, 1e-13, dtmax=2e-3))
    flags = np.asarray(run.flags)
    off = np.abs(y - exact).max(0) > 1e-6 * (1e-2 + np.abs(exact).max(0))
    off |= events != true_events
    assert np.all(run.successful)
    assert not np.any(off & (flags == 0)), kinds[off & (flags == 0)]
    assert events.sum() > 10 * number
    # Where no load jumps undeclared a flag is an exception.
    assert np.mean(flags[~np.isin(kinds, ["steps", "all"])] != 0) < 0.05
