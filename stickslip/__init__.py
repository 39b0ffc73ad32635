"""Mechanical systems with dry friction: event-driven, batched and differentiable.

Importing the package switches JAX to 64-bit floating point, see `stickslip._precision`.
"""

import importlib
import sys
from typing import TYPE_CHECKING


def _is_sought_for_a_command() -> bool:
    """Whether Python only looks for what `python -m stickslip` is to run."""
    given = getattr(sys, "orig_argv", [])
    asked = given[given.index("-m") + 1 :] if "-m" in given else []
    # The first argument is "-m" until that is found, and then its path.
    return getattr(sys, "argv", [])[:1] == ["-m"] and asked[:1] == [__name__]


# That command reads what it prints from the sources, and imports the rest if need be, see `__main__`.
if not _is_sought_for_a_command():
    # Before every other import of the package, so that no constant is made in single precision.
    from . import _precision as _precision

    # isort: split
    from ._compilation_cache import enable_compilation_cache as enable_compilation_cache
    from ._export import export as export
    from ._export import load as load
    from ._fmu import export_fmu as export_fmu
    from ._piecewise import absolute as absolute
    from ._piecewise import backlash as backlash
    from ._piecewise import dead_band as dead_band
    from ._piecewise import positive_part as positive_part
    from ._piecewise import saturate as saturate
    from ._version import __version__ as __version__
    from .hybrid import RESULTS as RESULTS
    from .hybrid import AbstractAdaptiveStep as AbstractAdaptiveStep
    from .hybrid import AbstractHybridSystem as AbstractHybridSystem
    from .hybrid import AbstractSmoothSystem as AbstractSmoothSystem
    from .hybrid import AbstractStepper as AbstractStepper
    from .hybrid import AbstractStepSize as AbstractStepSize
    from .hybrid import AbstractSystemWrapper as AbstractSystemWrapper
    from .hybrid import AdaptiveStep as AdaptiveStep
    from .hybrid import FixedStep as FixedStep
    from .hybrid import Integrator as Integrator
    from .hybrid import ProgressMeter as ProgressMeter
    from .hybrid import SaveAt as SaveAt
    from .hybrid import Section as Section
    from .hybrid import SimulationError as SimulationError
    from .hybrid import Solution as Solution
    from .hybrid import Tableau as Tableau
    from .hybrid import WithBreaks as WithBreaks
    from .hybrid import WithPeriodicBreaks as WithPeriodicBreaks
    from .hybrid import interpolate as interpolate
    from .hybrid import saltation_matrix as saltation_matrix
    from .hybrid import same_mode_sequence as same_mode_sequence
    from .hybrid import simulate as simulate
    from .hybrid import switch as switch
    from .sweep import map_lanes as map_lanes

if TYPE_CHECKING:
    from . import analysis as analysis
    from . import basin as basin
    from . import contact as contact
    from . import continuation as continuation
    from . import control as control
    from . import derived as derived
    from . import estimation as estimation
    from . import friction as friction
    from . import identification as identification
    from . import mechanism as mechanism
    from . import plot as plot
    from . import structure as structure
    from . import systems as systems

# They come when they are used, since some import what takes longer than the rest of the package.
_PACKAGES = (
    "analysis", "basin", "contact", "continuation", "control", "derived", "estimation", "friction",
    "identification", "mechanism", "plot", "structure", "systems",
)  # fmt: skip


def __getattr__(name: str):
    if name not in _PACKAGES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module(f".{name}", __name__)


def __dir__() -> list[str]:
    return sorted({*globals(), *_PACKAGES})
