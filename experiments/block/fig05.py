"""Fig. 5: bifurcation diagram of the simplified model, k3 from 82.0 to 88.0 N/m."""

from ._figure import SIMPLIFIED, diagram_figure

EXPERIMENT = diagram_figure(5, SIMPLIFIED, 82.0, 88.0)
