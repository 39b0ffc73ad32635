"""The jointed beam as the figures use it: both readings of the equations, constructed parameters."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

import stickslip as ss
from stickslip.sweep import Compute, Labels, Storage, Variable
from stickslip.systems import JointedBeam, JointedBeamState

from .._experiment import Context

VARIANTS = ("consistent", "as printed")
STICK = JointedBeam.mode_names.index("stick")
CONTACT_PERIOD = 0.5405  # of x with the constructed parameters, pi sqrt(m/(k2+k3)) + pi sqrt(m/k2)
CAPTION = (
    "Constructed parameters: the paper's table is lost. Dimensionless. Equations consistent (C-E1 to "
    "C-E4 corrected) or as printed; no damping (C-E5). {modes} modes."
)


def system_of(variant: str, v: Any, modes: int = 5, **changes: Any) -> JointedBeam:
    """The system at belt speed `v` in one reading of the equations."""
    build = JointedBeam.constructed if variant == "consistent" else JointedBeam.printed
    return build(v, modes=modes, **changes)


def fixed_step(h: float) -> ss.Integrator:
    """For sweeps: order 8, which leaves the fastest mode its amplitude."""
    return ss.Integrator("dop853", ss.FixedStep(h), max_steps=100_000_000)


def accurate() -> ss.Integrator:
    """For single motions; the beam's coordinates are small, so the absolute tolerance is."""
    return ss.Integrator("dop853", ss.AdaptiveStep(1e-10, 1e-16), max_steps=10_000_000)


def norm_of(system: JointedBeam) -> JointedBeamState:
    """Units in which an oscillation of the beam or of the mass has one size all the time."""
    one, swing = jnp.ones(()), jnp.sqrt(system.k1 / system.m)
    bounce = jnp.sqrt(system.k2 / system.m)
    return JointedBeamState(one, bounce, one, swing, jnp.ones(system.modes), system.frequencies())


# The sections L_i' = 0; `args` is the system, which knows its joint.
SECTIONS = {
    "x": lambda system, t, y, dy, mode, args: y.vx,
    "y": lambda system, t, y, dy, mode, args: y.vy,
    "w": lambda system, t, y, dy, mode, args: system.w_rate(t, y),
}


def stick_section() -> ss.Section:
    """Beginnings of stick: the mode jumps over zero."""
    return ss.Section(
        lambda system, t, y, dy, mode, args: jnp.where(mode == STICK, 1.0, -1.0), "rising", name="stick"
    )


def sweep_options(
    kind: str,
    variant: str,
    settings: Mapping[str, Any],
    context: Context,
    *,
    chunk: int,
    variables: Mapping[str, Variable],
    executor: Any = "auto",
) -> dict[str, Any]:
    """Where a sweep is kept, how it is labelled, and how it reports."""
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:8]
    path = context.stores / f"beam-{kind}-{variant.replace(' ', '-')}-{digest}"
    return {
        "store": Storage(path, chunk=chunk, resume=not context.fresh),
        "labels": Labels(variables, settings=dict(settings), name=f"{kind}, {variant}"),
        "compute": Compute(executor),
    }
