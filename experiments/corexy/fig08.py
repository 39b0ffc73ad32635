"""Fig. 8: scenario 2, trajectories, voltages and torques on the belts."""

from ._figure import scenario_figure

EXPERIMENT = scenario_figure(8)
