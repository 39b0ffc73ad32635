"""Parameters of a system from measurements: least squares through exact events."""

from ._best import best as best
from ._descent import GradientDescent as GradientDescent
from ._fit import Fit as Fit
from ._gradient import gradient_descent as gradient_descent
from ._least_squares import least_squares as least_squares
from ._levenberg_marquardt import LevenbergMarquardt as LevenbergMarquardt
from ._losses import AbstractLoss as AbstractLoss
from ._losses import Huber as Huber
from ._losses import SoftL1 as SoftL1
from ._many_starts import many_starts as many_starts
from ._many_starts import sensitivities as sensitivities
from ._methods import AbstractMethod as AbstractMethod
from ._multiple_shooting import MultipleShooting as MultipleShooting
from ._problem import Observed as Observed
from ._problem import Problem as Problem
from ._problem import Simulation as Simulation
from ._record import Record as Record
from ._results import RESULTS as RESULTS
from ._sensitivity import Sensitivity as Sensitivity
from ._sensitivity import sensitivity as sensitivity
from ._signal import Signal as Signal
from ._starts import sobol_starts as sobol_starts
from ._unknown import Normal as Normal
from ._unknown import Unknown as Unknown
