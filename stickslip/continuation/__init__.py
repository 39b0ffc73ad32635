"""Periodic orbits through stick, slip and impact: Newton's method, Floquet multipliers, branches."""

from ._backbone import Backbone as Backbone
from ._backbone import backbone as backbone
from ._branch import Branch as Branch
from ._branch import BranchPoint as BranchPoint
from ._continue import continue_orbit as continue_orbit
from ._continue_equilibrium import continue_equilibrium as continue_equilibrium
from ._continue_point import continue_point as continue_point
from ._equilibrium import Equilibrium as Equilibrium
from ._forced_response import ForcedResponse as ForcedResponse
from ._forced_response import forced_response as forced_response
from ._forcing import Forcing as Forcing
from ._frequency_response import FrequencyResponse as FrequencyResponse
from ._frequency_response import frequency_response as frequency_response
from ._guess import OrbitGuess as OrbitGuess
from ._guess import orbit_guess as orbit_guess
from ._options import Follow as Follow
from ._options import Shooting as Shooting
from ._orbit import PeriodicOrbit as PeriodicOrbit
from ._outcome import ORBITS as ORBITS
from ._periodic_orbit import periodic_orbit as periodic_orbit
from ._saved import load_branch as load_branch
from ._saved import save_branch as save_branch
