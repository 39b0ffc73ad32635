r"""A spring slider without mass, pulled at a speed that steps, and a problem for each law of its age.

$$\dot f = \kappa\,(v_\mathrm{load}(t) - v), \qquad v = v(f, z), \qquad \dot z = \dot z(v, z)$$

with the load $f$ per normal force, the stiffness $\kappa$ of the apparatus per normal force, and the
speed that the friction law has under the load. Inertia plays no part: a slip of a micrometre takes
tenths of a second.
"""

from typing import Any, ClassVar, NamedTuple

import numpy as np

import stickslip as ss
from stickslip.friction import RateAndState
from stickslip.identification import Observed, Problem, Record, Signal, Unknown

from ._record import Step

LAWS = ("ageing", "slip")
UNITS = {"stiffness": "1/m", "d_c": "m", "trend": "1/m", "late": "s"}
STARTS = {"a": 0.01, "b": 0.01, "d_c": 1e-5, "stiffness": 5e3}
SIGMA = 8e-4  # of the coefficient: what the residuals show
SPEEDS = (3e-6, 1e-5)  # of the load point before and after the step, as set [m/s]


class Sliding(NamedTuple):
    """Load per normal force `f`, state `z` of the contact, and slip `x` [m]."""

    f: Any
    z: Any
    x: Any


class SpringSlider(ss.AbstractSmoothSystem):
    """A contact on a spring of the `stiffness` per normal force [1/m], pulled at `load` [m/s]."""

    law: RateAndState
    stiffness: Any
    load: Signal
    trend: Any  # of the coefficient over the slip [1/m]

    units: ClassVar = {"f": "1", "z": "m", "x": "m"}

    def vector_field(self, t, y, mode, args):
        v = self.law.velocity(y.f, (y.z,))
        (rate,) = self.law.state_rate(v, (y.z,))
        return Sliding(self.stiffness * (self.load(t) - v), rate, v)

    def time_scale(self, args):
        return 1.0


def slider(law: Any, values: dict[str, Any], load: Signal) -> SpringSlider:
    """The slider under values by name."""
    friction = RateAndState(
        values["mu_0"], values["a"], values["b"], values["d_c"], SPEEDS[0], evolution=law
    )
    late = load.delayed(values["late"])
    return SpringSlider(friction, values["stiffness"], late, values["trend"])


def problem(
    law: str, step: Step, begin: float, *, last: float | None = None,
    speeds: tuple[float, float] = SPEEDS, known: dict[str, float] | None = None,
) -> Problem:  # fmt: skip
    """The law, the apparatus and a linear trend, from the coefficient up to the time `last` [s];
    `begin` of the higher speed [s], which a fit may correct.

    With `known` numbers of the law and of the apparatus only those are unknown that belong to the
    record: the coefficient before the step, the trend, and when the step came.
    """
    end = float(step.time[-1])
    load = Signal([0.0, begin, end], [*speeds, speeds[1]])
    record = Record(
        step.time, {"friction": step.friction}, inputs={"load": load}, known=known or {},
        missing={"friction": step.time > (end if last is None else last)},
    )  # fmt: skip
    starts = STARTS | {"mu_0": float(np.median(step.friction[step.time < begin]))}
    unknowns = {
        name: Unknown(start, bounds=(0.0, None), unit=UNITS.get(name, "1"))
        for name, start in starts.items()
        if name not in (known or {})
    } | {
        "trend": Unknown(0.0, unit=UNITS["trend"], scale=1.0),
        "late": Unknown(0.0, unit=UNITS["late"], scale=0.1),
    }  # fmt: skip
    return Problem(
        system=lambda p, inputs: slider(law, p, inputs["load"]),
        initial_state=lambda p, inputs: Sliding(p["mu_0"], 0.0, 0.0),
        unknowns=unknowns,
        observed={"friction": Observed(lambda t, y, system: y.f + system.trend * y.x, SIGMA, "1")},
        records=record,
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-8, 1e-12)),
    )
