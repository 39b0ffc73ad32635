"""The trial behind `_canary`: run as a program, it prints "fused agrees" if it does."""

import concurrent.futures
import functools
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from ..hybrid import FixedStep, Integrator, SaveAt, Section, simulate
from ..hybrid.system import AbstractHybridSystem
from .lanes import map_lanes


class _State(NamedTuple):
    x: Any
    v: Any


class _Block(AbstractHybridSystem):
    belt_speed: Any
    mode_names: ClassVar = ("stick", "slip")
    guard_names: ClassVar = ("breaks loose", "sticks")

    def vector_field(self, t, y, mode, args):
        return _State(y.v, jnp.where(mode == 0, 0.0, 0.5 - jnp.sin(y.x)))

    def guards(self, t, y, mode, args):
        return jnp.where(mode == 0, 0.8 - y.x, 1.0), jnp.where(mode == 0, 1.0, self.belt_speed - y.v)

    def transition(self, t, y, mode, guard, args):
        return _State(y.x, self.belt_speed), 1 - mode

    def initial_mode(self, t, y, args):
        return 0


def _lane(belt_speed, reverse):
    section = Section(lambda system, t, y, dy, mode, args: y.x - 0.3, "rising")

    def run(belt_speed, saveat) -> Any:
        start = _State(0.0 * belt_speed, belt_speed)
        integrator = Integrator("rk4", FixedStep(0.05), max_steps=512)
        block = _Block(belt_speed)
        return simulate(
            block, 0.0, 12.0, start, 0, integrator=integrator, saveat=saveat, throw=False
        )  # fmt: skip

    def end(belt_speed):
        # Without logs: the tape of reverse mode has rows too, and to compile both takes seconds.
        return run(belt_speed, SaveAt(max_events=None)).y1.x

    whole = run(belt_speed, SaveAt(sections=section, max_events=8, max_crossings=8))
    forward = jax.jvp(end, (belt_speed,), (1.0,))[1]
    slope = jax.grad(end)(belt_speed) if reverse else forward
    return whole.y1.x, whole.events.t, whole.crossings[0].t, forward, slope


def main() -> None:
    """Compare both executors on 128 lanes; slopes in reverse with those forward."""
    speeds = jnp.linspace(0.2, 0.4, 128)

    def found(executor):
        lane = functools.partial(_lane, reverse=executor == "fused")
        return map_lanes(lane, executor=executor)(speeds)

    # Side by side, because the compiler leaves cores idle.
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        fused, portable = pool.map(found, ("fused", "portable"))
    for a, b in zip(jax.tree.leaves(fused), jax.tree.leaves(portable), strict=True):
        if not bool(jnp.all((jnp.abs(a - b) < 1e-9) | (jnp.isnan(a) & jnp.isnan(b)))):
            raise SystemExit("fused and portable disagree")
    print("fused agrees")


if __name__ == "__main__":
    main()
