"""Structures with friction dampers: matrices of a model, and sliders without mass behind springs.

`LinearStructure` takes mass, damping and stiffness as a finite-element program gives them, or reduced
by `craig_bampton`; `WithSliders` adds Jenkins and Iwan elements to it, or to a mechanism of your own.
"""

from ._jenkins import Jenkins as Jenkins
from ._jenkins import iwan as iwan
from ._linear_structure import HarmonicForce as HarmonicForce
from ._linear_structure import LinearStructure as LinearStructure
from ._linear_structure import StructureState as StructureState
from ._masing import HysteresisLoop as HysteresisLoop
from ._masing import masing_loop as masing_loop
from ._reduce import Reduction as Reduction
from ._reduce import craig_bampton as craig_bampton
from ._reduce import modal_damping as modal_damping
from ._with_contacts import NodeContact as NodeContact
from ._with_contacts import NodeStop as NodeStop
from ._with_contacts import WithContacts as WithContacts
from ._with_sliders import Slid as Slid
from ._with_sliders import WithSliders as WithSliders
