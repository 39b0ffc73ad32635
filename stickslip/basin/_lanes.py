"""Many motions of one system that go on together, a span at a time."""

from collections.abc import Callable
from copy import copy
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from .._outcome import names_of
from ..continuation import Shooting
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, simulate
from ..hybrid.system import mode_type
from ..hybrid.tree import with_float_arrays
from ..sweep import map_lanes
from ._accuracy import ACCURACY


class Moved(NamedTuple):
    """Motions at the end of a span: flat states `[lane, size]`, modes, whether all rates are zero."""

    t: Any
    y: Any
    mode: Any
    still: Any
    successful: Any
    result: Any


class Lanes:
    """The program that moves flat states on; one for all numbers that the system holds."""

    def __init__(
        self, system: AbstractHybridSystem, args: PyTree, integrator: Integrator | None, y0: PyTree
    ):
        self.system, self.args = with_float_arrays((system, args))
        self.integrator = Integrator() if integrator is None else integrator
        self.shooting, self.mode_type = Shooting(integrator=_finer(integrator)), mode_type(system)
        row, back = ravel_pytree(y0)
        self.size, self.unravel = len(row), cast(Callable[[Any], PyTree], back)
        self.numbers, self.rest = eqx.partition((self.system, self.args), eqx.is_array)
        self.program = map_lanes(self.run)
        self.block = ACCURACY.block

    @property
    def few(self) -> "Lanes":
        """The same with a program for few motions."""
        lanes = copy(self)
        lanes.block = ACCURACY.many
        return lanes

    def run(self, numbers, t0, t1, y, mode):
        """`motion_of` by the numbers of a system."""
        system, args = eqx.combine(numbers, self.rest)
        return motion_of(system, args, self.integrator, self.unravel, t0, t1, y, mode)

    def __call__(self, t0: Any, t1: Any, y: Any, mode: Any) -> Moved:
        """Motions from `t0` to `t1` [s], one time for all or one for each lane."""
        count = len(y)
        t0, t1 = (np.broadcast_to(np.asarray(t, float), count) for t in (t0, t1))
        found = []
        # In blocks of one size, whose last is filled up with motions of no duration: one program.
        for begin in range(0, count, self.block):
            place = np.arange(begin, begin + self.block)
            here = np.minimum(place, count - 1)
            end = np.where(place < count, t1[here], t0[here])
            numbers = jax.tree.map(
                lambda a: np.broadcast_to(np.asarray(a), (self.block, *np.shape(a))), self.numbers
            )
            block = self.program(numbers, t0[here], end, y[here], np.asarray(mode)[here])
            block = block._replace(result=names_of(block.result))
            kept = min(count - begin, self.block)
            found.append(Moved(*(np.asarray(a)[:kept] for a in block)))
        return Moved(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _finer(integrator: Integrator | None) -> Integrator | None:
    """For orbits, which Newton's method closes to more digits than a motion has by its tolerance."""
    step: Any = None if integrator is None else integrator.step
    if step is None or not step.adaptive:
        return integrator
    tolerances = {name: getattr(step, name) for name in ("rtol", "atol")}
    finer = [ACCURACY.near**2 * value for value in tolerances.values() if value is not None]
    names = [name for name, value in tolerances.items() if value is not None]
    return eqx.tree_at(lambda i: [getattr(i.step, name) for name in names], integrator, finer)


def motion_of(system: Any, args: Any, integrator: Any, unravel: Any, t0, t1, y, mode) -> Moved:
    """One motion from `t0` to `t1` [s]; a mode below zero is the system's own."""
    state, kind = unravel(y), mode_type(system)
    own = jnp.asarray(system.initial_mode(t0, state, args), kind)
    found = simulate(
        system, t0, t1, state, jnp.where(mode < 0, own, mode.astype(kind)), args,
        integrator=integrator, saveat=SaveAt(max_events=None), throw=False,
    )  # fmt: skip
    still = [jnp.all(leaf == 0.0) for leaf in jax.tree.leaves(found.dy1)]
    return Moved(
        found.t1, ravel_pytree(found.y1)[0], found.mode1, jnp.all(jnp.stack(still)),
        found.successful, found.result,
    )  # fmt: skip


def flat(y: PyTree) -> np.ndarray:
    """A state as a row of numbers."""
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(y)])


def rows_of(tree: PyTree, count: int) -> np.ndarray:
    """States with axes in front that have `count` places, as rows of numbers `[place, size]`."""
    leaves = [np.asarray(leaf).reshape(count, -1) for leaf in jax.tree.leaves(tree)]
    return np.concatenate(leaves, axis=1)
