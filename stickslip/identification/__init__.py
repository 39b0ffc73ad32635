"""Parameters of a system from measurements: least squares through exact events."""

from ._best import best as best
from ._fit import Fit as Fit
from ._gradient import gradient_descent as gradient_descent
from ._least_squares import least_squares as least_squares
from ._many_starts import many_starts as many_starts
from ._many_starts import sensitivities as sensitivities
from ._sensitivity import Sensitivity as Sensitivity
from ._sensitivity import sensitivity as sensitivity
from ._unknown import Normal as Normal
from ._unknown import Unknown as Unknown
