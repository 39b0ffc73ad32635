"""Fig. 2.7: the powers W_f and W_b at v = 0.0005, over time and frequency."""

from .._thresholds import Beam
from ._figure import history_figure
from ._judge import judge_powers

EXPERIMENT = history_figure(7, Beam.SLOW, "powers", judge_powers)
