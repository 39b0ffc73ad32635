"""Controllers with a sample time, in the loop of a system with friction."""

from ._pid import PID as PID
from ._pid import Integral as Integral
from ._with_controller import Commanded as Commanded
from ._with_controller import Controlled as Controlled
from ._with_controller import WithController as WithController
