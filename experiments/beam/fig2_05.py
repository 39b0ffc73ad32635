"""Fig. 2.5: y and its rate at v = 0.0005, over time and frequency."""

from .._thresholds import Beam
from ._figure import history_figure
from ._judge import judge_stick_slip

EXPERIMENT = history_figure(5, Beam.SLOW, "y", judge_stick_slip)
