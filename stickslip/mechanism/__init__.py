"""Declare a mechanism by its masses, forces and contacts; the hybrid system follows.

A user states what an engineer writes down first: coordinates, inertia, forces, and for each dry
contact its direction, the speed of the counter surface, the normal force and the friction law;
`AbstractMechanism` says how. The one declaration has three forms:

| form | system | for |
|---|---|---|
| itself | event-driven, set-valued laws | exact sticking, events, derivatives through them |
| `mechanism.regularised(v_reg)` | smooth, `Regularised` laws | a look at what smoothing costs |
| `mechanism.bristles(LuGre, sigma_0=...)` | smooth, bristles with states | presliding displacement |
"""

from .._validation import DeclarationError as DeclarationError
from ._contact import Contact as Contact
from ._forms import BristleMechanism as BristleMechanism
from ._forms import BristleState as BristleState
from ._forms import RegularisedMechanism as RegularisedMechanism
from ._instant import Instant as Instant
from ._mechanism import AbstractMechanism as AbstractMechanism
from ._stop import Stop as Stop
from .account import AbstractMechanicalSystem as AbstractMechanicalSystem
