"""The CoreXY motion system with dry friction, a machine built on `stickslip`."""

# The engine also switches JAX to 64-bit floating point, which must come before any array is made.
import stickslip as _stickslip  # noqa: F401

# isort: split
from ._contacts import CONTACT_NAMES as CONTACT_NAMES
from ._dead_zone import axis_dead_zones as axis_dead_zones
from ._dead_zone import motor_dead_zone as motor_dead_zone
from ._dead_zone import torque_dead_zone as torque_dead_zone
from ._dead_zone import voltage_dead_zone as voltage_dead_zone
from ._dynamics import DynamicModel as DynamicModel
from ._dynamics import FrictionForces as FrictionForces
from ._dynamics import dmn_1 as dmn_1
from ._dynamics import dmn_2 as dmn_2
from ._dynamics import dmn_3 as dmn_3
from ._dynamics import dmn_4 as dmn_4
from ._dynamics import dynamic_model as dynamic_model
from ._dynamics import rolling_motors as rolling_motors
from ._dynamics import slipping_motor as slipping_motor
from ._errata import Errata as Errata
from ._feedforward import feedforward as feedforward
from ._friction_torques import SlipDirections as SlipDirections
from ._friction_torques import belt_friction as belt_friction
from ._friction_torques import ground_friction as ground_friction
from ._identification import FITTED_PARAMETERS as FITTED_PARAMETERS
from ._identification import MEASUREMENT_NOISE as MEASUREMENT_NOISE
from ._identification import Measurement as Measurement
from ._identification import measurement as measurement
from ._identification import measurement_residuals as measurement_residuals
from ._identification import with_noise as with_noise
from ._identification import with_values as with_values
from ._kinematics import PassivePulleys as PassivePulleys
from ._kinematics import passive_pulleys as passive_pulleys
from ._kinematics import virtual_pulleys as virtual_pulleys
from ._motors import motor_current as motor_current
from ._motors import motor_torque as motor_torque
from ._motors import voltage_for_torque as voltage_for_torque
from ._outputs import outputs as outputs
from ._parameters import CoreXYParameters as CoreXYParameters
from ._plan import Feedforward as Feedforward
from ._rolling_check import RollingCheck as RollingCheck
from ._rolling_check import check_rolling as check_rolling
from ._scenarios import Scenario as Scenario
from ._scenarios import scenario as scenario
from ._simulate import simulate as simulate
from ._simulate import simulate_as_printed as simulate_as_printed
from ._simulate import simulate_consistent as simulate_consistent
from ._smoothed import SmoothedCoreXY as SmoothedCoreXY
from ._smoothed import SmoothedState as SmoothedState
from ._smoothed import simulate_smoothed as simulate_smoothed
from ._solution import Accelerations as Accelerations
from ._solution import CoreXYSolution as CoreXYSolution
from ._solution import Ledger as Ledger
from ._system import CoreXY as CoreXY
from ._system import CoreXYState as CoreXYState
from ._transitions import RollingRequirement as RollingRequirement
from ._transitions import available_coefficients as available_coefficients
from ._transitions import needed_friction as needed_friction
from ._transitions import next_dmn as next_dmn
from ._voltage import AbstractTable as AbstractTable
from ._voltage import AbstractVoltage as AbstractVoltage
from ._voltage import Harmonic as Harmonic
from ._voltage import PiecewiseStep as PiecewiseStep
from ._voltage import Ramps as Ramps
from ._voltage import Sampled as Sampled
from ._voltage import SquareWave as SquareWave
from ._voltage import UserVoltage as UserVoltage
