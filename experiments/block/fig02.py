"""Fig. 2: bifurcation diagram of the simplified model, k3 from 72.0 to 97.0 N/m."""

from .._thresholds import Block
from ._figure import SIMPLIFIED, diagram_figure

EXPERIMENT = diagram_figure(2, SIMPLIFIED, Block.K3_LOW, Block.K3_HIGH)
