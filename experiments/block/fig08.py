"""Fig. 8: bifurcation diagram of the full model, k3 from 86.0 to 92.0 N/m."""

from ._figure import FULL, diagram_figure

EXPERIMENT = diagram_figure(8, FULL, 86.0, 92.0)
