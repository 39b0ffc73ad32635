"""Dry friction: set-valued, smooth and bristle laws behind one interface, with common names.

A law gives the signed coefficient for a relative velocity; the force on the body is minus that,
times the normal force:

>>> from stickslip.friction import Coulomb, LuGre, Regularised, Stribeck
>>> dry = Coulomb(mu_s=0.4, mu_k=0.3)
>>> print(dry.coefficient(-0.2))
-0.3
>>> print(dry.force(-0.2, normal_force=10.0))
3.0

At rest a set-valued law holds any load in an interval; a slip mode names its sense, and its branch
is smooth through zero velocity:

>>> print(*dry.static_interval())
-0.4 0.4
>>> print(dry.kinetic(-1e-9, sense=1))
0.3

The same law smoothed, and as the steady state of bristles:

>>> smooth = Regularised(dry, v_reg=1e-3)
>>> print(f"{smooth.coefficient(1e-2):.6f} {smooth.coefficient(0.2):.6f}")
0.400000 0.300000
>>> smooth.set_valued_limit() is dry
True
>>> bristles = LuGre(dry, sigma_0=1e4, sigma_1=30.0, v_s=1e-2)
>>> (rate,) = bristles.state_rate(0.2, (0.0,))
>>> print(f"{bristles.coefficient(0.2):.6f} {rate:.1f}")
0.300000 0.2

Parameters are differentiable and batched leaves:

>>> import jax
>>> import jax.numpy as jnp
>>> slope = jax.grad(lambda law: law.coefficient(0.01))(Stribeck(0.4, 0.3, v_s=0.01))
>>> print(f"{slope.mu_s:.6f}")
0.367879
>>> print(jax.vmap(lambda mu: Coulomb(mu).force(1.0, 2.0))(jnp.array([0.1, 0.2])))
[-0.2 -0.4]

To write a law, declare three properties and implement three methods; `check_friction_law` verifies
them:

>>> from typing import ClassVar
>>> from stickslip.friction import AbstractDryFrictionLaw, check_friction_law
>>> class Linear(AbstractDryFrictionLaw):
...     slope: float
...     set_valued: ClassVar[bool] = False
...     is_odd: ClassVar[bool] = True
...     is_dissipative: ClassVar[bool] = True
...
...     def kinetic(self, v, sense):
...         return self.slope * jnp.asarray(v)
...
...     def static_coefficient(self, sense=1):
...         return jnp.zeros(())
...
...     def set_valued_limit(self):
...         return self
>>> check_friction_law(Linear(0.5))
>>> check_friction_law(Linear(-0.5))  # doctest: +ELLIPSIS
Traceback (most recent call last):
    ...
ValueError: Linear: the law claims to be dissipative: coefficient and drag must have the sign of v.
"""

from ._asymmetric import Asymmetric as Asymmetric
from ._bristle import AbstractBristleLaw as AbstractBristleLaw
from ._contract import check_friction_law as check_friction_law
from ._coulomb import Coulomb as Coulomb
from ._dahl import Dahl as Dahl
from ._lugre import LuGre as LuGre
from ._rate_and_state import RateAndState as RateAndState
from ._regularised import Regularised as Regularised
from ._smooth_weakening import SmoothHyperbolicWeakening as SmoothHyperbolicWeakening
from ._stribeck import Stribeck as Stribeck
from ._sum import Sum as Sum
from ._viscous import ViscousDamping as ViscousDamping
from ._viscous import ViscousFriction as ViscousFriction
from ._weakening import HyperbolicWeakening as HyperbolicWeakening
from .law import AbstractDryFrictionLaw as AbstractDryFrictionLaw
from .law import AbstractFrictionLaw as AbstractFrictionLaw
from .law import AbstractMemorylessLaw as AbstractMemorylessLaw
