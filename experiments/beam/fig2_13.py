"""Fig. 2.13: Lyapunov exponents over the belt speed."""

from .._experiment import Experiment
from ._draw import draw_exponents
from ._exponent import PARAMETERS, QUICK, exponents
from ._judge import judge_exponents

EXPERIMENT = Experiment(
    name="beam-fig2.13",
    title="Lyapunov exponents over the belt speed, by tangent dynamics and by Eq. (2.25)",
    parameters=PARAMETERS,
    quick=QUICK,
    compute=exponents,
    draw=draw_exponents,
    judge=judge_exponents,
)
