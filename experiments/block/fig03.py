"""Fig. 3: bifurcation diagram of the full model, k3 from 72.0 to 97.0 N/m."""

from .._thresholds import Block
from ._figure import FULL, diagram_figure

EXPERIMENT = diagram_figure(3, FULL, Block.K3_LOW, Block.K3_HIGH)
