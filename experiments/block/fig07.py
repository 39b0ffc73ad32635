"""Fig. 7: bifurcation diagram of the simplified model, k3 from 86.0 to 92.0 N/m."""

from ._figure import SIMPLIFIED, diagram_figure

EXPERIMENT = diagram_figure(7, SIMPLIFIED, 86.0, 92.0)
