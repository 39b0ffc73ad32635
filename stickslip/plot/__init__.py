"""Pictures: motions, animations, phase planes, branches, orbits, orbit diagrams, spectra, fits.

Every function but `animate` draws into the axes `ax`, or makes a figure where none are given, and
returns the axes.
Names and units come from the system or the dataset. Further options go to matplotlib's lines. Nothing
is shown and nothing is saved: that is left to the caller, as is the backend.

>>> import jax.numpy as jnp
>>> import stickslip as ss
>>> from stickslip import plot
>>> from stickslip.systems import CoulombOscillator, Motion
>>> block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
>>> times = ss.SaveAt(ts=jnp.linspace(0.0, 30.0, 601))
>>> run = ss.simulate(block, 0.0, 30.0, Motion(x=0.0, v=0.2), saveat=times)
>>> above, below = plot.motion(run, block)
>>> above.get_ylabel(), below.get_ylabel(), below.get_xlabel()
('x [m]', 'v [m/s]', 't [s]')
"""

from ._animate import animate as animate
from ._basins import basins as basins
from ._basins import shares as shares
from ._block import Belt as Belt
from ._block import Block as Block
from ._block import Wall as Wall
from ._branch import branch as branch
from ._energy_account import energy_account as energy_account
from ._exponents import exponents as exponents
from ._fit import fit as fit
from ._frequency_response import backbone as backbone
from ._frequency_response import frequency_response as frequency_response
from ._hunting import hunting as hunting
from ._motion import motion as motion
from ._movie import SLIP as SLIP
from ._movie import STICK as STICK
from ._movie import Movie as Movie
from ._multipliers import multipliers as multipliers
from ._orbit import orbit as orbit
from ._orbit_diagram import orbit_diagram as orbit_diagram
from ._pendulum import Pendulum as Pendulum
from ._phase_plane import phase_plane as phase_plane
from ._prediction import prediction as prediction
from ._scene import AbstractPart as AbstractPart
from ._shade import shade as shade
from ._spectrum import spectrum as spectrum
from ._spring import Damper as Damper
from ._spring import Spring as Spring
from ._spring import coil as coil
