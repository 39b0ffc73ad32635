"""CoreXY: one scenario and 10,000 of them, against the same fixed-step algorithm in numba.

The fixed-step algorithm takes 60,000 steps of 1e-4 s for 6 s; the event-driven motion needs some
hundred. Errors: of the end position [m], for the algorithm against its form in numba, for the motion
against one with tolerance 1e-11.
"""

import os
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import corexy_jax as cx
import stickslip as ss

from ._corexy_numba import ENDS, NAMES, kernel
from ._harness import Candidate, absent, interleave, table

DT, END = 1e-4, 6.0
STEPS = round(END / DT)
TOLERANCE = 1e-6


def machines(lanes: int) -> np.ndarray:
    """Numbers of machines around scenario 1, `[lane, 21]`: tensions, voltages, belt friction vary."""
    p, v = cx.scenario(1)
    base = np.array([float(getattr(p if hasattr(p, name) else v, name)) for name in NAMES])
    table = np.tile(base, (lanes, 1))
    rng = np.random.default_rng(0)
    for name, low, high in (
        ("P1", 10.0, 40.0), ("P2", 10.0, 40.0), ("v01", 5.0, 20.0), ("v02", 2.0, 10.0),
        ("mu_1s_b", 0.2, 4.0), ("mu_2s_b", 0.2, 4.0),
    ):  # fmt: skip
        table[1:, NAMES.index(name)] = rng.uniform(low, high, lanes - 1)
    return table


def built(numbers):
    """Parameters and voltage of one lane."""
    values = dict(zip(NAMES, numbers, strict=True))
    wave = cx.Harmonic(*(values.pop(name) for name in ("v01", "v02", "frequency")))
    return cx.CoreXYParameters(**values), wave


def as_printed(numbers):
    """`ENDS` of one lane by the paper's algorithm in JAX."""
    p, v = built(numbers)
    found = cx.simulate_as_printed(p, v, END, rows=2, dt=DT)
    y, work = found.y, found.ledger
    ends = (y.x, y.y, y.vx, y.vy, y.omega_1, y.omega_2, work.motor_1, work.motor_2)
    return jnp.stack([*(a[-1] for a in ends), work.friction[-1, 6], work.friction[-1, 7]])


def consistent(tolerance):
    """Function of one lane: end position, speeds, by the events."""
    step = ss.AdaptiveStep(tolerance, tolerance)
    integrator = ss.Integrator(method="tsit5", step=step, max_steps=1_000_000)

    def lane(numbers):
        system = cx.CoreXY(*built(numbers))
        found = ss.simulate(
            system, 0.0, END, system.state(), integrator=integrator,
            saveat=ss.SaveAt(max_events=None), throw=False,
        )  # fmt: skip
        y = found.y1
        return jnp.where(found.successful, jnp.stack([y.x, y.y, y.omega_1, y.omega_2]), jnp.nan)

    return lane


def _ready(program, *inputs):
    return lambda: jax.block_until_ready(program(*inputs))


def by_numba() -> Callable[[Any], np.ndarray] | None:
    """`ENDS` of machines by numba on all cores; `None` where numba is absent."""
    if absent("numba"):
        return None
    run = kernel(os.cpu_count() or 1)

    def call(numbers):
        numbers = np.asarray(numbers)
        end = np.zeros((len(numbers), len(ENDS)))
        run(numbers, end, STEPS, DT)
        return end

    return call


def main(size: str = "normal") -> str:
    """Two tables: a single scenario, and many."""
    lanes = {"quick": 256, "normal": 10_000, "full": 10_000}[size]
    part = {"quick": 64, "normal": 512, "full": 10_000}[size]  # of the lanes for the fixed step
    plain, missing = by_numba(), ["numba"] if absent("numba") else []
    numbers = jnp.asarray(machines(lanes))
    one = "one scenario, 6 s", numbers[:1], numbers[:1], lambda f: jax.jit(jax.vmap(f))
    many = f"{lanes} scenarios, 6 s each", numbers, numbers[:part], ss.map_lanes
    return "\n\n".join(_compare(*job, plain, missing, size) for job in (one, many))


def _compare(title, numbers, few, mapped, plain, missing, size) -> str:
    share = len(few) / len(numbers)
    printed, motion, exact = (mapped(f) for f in (as_printed, consistent(TOLERANCE), consistent(1e-11)))
    error = _off(motion(few)[:, :2], exact(few)[:, :2])
    rows, gap = [], None
    if plain is not None:
        rows.append(Candidate("numba, as printed", lambda: plain(few), share=share))
        gap = _off(printed(few)[:, :2], plain(few)[:, :2])
    rows.append(Candidate("as printed", _ready(printed, few), gap, share=share))
    rows.append(Candidate(f"consistent, {TOLERANCE:g}", _ready(motion, numbers), error))
    return table(title, interleave(rows, 1 if size == "quick" else 3), missing)


def _off(found, truth) -> float:
    """Median over the lanes of the largest error of the end position [m]."""
    return float(np.median(np.max(np.abs(np.asarray(found) - np.asarray(truth)), axis=1)))
