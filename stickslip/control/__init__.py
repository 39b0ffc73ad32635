"""Controllers with a sample time, in the loop of a system with friction.

`WithController` samples a system; `PID`, `Cascade` and the others are ready to be its `update`.
"""

from ._additions import DisturbanceObserver as DisturbanceObserver
from ._additions import Extrapolated as Extrapolated
from ._additions import FirstOrderHold as FirstOrderHold
from ._additions import FrictionFeedforward as FrictionFeedforward
from ._additions import Observed as Observed
from ._cascade import Cascade as Cascade
from ._hunting import HuntingMap as HuntingMap
from ._hunting import hunting_map as hunting_map
from ._pid import PID as PID
from ._pid import Integral as Integral
from ._reading import encoder_reading as encoder_reading
from ._reading import reading_noise as reading_noise
from ._reset import Reset as Reset
from ._reset import ResetPID as ResetPID
from ._shaper import InputShaper as InputShaper
from ._with_controller import Commanded as Commanded
from ._with_controller import Controlled as Controlled
from ._with_controller import Ramp as Ramp
from ._with_controller import WithController as WithController
