"""Dry contacts at rest on a body with two velocities: the dead zone, and the motion beyond it.

A body with generalised velocities `v` and dry contacts with sliding velocities `n_c · v` is at rest.
The next motion follows from Gauss' principle with Coulomb's set of static forces:

    a = argmin 1/2 a' M a - a' F + sum_c R_c |n_c · a| ,    R_c = mu_s N_c

The carriage of a plotter on two rails and two pulleys, pulled along a diagonal: the first rail and both
pulleys begin to slide, the second rail holds.

>>> import jax
>>> import jax.numpy as jnp
>>> from stickslip.contact import vector_dead_zone, zonotope_vertices
>>> normals = jnp.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
>>> limits = jnp.array([1.0, 2.0, 0.5, 0.5])
>>> mass_matrix = jnp.diag(jnp.array([0.5, 1.5]))
>>> print(vector_dead_zone(mass_matrix, jnp.array([3.0, 1.5]), normals, limits) + 0.0)
[2. 0.]

Batched by `jax.vmap`, and differentiable almost everywhere:

>>> loads = jnp.array([[1.0, 0.5], [4.0, 5.0], [-9.0, 9.0]])
>>> closed = jax.vmap(vector_dead_zone, in_axes=(None, 0, None, None))
>>> print(closed(mass_matrix, loads, normals, limits).round(3))
[[  0.      0.   ]
 [  4.      2.   ]
 [-14.      4.667]]

The forces under which nothing moves fill a polygon:

>>> print(zonotope_vertices(normals, limits)[:3])
[[-1. -3.]
 [ 1. -3.]
 [ 2. -2.]]

Any number of velocities and contacts: declare a mechanism (`stickslip.mechanism`).
"""

from ._dead_zone import vector_dead_zone as vector_dead_zone
from ._zonotope import zonotope_vertices as zonotope_vertices
