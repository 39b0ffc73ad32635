"""Fig. 11: scenario 3, trajectories, voltages and torques on the belts."""

from ._figure import scenario_figure

EXPERIMENT = scenario_figure(11)
