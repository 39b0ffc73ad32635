"""Fig. 4: scenario 1, motors, and torques and motion along x and y."""

from ._figure import scenario_figure

EXPERIMENT = scenario_figure(4)
