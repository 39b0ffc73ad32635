"""Fig. 2.4: phase spaces at v = 0.0005."""

from .._thresholds import Beam
from ._figure import phase_figure

EXPERIMENT = phase_figure(4, Beam.SLOW)
