"""Fig. 12: scenario 3, dynamic model over time."""

from ._figure import scenario_figure

EXPERIMENT = scenario_figure(12)
