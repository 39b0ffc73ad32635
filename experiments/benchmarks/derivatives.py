"""Cost of exact derivatives through events, against the plain simulation of the same job."""

import jax
import jax.numpy as jnp

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

from ._harness import Candidate, interleave, table

END = 50.0


def main(size: str = "normal") -> str:
    """Table: plain, forward in 1, 3 and 8 parameters, reverse in 8."""
    lanes = 1280 if size == "quick" else 6400
    speeds = jnp.linspace(0.2, 0.4, lanes)
    nominal = jnp.array([0.0, 1.0, 0.5, 1.0, 1.0, 0.0, 0.0, 0.0])

    def end(speed, p):
        # Eight parameters: belt speed, forces, mass, spring, initial state and duration.
        system = CoulombOscillator(p[3], p[4], p[1], p[2], speed + p[0])
        start = Motion(p[5], speed + p[0] + p[6])
        step = ss.FixedStep(0.35)
        run = ss.simulate(
            system, 0.0, END + p[7], start, "stick", saveat=ss.SaveAt(max_events=None), throw=False,
            integrator=ss.Integrator(step=step, max_steps=1024),
        )  # fmt: skip
        return run.y1.x

    def forward(count):
        def slopes(speed):
            def shifted(q):
                return end(speed, nominal.at[:count].add(q))

            return jax.jacfwd(shifted)(jnp.zeros(count))

        return slopes

    jobs = {
        "plain": lambda speed: end(speed, nominal),
        "forward, 1 parameter": forward(1),
        "forward, 3 parameters": forward(3),
        "forward, 8 parameters": forward(8),
        "reverse, 8 parameters": lambda speed: jax.grad(end, argnums=1)(speed, nominal),
    }
    programs = {name: ss.map_lanes(job) for name, job in jobs.items()}
    candidates = [
        Candidate(name, lambda program=program: jax.block_until_ready(program(speeds)))
        for name, program in programs.items()
    ]
    rows = interleave(candidates, 5)
    return table(f"Derivatives of x({END:g}) of {lanes} stick-slip motions", rows, [])
