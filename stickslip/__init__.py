"""Mechanical systems with dry friction: event-driven, batched and differentiable.

Importing the package switches JAX to 64-bit floating point, see `stickslip._precision`.
"""

from stickslip._precision import require_float64 as _require_float64
from stickslip._version import __version__ as __version__

# Before every other import of the package, so that no constant is made in single precision.
_require_float64()
