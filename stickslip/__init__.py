"""Mechanical systems with dry friction: event-driven, batched and differentiable.

Importing the package switches JAX to 64-bit floating point, see `stickslip._precision`.
"""

from stickslip._precision import require_float64 as _require_float64
from stickslip._version import __version__ as __version__

# Before every other import of the package, so that no constant is made in single precision.
_require_float64()

from .hybrid import RESULTS as RESULTS  # noqa: E402
from .hybrid import AbstractHybridSystem as AbstractHybridSystem  # noqa: E402
from .hybrid import AdaptiveStep as AdaptiveStep  # noqa: E402
from .hybrid import FixedStep as FixedStep  # noqa: E402
from .hybrid import Integrator as Integrator  # noqa: E402
from .hybrid import ProgressMeter as ProgressMeter  # noqa: E402
from .hybrid import SaveAt as SaveAt  # noqa: E402
from .hybrid import Section as Section  # noqa: E402
from .hybrid import Solution as Solution  # noqa: E402
from .hybrid import interpolate as interpolate  # noqa: E402
from .hybrid import saltation_matrix as saltation_matrix  # noqa: E402
from .hybrid import same_mode_sequence as same_mode_sequence  # noqa: E402
from .hybrid import simulate as simulate  # noqa: E402
from .hybrid import switch as switch  # noqa: E402
from .sweep import map_lanes as map_lanes  # noqa: E402
