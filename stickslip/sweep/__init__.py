"""Many lanes at once, on all cores, in pieces that survive an interruption."""

from ._lanes import map_lanes as map_lanes
from ._layout import Variable as Variable
from ._read import open_dataset as open_dataset
from ._run import run_sweep as run_sweep
from ._store import SweepMismatchError as SweepMismatchError
from ._store import SweepWriteError as SweepWriteError
