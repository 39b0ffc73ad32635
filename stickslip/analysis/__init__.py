"""Analyses of any hybrid system: none knows which machine it analyses."""

from ._attractor import CANNOT_TELL as CANNOT_TELL
from ._attractor import Verdict as Verdict
from ._attractor import period_of as period_of
from ._growth import LyapunovSpectrum as LyapunovSpectrum
from ._history import energy_ledger as energy_ledger
from ._history import time_history as time_history
from ._lyapunov import lyapunov_spectrum as lyapunov_spectrum
from ._lyapunov_diagram import lyapunov_diagram as lyapunov_diagram
from ._lyapunov_map import lyapunov_spectrum_of_map as lyapunov_spectrum_of_map
from ._orbit_diagram import orbit_diagram as orbit_diagram
from ._orbit_lane import STATUS as STATUS
from ._recording import PeriodTest as PeriodTest
from ._recording import Recording as Recording
from ._recording import Samples as Samples
from ._recording import Segments as Segments
from ._spectrum import Peak as Peak
from ._spectrum import Spectrum as Spectrum
from ._spectrum import amplitude_spectrum as amplitude_spectrum
from ._spectrum import spectral_peaks as spectral_peaks
from ._two_trajectories import Separation as Separation
from ._two_trajectories import two_trajectory_exponent as two_trajectory_exponent
from ._volume import divergence as divergence
from ._volume import volume_growth as volume_growth
from .observable import Maximum as Maximum
from .observable import Minimum as Minimum
