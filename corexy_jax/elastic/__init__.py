"""CoreXY as printers have it: toothed belts that stretch, in a frame, with their drives."""

from ._axis_shapers import AxisShapers as AxisShapers
from ._belts import Belts as Belts
from ._belts import Frame as Frame
from ._belts import Spans as Spans
from ._contour import contour_errors as contour_errors
from ._gcode import Moves as Moves
from ._gcode import read_gcode as read_gcode
from ._lost_motion import lost_motion as lost_motion
from ._machine import ElasticCoreXY as ElasticCoreXY
from ._resonances import Resonances as Resonances
from ._resonances import resonances as resonances
from ._stepper import Stepper as Stepper
from ._trajectory import Trajectory as Trajectory
from ._trajectory import trajectory as trajectory
