"""Fig. 2.10: w(z_A) and its rate at v = 0.005, over time and frequency."""

from .._thresholds import Beam
from ._figure import history_figure

EXPERIMENT = history_figure(10, Beam.FAST, "w")
