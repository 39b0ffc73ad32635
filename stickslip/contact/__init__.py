"""Several dry contacts at rest at once: which hold, which begin to slide, in which sense, how fast.

A body with generalised velocities `v` and dry contacts with sliding velocities `n_c · v` is at rest at
some of them. What it does next follows from Gauss' principle with Coulomb's set of static forces:

    a = argmin 1/2 a' M a - a' F + sum_c R_c |n_c · a| ,    R_c = mu_s N_c

The carriage of a plotter on two rails and two pulleys, pulled along a diagonal:

>>> import jax
>>> import jax.numpy as jnp
>>> from stickslip.contact import resolve, vector_dead_zone
>>> normals = jnp.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
>>> limits = jnp.array([1.0, 2.0, 0.5, 0.5])
>>> mass_matrix = jnp.diag(jnp.array([0.5, 1.5]))
>>> motion = resolve(mass_matrix, jnp.array([3.0, 1.5]), normals, limits)
>>> print(motion.acceleration, motion.contact_state)
[2. 0.] [1 0 1 1]

The first rail and both pulleys begin to slide forward, the second rail holds, with the friction

>>> print(motion.contact_force)
[-1.  -1.5 -0.5 -0.5]

| function | for |
|---|---|
| `resolve` | any few velocities and contacts: a search that ends, exact to rounding |
| `vector_dead_zone` | two velocities, in closed form; several times faster in batches |
| `dead_zone` | one velocity: Eq. (30) of the paper on the CoreXY mechanism |
| `hold` | the motion while known contacts hold: the smooth field between events |
| `dead_zone_gauge` | the share of the dead zone a load uses: the guard that ends sticking |
| `in_dead_zone`, `zonotope_vertices` | the dead zone as a set of forces, and its corners |

All are batched by `jax.vmap` and differentiable almost everywhere:

>>> loads = jnp.array([[1.0, 0.5], [4.0, 5.0], [-9.0, 9.0]])
>>> closed = jax.vmap(vector_dead_zone, in_axes=(None, 0, None, None))
>>> print(closed(mass_matrix, loads, normals, limits).round(3))
[[  0.      0.   ]
 [  4.      2.   ]
 [-14.      4.667]]
"""

from stickslip.contact._constrained import Held as Held
from stickslip.contact._constrained import hold as hold
from stickslip.contact._dead_zone import dead_zone as dead_zone
from stickslip.contact._dead_zone import vector_dead_zone as vector_dead_zone
from stickslip.contact._resolve import RESULTS as RESULTS
from stickslip.contact._resolve import Resolution as Resolution
from stickslip.contact._resolve import resolve as resolve
from stickslip.contact._zonotope import dead_zone_gauge as dead_zone_gauge
from stickslip.contact._zonotope import in_dead_zone as in_dead_zone
from stickslip.contact._zonotope import zonotope_vertices as zonotope_vertices
