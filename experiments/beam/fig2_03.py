"""Fig. 2.3: bifurcation diagrams of x, y and w(z_A) over the belt speed."""

from .._experiment import Experiment
from ._diagram import PARAMETERS, QUICK, diagrams
from ._draw import draw_diagrams
from ._judge import judge_diagrams

EXPERIMENT = Experiment(
    name="beam-fig2.3",
    title="Bifurcation diagrams of x, y and w(z_A) over the belt speed, v from 1e-4 to 3e-2",
    parameters=PARAMETERS,
    quick=QUICK,
    compute=diagrams,
    draw=draw_diagrams,
    judge=judge_diagrams,
)
