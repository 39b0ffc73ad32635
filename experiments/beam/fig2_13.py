"""Fig. 2.13: Lyapunov exponents over the belt speed."""

from ._draw import draw_exponents
from ._exponent import PARAMETERS, QUICK, exponents
from ._figure import figure
from ._judge import judge_exponents

TITLE = "Lyapunov exponents over the belt speed, by tangent dynamics and by Eq. (2.25)"
EXPERIMENT = figure(13, TITLE, PARAMETERS, QUICK, exponents, draw_exponents, judge_exponents)
