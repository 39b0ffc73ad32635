"""Fig. 2.9: y and its rate at v = 0.005, over time and frequency."""

from ._figure import history_figure
from ._judge import judge_slow_frequency

EXPERIMENT = history_figure(9, 0.005, "y", judge_slow_frequency)
