"""Fig. 2.8: phase spaces at v = 0.005."""

from .._thresholds import Beam
from ._figure import phase_figure

EXPERIMENT = phase_figure(8, Beam.FAST)
