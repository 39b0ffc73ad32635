"""Fig. 2.6: w(z_A) and its rate at v = 0.0005, over time and frequency."""

from .._thresholds import Beam
from ._figure import history_figure

EXPERIMENT = history_figure(6, Beam.SLOW, "w")
