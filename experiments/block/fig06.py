"""Fig. 6: bifurcation diagram of the full model, k3 from 82.0 to 88.0 N/m."""

from ._figure import FULL, diagram_figure

EXPERIMENT = diagram_figure(6, FULL, 82.0, 88.0)
