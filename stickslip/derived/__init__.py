"""Systems made of others: around any hybrid system, with the same modes, guards and transitions.

`WithIntegrals` adds integrals along the motion, `WithDeviations` the tangent dynamics with its jumps at
events. A wrapper of your own is an `stickslip.AbstractSystemWrapper`; `stickslip.WithBreaks`, the same
system with times at which its load jumps, belongs to the engine.
"""

from ._with_deviations import Deviating as Deviating
from ._with_deviations import WithDeviations as WithDeviations
from ._with_integrals import Augmented as Augmented
from ._with_integrals import WithIntegrals as WithIntegrals
