"""CoreXY as printers have it: toothed belts that stretch, in a frame, with their drives."""

from ._axis_shapers import AxisShapers as AxisShapers
from ._belts import Belts as Belts
from ._belts import Frame as Frame
from ._belts import Spans as Spans
from ._contour import contour_errors as contour_errors
from ._dc_motors import DCMotors as DCMotors
from ._gcode import Moves as Moves
from ._gcode import read_gcode as read_gcode
from ._lost_motion import lost_motion as lost_motion
from ._machine import ElasticCoreXY as ElasticCoreXY
from ._microsteps import microsteps as microsteps
from ._printer import Printer as Printer
from ._printer import desktop_printer as desktop_printer
from ._resonances import Resonances as Resonances
from ._resonances import resonances as resonances
from ._stepper import Stepper as Stepper
from ._tooth_jump import ToothJump as ToothJump
from ._tooth_jump import tooth_jump as tooth_jump
from ._trajectory import Trajectory as Trajectory
from ._trajectory import trajectory as trajectory
from ._winding import Winding as Winding
