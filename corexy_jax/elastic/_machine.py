"""CoreXY with belts that stretch, declared as a mechanism."""

from collections.abc import Callable
from typing import Any, ClassVar

from jaxtyping import PyTree

from stickslip.checks import Given, Numeric, as_parameter, check_callable, check_type, with_components
from stickslip.friction import AbstractFrictionLaw, Coulomb
from stickslip.mechanism import AbstractMechanism, Contact

from .._arguments import finite
from .._contacts import DIRECTIONS, contact_loads, line_masses
from .._parameters import CoreXYParameters
from ._belts import Belts, Spans, belt_forces, span_tensions, strain_energy

GROUND = tuple(DIRECTIONS)[:6]  # all contacts but those of the belts on the motor pulleys
Drive = Callable[[Any, tuple, tuple, PyTree], tuple[Any, Any]]


def no_torque(t: Any, angles: Any, speeds: Any, args: Any) -> tuple[float, float]:
    """Motors without current."""
    return 0.0, 0.0


def stretch(q: Any) -> tuple[Any, Any]:
    """Stretch of both belts [m] at coordinates, or its rate [m/s] at velocities."""
    return q.one - (q.x + q.y), q.two - (q.x - q.y)


class ElasticCoreXY(AbstractMechanism):
    r"""CoreXY on toothed belts: the collar follows the motors through springs.

    With the lengths of belt line $\ell_i = r\theta_i$ that the motor pulleys have taken in, in the
    coordinates $x, y, \ell_1, \ell_2$ [m],

    $$\left(m + \frac{8J'}{r^2}\right)\ddot x = F_1 + F_2, \qquad
      \left(M + m + \frac{4J'}{r^2}\right)\ddot y = F_1 - F_2, \qquad
      \frac{J}{r^2}\ddot\ell_i = \frac{\tau_i}{r} - (T_{ia} - T_{ib}),$$

    each with its ground friction; $F_i = T_{ia} - T_{ib}$ and what comes from the lengths of the spans
    (`Belts`). As $EA \to \infty$ both motors roll, the model DMN1 of `CoreXY`, with a difference
    proportional to $1/EA$. A toothed belt does not slip; whether a tooth is jumped is read off the
    tensions, by `tooth_jump`.

    **Arguments**

    - `parameters`: `CoreXYParameters`, of which those of friction between belt and pulley are not used.
    - `belts`: `Belts`.
    - `drive(t, angles, speeds, args)`: the torques of both motors [N m], from their angles [rad] and
      speeds [rad/s]; such as a `Stepper`. By default there are none.
    - `law`: a friction law of the six contacts with the ground, by default the Coulomb friction of the
      parameters; loads are those of `CoreXY`.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    parameters: CoreXYParameters
    belts: Belts
    drive: Any
    law: AbstractFrictionLaw

    coordinates: ClassVar = {"x": "m", "y": "m", "one": "m", "two": "m"}
    contact_directions: ClassVar = {name: DIRECTIONS[name] for name in GROUND}

    def __init__(
        self,
        parameters: Given[CoreXYParameters],
        belts: Given[Belts],
        drive: Given[Drive] = no_torque,
        law: Given[AbstractFrictionLaw | None] = None,
    ):
        p = check_type("parameters", parameters, CoreXYParameters, "CoreXYParameters")
        self.parameters = p
        self.belts = check_type("belts", belts, Belts, "Belts")
        nothing = 0.0, 0.0
        call = "drive(t, angles, speeds, args)"
        self.drive = check_callable("drive", drive, call, 0.0, nothing, nothing, None)
        law = Coulomb(p.mu_s, p.mu_k) if law is None else law
        self.law = check_type("law", law, AbstractFrictionLaw, "a friction law")

    def mass_matrix(self, q):
        return list(line_masses(self.parameters))

    def forces(self, t, q, v, args):
        turn = 1.0 / self.parameters.r
        torques = self.drive(t, (q.one * turn, q.two * turn), (v.one * turn, v.two * turn), args)
        one, two, (along, against) = belt_forces(
            self.belts, self.parameters, q.x, q.y, stretch(q), stretch(v)
        )
        return {
            "x": one + along + two + against, "y": one + along - two - against,
            "one": torques[0] * turn - one, "two": torques[1] * turn - two,
        }  # fmt: skip

    def contacts(self, t, q, v, args):
        loads = contact_loads(self.parameters)
        return {name: Contact(self.law, loads[i]) for i, name in enumerate(GROUND)}

    def potential_energy(self, q):
        return strain_energy(self.belts, self.parameters, q.x, q.y, stretch(q))

    def at(self, x: Numeric = 0.0, y: Numeric = 0.0) -> PyTree:
        """The state at rest at a position [m], with belts that are not stretched."""
        x, y = (as_parameter(a) for a in finite(x=x, y=y))
        return self.state(x=x, y=y, one=x + y, two=x - y)

    def tensions(self, y: PyTree) -> Spans:
        """Tension of each span [N] in a state, 0 where it is slack."""
        q, v = self.to_coordinates(with_components("y", y, tuple(self.units)))
        return span_tensions(self.belts, self.parameters, q.x, q.y, stretch(q), stretch(v))
