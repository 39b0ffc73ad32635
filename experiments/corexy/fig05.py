"""Fig. 5: scenario 1, trajectories, voltages and torques on the belts."""

from ._figure import scenario_figure

EXPERIMENT = scenario_figure(5)
