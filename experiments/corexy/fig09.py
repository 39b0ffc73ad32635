"""Fig. 9: scenario 2, dynamic model over time."""

from ._figure import scenario_figure

EXPERIMENT = scenario_figure(9)
