"""Analyses of any hybrid system: none knows which machine it looks at."""

from ._growth import LyapunovSpectrum as LyapunovSpectrum
from ._lyapunov import lyapunov_spectrum as lyapunov_spectrum
from ._lyapunov_map import lyapunov_spectrum_of_map as lyapunov_spectrum_of_map
from ._observable import Maximum as Maximum
from ._observable import Minimum as Minimum
from ._orbit_diagram import orbit_diagram as orbit_diagram
from ._tangent import Deviating as Deviating
from ._tangent import WithDeviations as WithDeviations
from ._two_trajectories import Separation as Separation
from ._two_trajectories import two_trajectory_exponent as two_trajectory_exponent
from ._volume import divergence as divergence
from ._volume import volume_growth as volume_growth
