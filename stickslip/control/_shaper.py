"""Input shaping: a reference that leaves no vibration of one frequency."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._argument_checks import number, parameters
from .._types import Given, Numeric
from .._validation import check_between
from ._pid import as_reference


class ZeroVibration(eqx.Module):
    r"""A reference in two parts, the second half a vibration later (ZV shaper).

    $$\tilde r(t) = \frac{r(t) + K r(t - \pi/\omega_d)}{1 + K}, \qquad
      \omega_d = \omega\sqrt{1 - \zeta^2}, \quad K = e^{-\pi\zeta/\sqrt{1 - \zeta^2}}$$

    It is a reference itself. A linear vibration of frequency `omega` $\omega$ [rad/s], positive, and
    `damping` $\zeta$, from 0 to below 1, has ended when $\tilde r$ has.

    ??? cite "Reference"

        N. C. Singer and W. P. Seering, *Preshaping command inputs to reduce system vibration*, ASME
        Journal of Dynamic Systems, Measurement, and Control 112, 1990.
    """

    reference: Callable
    omega: Float[Array, "..."]
    damping: Float[Array, "..."]

    @parameters(omega="positive", damping=number("not negative"))
    def __init__(self, reference: Given[Numeric | Callable], omega: Numeric, damping: Numeric = 0.0):
        check_between("damping", damping, 0, 0.999999)
        self.reference = as_reference(reference)

    def __call__(self, t: Numeric, args: PyTree) -> tuple[Any, Any]:
        """Position and velocity at time `t` [s]."""
        root = jnp.sqrt(1.0 - self.damping**2)
        part = jnp.exp(-jnp.pi * self.damping / root)
        now, late = self.reference(t, args), self.reference(t - jnp.pi / (self.omega * root), args)
        return tuple((a + part * b) / (1.0 + part) for a, b in zip(now, late, strict=True))
