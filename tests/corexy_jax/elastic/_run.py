"""One compiled program for all tests of the elastic machine."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import corexy_jax as cx
import stickslip as ss
from corexy_jax.elastic import Belts, ElasticCoreXY, Frame, Stepper

ROWS = 41
FRICTIONLESS = {"mu_s": 0.0, "mu_k": 0.0}


class Still(eqx.Module):
    """A command that moves evenly."""

    x: Any = 0.0
    y: Any = 0.0
    vx: Any = 0.0
    vy: Any = 0.0

    def __call__(self, t, args):
        return (self.x + self.vx * t, self.y + self.vy * t), (self.vx, self.vy)


class Mixed(eqx.Module):
    """Steppers, sines of 10 and 5 V at 0.5 Hz, and a steady torque, each with a share."""

    stepper: Stepper
    share: Any = 0.0
    volts: Any = 0.0
    load: Any = 0.0

    def __call__(self, t, angles, speeds, args):
        p = cx.CoreXYParameters()
        steps = self.stepper(t, angles, speeds, args)
        phase = jnp.pi * t
        driven = (jnp.sin(phase), 0.5 * jnp.sin(phase))
        one, two = (
            self.share * a + p.K_t / p.R * self.volts * (10.0 * u - p.K_e * w) + part
            for a, u, w, part in zip(steps, driven, speeds, (self.load, 0.0), strict=True)
        )
        return one, two


def belts(k: Any, retardation: Any = 0.0, side: Any = 0.4) -> Belts:
    """Belts of a stiffness [N/m] in the middle of a square frame."""
    frame = Frame(side, side)
    a, b, *_ = frame.lengths(0.0, 0.0)
    stiffness = k / (1.0 / a + 1.0 / b)
    return Belts(frame, stiffness, stiffness, retardation)


def mixed(path: Any = None, torque: Any = 1.0, damping: Any = 0.0, **shares: Any) -> Mixed:
    path = Still() if path is None else path
    stepper = Stepper(path, torque, 0.05, damping=damping)
    return jax.tree.map(jnp.asarray, Mixed(stepper, **{k: float(v) for k, v in shares.items()}))


@jax.jit
def _run(machine, y0, ts):
    rule = ss.AdaptiveStep(1e-10, 1e-12)
    return ss.simulate(
        machine, 0.0, ts[-1], y0, integrator=ss.Integrator("dop853", rule, max_steps=200_000),
        saveat=ss.SaveAt(ts=ts, max_events=None), throw=False,
    )  # fmt: skip


def run(p: cx.CoreXYParameters, belts: Belts, drive: Mixed, y0: Any, t1: float) -> tuple[Any, Any]:
    """The machine and its run, with outputs at `ROWS` times."""
    machine = ElasticCoreXY(p, belts, drive)
    y0 = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y0)
    found = _run(machine, y0, jnp.asarray(np.linspace(0.0, t1, ROWS)))
    assert found.successful, found
    return machine, found
