"""Declared chains of blocks: what a lane and a first call cost over their number, in two coordinates.

Places of the blocks have a diagonal mass matrix, distances between them a full one; the motions are the
same. And an arm of two links, whose inertia depends on its angles: first calls of a run, of its forward
and of its reverse derivative.
"""

import itertools
import statistics
import time
from collections.abc import Iterator
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact

from ..mechanisms.chain import COUPLING, MASS, PULL, Chain, uneven, weakening

INTEGRATOR = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-9))
LAW, BELT, END = weakening(), 0.1, 10.0


class Train(AbstractMechanism):
    """The chain with the distances between its blocks as coordinates."""

    places: Chain
    blocks: int = eqx.field(static=True)

    @property
    def coordinates(self):
        return {f"d_{i + 1}": "m" for i in range(self.blocks)}

    @property
    def contact_directions(self):
        n = self.blocks
        return {f"block {i + 1}": (1,) * (i + 1) + (0,) * (n - i - 1) for i in range(n)}

    def mass_matrix(self, q):
        n = self.blocks
        return tuple(tuple((n - max(i, j)) * self.places.mass for j in range(n)) for i in range(n))

    def forces(self, t, q, v, args):
        own = self.places.forces(t, tuple(itertools.accumulate(q)), v, args)
        return tuple(sum(own[i:]) for i in range(self.blocks))

    def contacts(self, t, q, v, args):
        return self.places.contacts(t, q, v, args)


class Arm(AbstractMechanism):
    """Two links of 1 m with dry joints, driven in both."""

    mass: Any
    coordinates: ClassVar = {"a": "rad", "b": "rad"}
    contact_directions: ClassVar = {"shoulder": (1, 0), "elbow": (-1, 1)}

    def mass_matrix(self, q):
        c = 0.5 * self.mass * jnp.cos(q.a - q.b)
        return ((4.0 / 3.0 * self.mass, c), (c, self.mass / 3.0))

    def forces(self, t, q, v, args):
        s = 0.5 * self.mass * jnp.sin(q.a - q.b)
        return 3.0 * jnp.sin(1.3 * t) - s * v.b**2, s * v.a**2 - 2.4 * jnp.sin(2.1 * t)

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(1.0, 0.7)), Contact(Coulomb(0.8, 0.5))]


def run_of(blocks: int, relative: bool) -> Any:
    """A lane: the places of the blocks after the run, and its events, over the speed of the belt."""
    first = uneven(blocks)

    def run(speed):
        machine: Any = Chain(MASS, PULL, COUPLING, LAW, speed, blocks)
        y0 = machine.at(first, speed)
        if relative:
            machine = Train(machine, blocks)
            gaps = np.diff(first, prepend=0.0)
            names = machine.names
            y0 = machine.state(**dict(zip(names.coordinates, gaps, strict=True)))
            y0 = y0._replace(**{names.velocities[0]: speed + 0.0})
        end = ss.simulate(
            machine, 0.0, END, y0, integrator=INTEGRATOR, saveat=ss.SaveAt(max_events=None), throw=False
        )
        x = jnp.stack(end.y1[:blocks])
        return jnp.cumsum(x) if relative else x, end.num_events

    return run


def first_call(call: Any) -> tuple[Any, float]:
    """Result of a first call, and its processor time [s]: nothing of it is compiled before."""
    begin = time.process_time()
    out = jax.block_until_ready(call())
    return out, time.process_time() - begin


def row(blocks: int, lanes: int, rounds: int, relative: bool) -> str:
    """One line of the table."""
    speeds = BELT * jnp.linspace(0.5, 2.0, lanes)
    forms = (False, True) if relative else (False,)
    programs = [ss.map_lanes(run_of(blocks, form)) for form in forms]
    firsts, times, outs = [], [], []
    for program in programs:
        out, seconds = first_call(lambda program=program: program(speeds))
        firsts.append(seconds)
        outs.append(out)
    for _ in range(rounds):
        now = []
        for program in programs:
            begin = time.process_time()
            jax.block_until_ready(program(speeds))
            now.append((time.process_time() - begin) / lanes)
        times.append(now)
    cost = [statistics.median(column) for column in zip(*times, strict=True)]
    line = (
        f"  {blocks:6d} {float(np.mean(outs[0][1])):8.1f} {1e6 * cost[0]:12.1f} "
        f"{firsts[0] - lanes * cost[0]:12.1f}"
    )
    if relative:
        ratio = statistics.median(b / a for a, b in times)
        apart = np.abs(np.asarray(outs[1][0]) - np.asarray(outs[0][0])).max(axis=1)
        line += (
            f" {1e6 * cost[1]:12.1f} {firsts[1] - lanes * cost[1]:12.1f} {ratio:8.2f} "
            f"{np.median(apart):9.0e}"
        )
    return line


def arm() -> str:
    """First calls of a run of the arm and of its derivatives, portable."""

    def end(mass):
        machine = Arm(mass)
        y0 = machine.state(a=0.3, b=-0.4, v_a=1.0)
        return ss.simulate(machine, 0.0, 6.0, y0, saveat=ss.SaveAt(max_events=None), throw=False).y1.a

    mass = jnp.asarray(1.0)
    calls = [jax.jit(end), jax.jit(jax.jacfwd(end)), jax.jit(jax.grad(end))]
    found = [first_call(lambda call=call: call(mass)) for call in calls]
    plain, forward, reverse = (seconds for _, seconds in found)
    return (
        f"Arm, inertia of its angles, first call: run {plain:.1f} s, forward {forward:.1f} s, reverse "
        f"{reverse:.1f} s ({reverse / plain:.1f} of the run, {reverse / forward:.1f} of forward); "
        f"slopes {float(found[1][0]):.6f}, {float(found[2][0]):.6f}"
    )


def main(size: str) -> Iterator[str]:
    """A line for each number of blocks."""
    lanes = 256 if size == "quick" else 2048
    rounds = 3
    yield (
        "Chain of blocks on a belt, 10 s, fused: processor time of a lane [microseconds] and of "
        "tracing and compiling [s]\n"
        f"  {'blocks':>6s} {'events':>8s} {'places':>12s} {'first call':>12s} {'distances':>12s} "
        f"{'first call':>12s} {'ratio':>8s} {'apart, m':>9s}"
    )
    for blocks in (2, 4) if size == "quick" else (2, 4, 8, 16, 20):
        yield row(blocks, lanes, rounds, relative=size == "full" or blocks <= 8)
    yield arm()
