"""The axis of the tests: 1 kg in a guide with dry friction, moved by the output of its controller."""

from typing import Any, ClassVar

from stickslip.control import PID, WithController
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact


class Axis(AbstractMechanism):
    static: Any = 1.5
    kinetic: Any = 1.0
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"guide": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": args.output}

    def contacts(self, t, q, v, args):
        return {"guide": Contact(Coulomb(self.static, self.kinetic))}


def under_pid(period=0.01, kp=50.0, ki=50.0, kd=10.0, static=1.5, kinetic=1.0, pid=None, **options):
    """An axis under a PID controller; `pid`: more arguments of that."""
    control = PID(kp, ki, kd, period=period, **(pid or {}))
    return WithController(Axis(static, kinetic), control, period, control.state(), **options)


def begin(loop, x=0.1, v=0.0, t=0.0, args=None):
    return loop.start(Axis().state(x=x, v_x=v), t, args)


class Continuous(AbstractMechanism):
    """The axis under a controller without sampling, whose integral is a state of first order."""

    ki: Any = 50.0
    excess: Any = 0.5
    coordinates: ClassVar = {"x": "m"}
    first_order: ClassVar = {"I": "m s"}
    contact_directions: ClassVar = {"guide": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -50.0 * q.x - self.ki * q.I - 10.0 * v.x}

    def rates(self, t, q, v, args):
        return {"I": q.x}

    def contacts(self, t, q, v, args):
        return {"guide": Contact(Coulomb(1.0 + self.excess, 1.0))}
