"""A printer of one's own: its numbers in a JSON file."""

from collections.abc import Callable
from typing import Any, NamedTuple

import corexy_jax as cx
from corexy_jax import elastic

from ._log import read_numbers

# Beside those of `CoreXYParameters`.
FRAME = ("width", "depth")
BELT = ("EA_1", "EA_2", "retardation")
MOTOR = ("torque", "damping")


class Machine(NamedTuple):
    """What prints: parameters, belts in their frame, and of the steppers torque and damping."""

    parameters: cx.CoreXYParameters
    belts: elastic.Belts
    torque: float
    damping: float

    def motors(self, path: Callable[[Any, Any], Any]) -> elastic.Stepper:
        """Steppers that are commanded along a path."""
        return elastic.Stepper(path, self.torque, self.parameters.r, damping=self.damping)


def read_printer(text: str) -> Machine:
    """A printer in a JSON file: names of `CoreXYParameters`, and `FRAME`, `BELT`, `MOTOR`, to numbers;
    those that it does not name, and without a file all, are of `elastic.desktop_printer`.

    Errors: `ValueError` naming the file or the parameter.
    """
    ready = elastic.desktop_printer()
    values = {k: float(v) for k, v in vars(ready.parameters).items()}
    values |= {k: float(getattr(ready.belts.frame, k)) for k in FRAME}
    values |= {k: float(getattr(ready.belts, k)) for k in BELT}
    values |= {"torque": ready.torque, "damping": 1e-3}
    if text:
        values |= read_numbers(text, values)
    try:
        frame = elastic.Frame(*(values.pop(k) for k in FRAME))
        belts = elastic.Belts(frame, *(values.pop(k) for k in BELT))
        torque, damping = (values.pop(k) for k in MOTOR)
        machine = Machine(cx.CoreXYParameters(**values), belts, torque, damping)
        machine.motors(lambda t, args: ((0.0, 0.0), (0.0, 0.0)))  # says what is wrong with its numbers
    except (ValueError, TypeError) as error:
        raise ValueError(f"--set machine={text}: {error}") from None
    return machine
