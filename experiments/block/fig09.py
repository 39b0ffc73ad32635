"""Fig. 9: bifurcation diagram of the simplified model, k3 from 94.0 to 96.0 N/m."""

from ._figure import SIMPLIFIED, diagram_figure

EXPERIMENT = diagram_figure(9, SIMPLIFIED, 94.0, 96.0)
