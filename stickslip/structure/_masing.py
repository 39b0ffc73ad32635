"""Hysteresis of Jenkins and Iwan elements in steady loops, in closed form by Masing's rule."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._argument_checks import check_arguments, checked_by
from .._types import Given, Numeric, Row
from .._validation import as_parameter, check_nonnegative, check_type, refusal
from ._jenkins import Jenkins


class HysteresisLoop(NamedTuple):
    r"""Steady loop of an element between the elongations $-A$ and $A$, `[...]` as the amplitudes.

    - `displacement` [m], `force` [N]: corners of the loop, `[..., corner]`, from $-A$ to $A$ and back;
      between them it is straight. Those of sliders that stick all the time lie in the ends.
    - `dissipation` $D$: loss in a turn [J], the area of the loop.
    - `secant_stiffness` $K = F(A)/A$ [N/m], at the amplitude 0 that of all sliders at rest.
    - `damping_ratio` $\zeta = D/(2\pi K A^2)$ [-], of a spring and a dashpot with the same stiffness
      and loss; 0 where there is no force. The coefficient of the dashpot is
      $c = D/(\pi\omega A^2) = 2\zeta K/\omega$, the loss factor $2\zeta$.
    """

    displacement: Float[Array, "... corner"]
    force: Float[Array, "... corner"]
    dissipation: Float[Array, "..."]
    secant_stiffness: Float[Array, "..."]
    damping_ratio: Float[Array, "..."]


@check_arguments(amplitude=checked_by(check_nonnegative))
def masing_loop(element: Given[Jenkins], amplitude: Numeric | Row) -> HysteresisLoop:
    r"""Steady hysteresis loop of an element, with its loss, its stiffness and its damping.

    With the stiffness $k_i$ of each slider and its limit $d_i = f_{s,i}/k_i$, the first loading is

    $$F(u) = \sum_i k_i \min(u, d_i)$$

    By Masing's rule each branch of the loop between $-A$ and $A$ is that curve at twice the scale:
    $f = 2F\big((x + A)/2\big) - F(A)$ forth, $f = F(A) - 2F\big((A - x)/2\big)$ back. In a turn it
    loses

    $$D = 4\sum_{d_i < A} f_{s,i}\,(A - d_i)$$

    It is the loop of any periodic motion of the elongation from $-A$ to $A$ that turns at its ends
    alone, about the place where all springs bear nothing; elsewhere it is shifted.

    >>> from stickslip.structure import Jenkins, masing_loop
    >>> loop = masing_loop(Jenkins([1.0], stiffness=1.0, bound=0.25), 0.75)
    >>> loop.displacement.tolist(), loop.force.tolist()
    ([-0.75, -0.25, 0.75, 0.25, -0.75], [-0.25, 0.25, 0.25, -0.25, -0.25])
    >>> f"{loop.dissipation:.3f} J, {loop.secant_stiffness:.3f} N/m"
    '0.500 J, 0.333 N/m'

    **Arguments:** `element`, whose bounds are numbers; `amplitude` $A$ of its elongation [m], not
    negative, one number or an array.
    **Returns** a `HysteresisLoop`, for each amplitude. Derivatives by all numbers are exact; where an
    amplitude is a limit $d_i$ that of the loss lies between those of both sides.
    **Raises** `ValueError`, `TypeError` naming the argument.

    ??? cite "Reference"

        G. Masing, *Proc. 2nd Int. Congress Applied Mechanics*, 1926; W. D. Iwan, *J. Appl. Mech.*
        33(4):893, 1966.
    """
    check_type("element", element, Jenkins, "a Jenkins element")
    if element.varies:
        raise refusal("element", element, "one whose bounds are numbers: with others no loop is steady")
    k, f = jnp.ravel(element.stiffness), jnp.ravel(element.bound)
    return HysteresisLoop(*_loops(k, f, as_parameter(amplitude)))


@jax.jit
@functools.partial(jnp.vectorize, excluded={0, 1}, signature="()->(c),(c),(),(),()")
def _loops(k: Any, f: Any, given: Any) -> tuple:
    A = jnp.where(given >= 0.0, given, jnp.nan)  # a traced one may be negative
    limit = f / k
    slips = limit < A
    peak = jnp.sum(jnp.where(slips, f, k * A))
    # First loading up to each limit; sliders are in the order of these.
    up_to = jnp.cumsum(f) + limit * (jnp.sum(k) - jnp.cumsum(k))
    places, forces = jnp.where(slips, limit, A), jnp.where(slips, up_to, peak)
    x = 2.0 * jnp.concatenate([jnp.zeros(1), places, A[None]]) - A
    y = 2.0 * jnp.concatenate([jnp.zeros(1), forces, peak[None]]) - peak
    loss = 4.0 * jnp.sum(f * jnp.maximum(A - limit, 0.0))
    moves, bears = A != 0.0, peak != 0.0
    at_rest = jnp.sum(jnp.where(f > 0.0, k, 0.0))
    size, force = jnp.where(moves, A, 1.0), jnp.where(bears, peak, 1.0)
    return (
        jnp.concatenate([x, -x[1:]]), jnp.concatenate([y, -y[1:]]), loss,
        jnp.where(moves, peak / size, at_rest), loss / size / force / (2.0 * np.pi),
    )  # fmt: skip
