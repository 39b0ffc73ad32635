"""Which motion follows from which start: attractors and their basins."""

from ._attractor import Attractor as Attractor
from ._basins import Basins as Basins
from ._basins import basins as basins
from ._border import border_motion as border_motion
from ._border_shares import border_shares as border_shares
from ._judge import Judge as Judge
from ._kick import Kick as Kick
from ._kick import smallest_kick as smallest_kick
from ._over_parameter import BasinsOver as BasinsOver
from ._over_parameter import basins_over as basins_over
from ._settle import Settle as Settle
