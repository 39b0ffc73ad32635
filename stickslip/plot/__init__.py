"""Pictures: motions, phase planes, branches, orbits, multipliers, orbit diagrams, spectra, fits.

Every function draws into the axes `ax`, or makes a figure where none are given, and returns the axes.
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

from ._branch import branch as branch
from ._energy_account import energy_account as energy_account
from ._exponents import exponents as exponents
from ._fit import fit as fit
from ._motion import motion as motion
from ._multipliers import multipliers as multipliers
from ._orbit import orbit as orbit
from ._orbit_diagram import orbit_diagram as orbit_diagram
from ._phase_plane import phase_plane as phase_plane
from ._prediction import prediction as prediction
from ._shade import shade as shade
from ._spectrum import spectrum as spectrum
