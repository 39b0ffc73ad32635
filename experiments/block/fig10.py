"""Fig. 10: bifurcation diagram of the full model, k3 from 94.0 to 96.0 N/m."""

from ._figure import FULL, diagram_figure

EXPERIMENT = diagram_figure(10, FULL, 94.0, 96.0)
