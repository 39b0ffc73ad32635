"""Period and largest exponent of many parameter sets at once, simplified and full model."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.analysis._attractor import period_of
from stickslip.friction import SmoothHyperbolicWeakening
from stickslip.systems import BlockOnBelt, BlockOnDrivenBelt, BlockState, DCDrive, DrivenBlockState

# What the search varies, with the values of set A and how far a first guess strays from them (the
# standard deviation of the logarithm). J and Q are factors of 3 M r^2 and of -3/4 M g r.
NAMES = {
    "M": (0.21, 0.15), "k1": (17.0, 0.2), "k2": (11.0, 0.2), "c1": (0.9965, 0.2), "c2": (0.035, 0.3),
    "mu_0": (0.26, 0.15), "alpha": (190.0, 0.3), "beta": (0.9, 0.3), "gamma": (1.75, 0.3),
    "V_b": (0.12, 0.15), "J_factor": (1.0, 0.1), "Q_factor": (1.0, 0.05),
    "J_dc": (5e-5, 0.7), "r_bp": (0.03, 0.3), "R_w": (2.0, 0.4),
}  # fmt: skip
MASS, RADIUS, GRAVITY = 0.20, 0.25, 9.81
ROOM = 192  # maxima in transient and record together
# Periods are counted in maxima of x: the acceleration also crosses zero on a belt that is not steady.
MAXIMA = ss.Section(lambda t, y, dy, mode, args: y.vx, "falling", name="maximum of x")


def start_values() -> np.ndarray:
    """Set A with its drive, in the order of `NAMES`."""
    return np.array([value for value, _ in NAMES.values()])


def spreads() -> np.ndarray:
    """Standard deviations of the logarithms."""
    return np.array([spread for _, spread in NAMES.values()])


def mechanics(p: Any, k3: Any) -> dict[str, Any]:
    """Arguments of a block for the values `p` in the order of `NAMES`."""
    q = dict(zip(NAMES, p, strict=True))
    return {
        "m": MASS, "M": q["M"], "J": q["J_factor"] * 3.0 * q["M"] * RADIUS**2, "k1": q["k1"],
        "k2": q["k2"], "k3": k3, "c1": q["c1"], "c2": q["c2"], "r": RADIUS,
        "Q": q["Q_factor"] * -0.75 * q["M"] * GRAVITY * RADIUS, "g": GRAVITY,
        "law": SmoothHyperbolicWeakening(q["mu_0"], q["alpha"], q["beta"], q["gamma"]),
    }  # fmt: skip


def simplified(p: Any, k3: Any, pull: Any = 0.0):
    """Simplified model and its initial state."""
    make: Any = BlockOnBelt
    return make(V_b=p[list(NAMES).index("V_b")], **mechanics(p, k3)), BlockState(0.0, 0.0, 0.0, 0.0)


def with_drive(sign: str):
    """Full model, driven so that the belt runs at `V_b` on average if the mean friction is `pull`."""

    def build(p, k3, pull):
        q = dict(zip(NAMES, p, strict=True))
        changes = {"J_dc": q["J_dc"], "r_bp": q["r_bp"], "R_w": q["R_w"], "belt_reaction": sign}
        drive = DCDrive.constructed(**changes)
        omega = q["V_b"] / drive.transmission
        current = (drive.b * omega + drive.T_k - drive.reaction * pull) / drive.k_m
        drive = DCDrive.constructed(**changes, U_in=drive.k_e * omega + drive.R_w * current)
        make: Any = BlockOnDrivenBelt
        return make(drive=drive, **mechanics(p, k3)), DrivenBlockState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    return build


def look(
    build: Callable,
    *,
    transient: float,
    duration: float,
    segments: int,
    tolerance: float,
    executor: str,
) -> ss.map_lanes:
    """Mapped function of (parameters, k3, pull): period, exponent, whether it lifted off, or failed.

    The exponent [1/s] is the mean growth of a tangent over `segments` seconds after five more; NaN
    with `segments = 0`.
    """
    step: Any = ss.AdaptiveStep
    integrator = ss.Integrator("tsit5", step(tolerance, 0.1 * tolerance), max_steps=2_000_000)
    options: Any = {"integrator": integrator, "max_events": None, "throw": False}

    def lane(p, k3, pull):
        system, start = build(p, k3, pull)
        # One run for transient and record: XLA aborts on some programs with one that records beside
        # one that does not, see `map_lanes`.
        run: Any = ss.simulate(
            system, 0.0, transient + duration, start, sections=MAXIMA,
            max_crossings=ROOM, **options,
        )  # fmt: skip
        rows = run.crossings[0]
        early = jnp.sum(rows.t < transient, dtype=rows.count.dtype)
        count = rows.count - early
        points = jnp.roll(jnp.stack([rows.y.x, rows.y.y], axis=1), -early, axis=0)
        period, _ = period_of(points, count, tolerance=5e-3, max_period=16)
        normal = jax.vmap(lambda t, y: system.normal_force(t, y))(rows.t, rows.y)
        lifted = jnp.any((rows.t >= transient) & (normal < 0.0))
        ok = run.successful & (count >= 8)

        def grow(carry, _):
            y, v = carry

            def flow(y):
                return ss.simulate(system, 0.0, 1.0, y, run.mode1, **options).y1

            y, v = jax.jvp(flow, (y,), (v,))
            length = jnp.sqrt(sum(c * c for c in v))
            return (y, jax.tree.map(lambda c: c / length, v)), jnp.log(length)

        if segments:
            tangent = jax.tree.map(jnp.ones_like, run.y1)
            growth = jax.lax.scan(grow, (run.y1, tangent), None, length=segments + 5)[1]
            exponent = growth[5:].mean()
        else:
            exponent = jnp.full((), jnp.nan)
        return {"period": period, "exponent": exponent, "lifted": lifted, "ok": ok}

    return ss.map_lanes(lane, executor=executor)


def mean_friction(executor: str) -> ss.map_lanes:
    """Mapped function of (parameters, k3): mean of T_s [N] from 40 s to 60 s, simplified model."""
    step: Any = ss.AdaptiveStep
    integrator = ss.Integrator("tsit5", step(1e-6, 1e-7), max_steps=2_000_000)
    times = jnp.linspace(40.0, 60.0, 401)

    def lane(p, k3):
        system, start = simplified(p, k3)
        run: Any = ss.simulate(
            system, 0.0, 60.0, start, integrator=integrator, saveat=ss.SaveAt(ts=times),
            max_events=None, throw=False,
        )  # fmt: skip
        # The block's acceleration is zero on average: friction balances its load.
        return -jax.vmap(lambda y: system.loads(y).on_block)(run.outputs.y).mean()

    return ss.map_lanes(lane, executor=executor)
