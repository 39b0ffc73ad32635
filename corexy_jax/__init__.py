"""The CoreXY motion system with dry friction, a machine built on `stickslip`."""

# The engine also switches JAX to 64-bit floating point, which must come before any array is made.
import stickslip as _stickslip  # noqa: F401

# isort: split
from ._contacts import CONTACT_NAMES as CONTACT_NAMES
from ._parameters import CoreXYParameters as CoreXYParameters
from ._scenarios import Scenario as Scenario
from ._scenarios import scenario as scenario
from ._system import CoreXY as CoreXY
from ._system import CoreXYState as CoreXYState
from ._voltage import AbstractVoltage as AbstractVoltage
from ._voltage import Harmonic as Harmonic
from ._voltage import PiecewiseStep as PiecewiseStep
from ._voltage import Sampled as Sampled
from ._voltage import SquareWave as SquareWave
from ._voltage import UserVoltage as UserVoltage
