"""The hybrid engine: description of mode-switched systems and their exact, batched simulation."""

from ._breaks import Pieced as Pieced
from ._breaks import WithBreaks as WithBreaks
from ._execute import FUSED as FUSED
from ._execute import PORTABLE as PORTABLE
from ._execute import Executor as Executor
from ._execute import current_executor as current_executor
from ._execute import use_executor as use_executor
from ._interpolate import interpolate as interpolate
from ._progress import ProgressMeter as ProgressMeter
from ._saltation import saltation_matrix as saltation_matrix
from ._section import Section as Section
from ._simulate import Integrator as Integrator
from ._simulate import SaveAt as SaveAt
from ._simulate import simulate as simulate
from ._smooth import AbstractSmoothSystem as AbstractSmoothSystem
from ._solution import EventLog as EventLog
from ._solution import Solution as Solution
from ._solution import StateLog as StateLog
from ._solution import same_mode_sequence as same_mode_sequence
from ._status import RESULTS as RESULTS
from ._step_size import AdaptiveStep as AdaptiveStep
from ._step_size import FixedStep as FixedStep
from ._system import AbstractHybridSystem as AbstractHybridSystem
from ._system import switch as switch
from ._wrapper import AbstractSystemWrapper as AbstractSystemWrapper
