"""Analyses of any hybrid system: none knows which machine it looks at."""

from ._observable import Maximum as Maximum
from ._observable import Minimum as Minimum
from ._orbit_diagram import orbit_diagram as orbit_diagram
