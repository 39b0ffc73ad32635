"""Reference systems with closed forms: small mechanisms that every analysis can be tried on.

>>> import stickslip as ss
>>> from stickslip.systems import CoulombOscillator, Motion
>>> block = CoulombOscillator(
...     mass=1.0, stiffness=1.0, static_force=1.0, kinetic_force=0.5, belt_speed=0.2
... )
>>> solution = ss.simulate(block, 0.0, 50.0, Motion(x=0.0, v=0.2))
>>> print(f"{solution.y1.x:.10f}")
1.0354672845
>>> [block.mode_names[m] for m in solution.events.mode_after[:3]]
['slip backward', 'stick', 'slip backward']
"""

from ._between_stops import OscillatorBetweenStops as OscillatorBetweenStops
from ._block_mechanics import AbstractBlockOnBelt as AbstractBlockOnBelt
from ._block_mechanics import BlockState as BlockState
from ._block_on_belt import BlockOnBelt as BlockOnBelt
from ._block_on_belt import BlockOnBeltSetValued as BlockOnBeltSetValued
from ._bouncing_ball import BouncingBall as BouncingBall
from ._coulomb_oscillator import CoulombOscillator as CoulombOscillator
from ._dc_drive import DCDrive as DCDrive
from ._dc_drive import DriveState as DriveState
from ._drive_voltage import mean_belt_speed as mean_belt_speed
from ._drive_voltage import voltage_for_belt_speed as voltage_for_belt_speed
from ._driven_belt import BlockOnDrivenBelt as BlockOnDrivenBelt
from ._driven_belt import DrivenBlockState as DrivenBlockState
from ._driven_belt_set_valued import BlockOnDrivenBeltSetValued as BlockOnDrivenBeltSetValued
from ._jointed_beam import JointedBeam as JointedBeam
from ._jointed_beam import JointedBeamState as JointedBeamState
from ._jointed_beam_scales import BeamScales as BeamScales
from ._mechanical import AbstractMechanicalSystem as AbstractMechanicalSystem
from ._mechanical import Motion as Motion
from ._sliding_block import SlidingBlock as SlidingBlock
from ._two_blocks import PairMotion as PairMotion
from ._two_blocks import TwoBlocksOnBelt as TwoBlocksOnBelt
