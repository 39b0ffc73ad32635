"""Fig. 6: scenario 1, dynamic model over time."""

from ._figure import scenario_figure

EXPERIMENT = scenario_figure(6)
