"""Fig. 2.9: y and its rate at v = 0.005, over time and frequency."""

from .._thresholds import Beam
from ._figure import history_figure
from ._judge import judge_slow_frequency

EXPERIMENT = history_figure(9, Beam.FAST, "y", judge_slow_frequency)
