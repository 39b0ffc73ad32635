"""Contact resolution."""

from stickslip.contact._dead_zone import dead_zone as dead_zone
from stickslip.contact._dead_zone import vector_dead_zone as vector_dead_zone
from stickslip.contact._hold import Held as Held
from stickslip.contact._hold import hold as hold
from stickslip.contact._resolve import RESULTS as RESULTS
from stickslip.contact._resolve import Resolution as Resolution
from stickslip.contact._resolve import resolve as resolve
from stickslip.contact._zonotope import dead_zone_gauge as dead_zone_gauge
from stickslip.contact._zonotope import in_dead_zone as in_dead_zone
from stickslip.contact._zonotope import zonotope_vertices as zonotope_vertices
