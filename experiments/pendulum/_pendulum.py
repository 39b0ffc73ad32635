r"""The pendulum as a declared mechanism, and a problem for each law of its bearing.

$$\ddot\varphi = -\omega_0^2\sin\varphi - \kappa\,\dot\varphi - \beta\,|\dot\varphi|\dot\varphi
  - \tau\,\mathrm{Sgn}\,\dot\varphi$$

A free swing shows forces per inertia only: gravity, viscous, dry and quadratic drag.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import Fit, Observed, Problem, Record, Unknown
from stickslip.mechanism import AbstractMechanism, Contact

from ._record import STEP, Segment

TERMS = {
    "gravity": ("1/s²", None), "viscous": ("1/s", 0.05), "dry": ("rad/s²", 0.05),
    "quadratic": ("1", 0.01), "zero": ("rad", 0.0),
}  # fmt: skip
LAWS = {
    "viscous": ("viscous",),
    "dry": ("dry",),
    "viscous and dry": ("viscous", "dry"),
    "viscous, dry and quadratic": ("viscous", "dry", "quadratic"),
}
SIGMA = 2e-3  # of an angle: what the residuals show [rad]
FIRST = 100  # samples that give the state at the begin of a segment


class Pendulum(AbstractMechanism):
    """A pendulum per unit of its inertia; without `dry` friction it has no contact."""

    gravity: Any  # [1/s²]
    viscous: Any  # [1/s]
    quadratic: Any  # [1]
    dry: Any  # [rad/s²]
    zero: Any  # what the encoder shows when it hangs [rad]
    rubs: bool = eqx.field(static=True)
    coordinates: ClassVar = {"phi": "rad"}

    @property
    def contact_directions(self):
        return {"bearing": {"phi": 1}} if self.rubs else {}

    def mass_matrix(self, q):
        return {"phi": 1.0}

    def forces(self, t, q, v, args):
        drag = self.viscous * v.phi + self.quadratic * jnp.abs(v.phi) * v.phi
        return {"phi": -self.gravity * jnp.sin(q.phi) - drag}

    def contacts(self, t, q, v, args):
        return {"bearing": Contact(Coulomb(self.dry))} if self.rubs else {}

    def potential_energy(self, q):
        return -self.gravity * jnp.cos(q.phi)


def pendulum(values: dict[str, Any]) -> Pendulum:
    """The pendulum under values by the names of `TERMS`; those left out are zero."""
    value = {name: values.get(name, 0.0) for name in TERMS}
    return Pendulum(rubs="dry" in values, **value)


def first_state(segment: Segment) -> tuple[float, float]:
    """Angle [rad] and velocity [rad/s] at its begin: a cubic through the first samples of the angle."""
    curve = np.polyfit(np.arange(FIRST) * STEP, segment.phi[:FIRST], 3)
    return float(curve[3]), float(curve[2])


def small_swing(segments: Sequence[Segment]) -> float:
    """Square of the frequency [1/s²] of the segment that swings least, from its zeros: a fit that
    starts a fifth off counts another number of swings and ends in a minimum of its own."""
    phi = min(segments, key=lambda segment: float(np.ptp(segment.phi))).phi
    zeros = np.flatnonzero(np.diff(np.signbit(phi)))
    period = 2.0 * STEP * float(zeros[-1] - zeros[0]) / (zeros.size - 1)
    return (2.0 * np.pi / period) ** 2


def shown(t: Any, y: Any, system: Any) -> Any:
    """What the encoder shows [rad]."""
    return y.phi + system.zero


@dataclasses.dataclass(frozen=True)
class _Swing:
    """The pendulum with these terms: equal for the same, so that what is traced serves every fit."""

    names: tuple[str, ...]

    def __call__(self, p: Any, inputs: Any) -> Pendulum:
        return pendulum({name: p[name] for name in self.names})


@dataclasses.dataclass(frozen=True)
class _Begin:
    """Its state at the begin of a segment."""

    system: _Swing

    def __call__(self, p: Any, inputs: Any) -> Any:
        phi = p["at"] + p["d_phi"] - p["zero"]
        return self.system(p, inputs).state(phi=phi, v_phi=p["speed"] + p["d_v"])


def problem(
    law: str, segments: Sequence[Segment], every: int, *, hidden: float = 0.0,
    known: dict[str, float] | None = None,
) -> Problem:  # fmt: skip
    """Terms of the `law` and the state at the begin of each segment, from every `every`-th angle.

    The last part `hidden` of every segment is not shown to a fit. With `known` terms only the states
    are unknown.
    """
    records = []
    for i, segment in enumerate(segments):
        angle = segment.phi[::every]
        later = np.arange(angle.size) >= (1.0 - hidden) * angle.size
        numbers = dict(zip(("at", "speed"), first_state(segment), strict=True)) | (known or {})
        records.append(
            Record(
                STEP * every * np.arange(angle.size), {"angle": angle}, missing={"angle": later},
                units={"angle": "rad"}, known=numbers, name=str(i + 1),
            )
        )  # fmt: skip
    names = ("gravity", "zero", *LAWS[law])
    begin = {name: TERMS[name][1] for name in names} | {"gravity": small_swing(segments)}
    terms = {} if known else {
        name: Unknown(0.0, unit="rad", scale=SIGMA) if name == "zero"
        else Unknown(begin[name], bounds=(0.0, None), unit=TERMS[name][0])
        for name in names
    }  # fmt: skip
    moved = {
        "d_phi": Unknown(0.0, unit="rad", per_record=True, scale=SIGMA),
        "d_v": Unknown(0.0, unit="rad/s", per_record=True, scale=10 * SIGMA),
    }

    system = _Swing(names)
    return Problem(
        system=system,
        initial_state=_Begin(system),
        unknowns=terms | moved,
        observed={"angle": Observed(shown, SIGMA, "rad")},
        records=records,
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-8, 1e-8)),
    )


def rest_of(task: Problem, fit: Fit, segments: Sequence[Segment], every: int) -> list[np.ndarray]:
    """Errors [rad] on what was hidden, by segment."""
    found = []
    for i, segment in enumerate(segments):
        computed = np.asarray(task.simulate(fit.values, i).observed["angle"])
        hidden = ~task.records[i].present["angle"]
        found.append((computed - segment.phi[::every])[hidden])
    return found


def predicted(values: dict[str, Any], segment: Segment, every: int) -> np.ndarray:
    """Angles [rad] at every `every`-th sample, from the state that the first samples give."""
    system = pendulum(values)
    phi, speed = first_state(segment)
    phi = phi - float(system.zero)
    times = STEP * np.arange(segment.phi.size)[::every]
    run = ss.simulate(
        system, 0.0, float(times[-1]), system.state(phi=phi, v_phi=speed),
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-8, 1e-8)),
        saveat=ss.SaveAt(ts=times, max_events=None),
    )  # fmt: skip
    assert run.outputs is not None
    return np.asarray(run.outputs.y.phi) + float(system.zero)
