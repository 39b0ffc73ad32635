"""Parameters of a system from measurements: least squares through exact events."""

from ._best import best as best
from ._compare import Comparison as Comparison
from ._compare import compare as compare
from ._fit import Fit as Fit
from ._gradient import gradient_descent as gradient_descent
from ._least_squares import least_squares as least_squares
from ._many_starts import many_starts as many_starts
from ._many_starts import sensitivities as sensitivities
from ._profile import Profile as Profile
from ._profile import profile as profile
from ._report import Report as Report
from ._report import report as report
from ._sensitivity import Sensitivity as Sensitivity
from ._sensitivity import sensitivity as sensitivity
from ._unknown import Normal as Normal
from ._unknown import Unknown as Unknown
from ._unseen import unseen as unseen
from ._whiteness import Correlation as Correlation
from ._whiteness import LjungBox as LjungBox
from ._whiteness import autocorrelation as autocorrelation
from ._whiteness import cross_correlation as cross_correlation
from ._whiteness import in_even_steps as in_even_steps
from ._whiteness import ljung_box as ljung_box
