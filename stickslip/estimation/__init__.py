"""States from measurements: a Kalman filter and smoother whose covariance goes through events.

`kalman_filter` estimates the state at every stamp, with its likelihood; `smooth` uses the later
measurements too. Both carry covariances by the saltation matrix, which takes away what a stick removes.
"""

from ._gaussian import Gaussian as Gaussian
from ._kalman_filter import Filtered as Filtered
from ._kalman_filter import kalman_filter as kalman_filter
from ._noise import Noise as Noise
from ._smooth import smooth as smooth
from ._state_estimate import StateEstimate as StateEstimate
