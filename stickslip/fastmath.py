"""Elementary functions for vector fields that run inside one compiled loop.

XLA's CPU backend compiles the fused loop over lanes into straight vector code only if its body holds
no call, which those of `jax.numpy` become. For whoever writes a machine of their own; accurate to a few
units in the last place, with exact derivatives.
"""

from ._fastmath import cos as cos
from ._fastmath import exp as exp
from ._fastmath import power as power
from ._fastmath import side_of as side_of
from ._fastmath import sin as sin
from ._fastmath import sin_cos as sin_cos
from ._fastmath import tanh as tanh
from ._fastmath import where as where
