"""What dry contacts at rest do under a force, by another method than that of `stickslip.mechanism`.

An active-set method for least squares with bounds (Stark and Parker, 1995): an independent oracle for
the law of all contacts, for the closed forms of `stickslip.contact` and for CoreXY.

| function | for |
|---|---|
| `resolve` | any few velocities and contacts: a search that ends, exact to rounding |
| `dead_zone` | one velocity: Eq. (30) of the paper on the CoreXY mechanism |
| `hold` | the motion while known contacts hold |
| `dead_zone_gauge`, `in_dead_zone` | the share of the dead zone that a load uses |
"""

from tests.oracle._constrained import Held as Held
from tests.oracle._constrained import hold as hold
from tests.oracle._dead_zone import dead_zone as dead_zone
from tests.oracle._dead_zone import dead_zone_gauge as dead_zone_gauge
from tests.oracle._dead_zone import in_dead_zone as in_dead_zone
from tests.oracle._resolve import RESULTS as RESULTS
from tests.oracle._resolve import Resolution as Resolution
from tests.oracle._resolve import resolve as resolve
