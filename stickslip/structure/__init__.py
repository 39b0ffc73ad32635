"""Structures with friction dampers: matrices of a model, and sliders without mass behind springs."""

from ._jenkins import Jenkins as Jenkins
from ._jenkins import iwan as iwan
from ._linear_structure import HarmonicForce as HarmonicForce
from ._linear_structure import LinearStructure as LinearStructure
from ._linear_structure import StructureState as StructureState
from ._with_sliders import Slid as Slid
from ._with_sliders import WithSliders as WithSliders
