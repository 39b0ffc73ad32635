"""Fig. 2.11: the powers W_f and W_b at v = 0.005, over time and frequency."""

from .._thresholds import Beam
from ._figure import history_figure

EXPERIMENT = history_figure(11, Beam.FAST, "powers")
