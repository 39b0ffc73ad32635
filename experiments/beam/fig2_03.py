"""Fig. 2.3: bifurcation diagrams of x, y and w(z_A) over the belt speed."""

from ._diagram import PARAMETERS, QUICK, diagrams
from ._draw import draw_diagrams
from ._figure import figure
from ._judge import judge_diagrams

TITLE = "Bifurcation diagrams of x, y and w(z_A) over the belt speed, v from 1e-4 to 3e-2"
EXPERIMENT = figure(3, TITLE, PARAMETERS, QUICK, diagrams, draw_diagrams, judge_diagrams)
