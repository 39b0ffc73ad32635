"""Input shaping: a reference that leaves no, or hardly any, vibration of one frequency."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._argument_checks import number, parameters, reals
from .._types import Given, Numeric
from .._validation import check_between, check_in
from ._pid import as_reference

KINDS = ("ZV", "ZVD", "MZV", "EI", "2HUMP_EI")


def parts_of(kind: str) -> tuple[tuple[float, float], ...]:
    """Parts of a step without damping, each with its time in periods of the vibration."""
    left = 0.05  # of the vibration, by the extra-insensitive shapers
    if kind == "ZV":
        return (0.5, 0.0), (0.5, 0.5)
    if kind == "ZVD":
        return (0.25, 0.0), (0.5, 0.5), (0.25, 1.0)
    if kind == "MZV":
        side = 1.0 - 0.5**0.5
        return (side, 0.0), (1.0 - 2.0 * side, 0.375), (side, 0.75)
    if kind == "EI":
        side = 0.25 * (1.0 + left)
        return (side, 0.0), (0.5 * (1.0 - left), 0.5), (side, 1.0)
    x = (left**2 * ((1.0 - left**2) ** 0.5 + 1.0)) ** (1.0 / 3.0)
    side = (3.0 * x**2 + 2.0 * x + 3.0 * left**2) / (16.0 * x)
    return (side, 0.0), (0.5 - side, 0.5), (0.5 - side, 1.0), (side, 1.5)


class InputShaper(eqx.Module):
    r"""A reference in parts, one after the other, whose vibrations cancel.

    $$\tilde r(t) = \sum_k A_k\, r(t - t_k), \qquad \sum_k A_k = 1$$

    It is a reference itself, later by $\sum_k A_kt_k$ where that moves evenly. Of a linear vibration of
    frequency $\omega$ and damping $\zeta$ it leaves, when the last part has come,
    the part `residual(omega, damping)`:

    | kind | parts, within how many periods | at the frequency | not above 0.05 between |
    |---|---|---|---|
    | `"ZV"` | 2, a half | 0 | 0.968 and 1.032 of it |
    | `"MZV"` | 3, three quarters | 0 | 0.951 and 1.055 |
    | `"ZVD"` | 3, one | 0, its slope too | 0.856 and 1.144 |
    | `"EI"` | 3, one | 0.05 | 0.800 and 1.200 |
    | `"2HUMP_EI"` | 4, one and a half | 0, between two humps | 0.638 and 1.362 |

    With damping each part is multiplied by how much the vibration has decayed until then, which for
    `"EI"` and `"2HUMP_EI"` is an approximation.

    **Arguments:** `reference(t, args) -> (position, velocity)`, numbers or trees of them, or a number;
    `kind` of the table; `omega` $\omega$ [rad/s], positive; `damping` $\zeta$, from 0 to below 1.
    **Raises** `TypeError`, `ValueError` for anything else.

    ??? cite "References"

        N. C. Singer and W. P. Seering, *Preshaping command inputs to reduce system vibration*, ASME
        Journal of Dynamic Systems, Measurement, and Control 112, 1990 (ZV, ZVD). W. E. Singhose, W. P.
        Seering and N. C. Singer, *Input shaping for vibration reduction with specified insensitivity to
        modeling errors*, Japan-USA Symposium on Flexible Automation, 1996 (EI, two humps). MZV is that
        of the firmware Klipper.
    """

    reference: Callable
    omega: Float[Array, "..."]
    damping: Float[Array, "..."]
    kind: str = eqx.field(static=True)

    @parameters(omega="positive", damping=number("not negative"))
    def __init__(
        self, reference: Given[Numeric | Callable], kind: str, omega: Numeric, damping: Numeric = 0.0
    ):
        check_between("damping", damping, 0, 0.999999)
        self.kind = check_in("kind", kind, KINDS)
        self.reference = as_reference(reference)

    @property
    def times(self) -> Float[Array, "*batch part"]:
        """When the parts come [s]."""
        period = 2.0 * jnp.pi / (self.omega * jnp.sqrt(1.0 - self.damping**2))
        return jnp.stack([period * time for _, time in parts_of(self.kind)], axis=-1)

    @property
    def amplitudes(self) -> Float[Array, "*batch part"]:
        """How large they are."""
        decay = jnp.exp(-2.0 * jnp.pi * self.damping / jnp.sqrt(1.0 - self.damping**2))
        parts = jnp.stack([part * decay**time for part, time in parts_of(self.kind)], axis=-1)
        return parts / jnp.sum(parts, axis=-1, keepdims=True)

    @property
    def _parts(self) -> list[tuple[Any, Any]]:
        """Size and time of each part, arrays of shapers by their batch axes."""
        rows = (jnp.moveaxis(a, -1, 0) for a in (self.amplitudes, self.times))
        return list(zip(*rows, strict=True))

    def __call__(self, t: Numeric, args: PyTree) -> tuple[Any, Any]:
        """Position and velocity at time `t` [s]."""
        sizes, times = zip(*self._parts, strict=True)
        parts = [self.reference(t - time, args) for time in times]
        return jax.tree.map(lambda *a: sum(A * x for A, x in zip(sizes, a, strict=True)), *parts)

    def residual(self, omega: Numeric, damping: Numeric = 0.0) -> Float[Array, "..."]:
        r"""Vibration that it leaves, of that behind a step without a shaper, $R_n$ of the last part of

        $$R_n = \left|\sum_{k \le n} A_k e^{-\zeta\omega(t_n - t_k)}
          e^{i\omega\sqrt{1 - \zeta^2}\,(t_n - t_k)}\right|.$$

        **Arguments:** `omega` [rad/s] and `damping` of the machine, numbers or arrays that broadcast.
        **Raises** `TypeError`, `ValueError` for anything else.
        """
        return self._step(omega, damping)[0]

    def peak(self, omega: Numeric, damping: Numeric = 0.0) -> Float[Array, "..."]:
        r"""Bound of the way behind a step, of that to where it ends: 2 without a shaper.

        It is $\max_n(\sum_{k \le n} A_k + R_n/\sqrt{1 - \zeta^2})$ with $R_n$ and the arguments of
        `residual`: without damping $1 + R_n$ of the last part, with damping it may be more.
        """
        return self._step(omega, damping)[1]

    def _step(self, omega: Numeric, damping: Numeric) -> tuple[Any, Any]:
        """The residual and the peak."""
        check_between("damping", damping, 0, 0.999999)
        omega, damping = jnp.broadcast_arrays(
            *(jnp.asarray(reals(self, *a)) for a in (("omega", omega), ("damping", damping)))
        )
        root = jnp.sqrt(1.0 - damping**2)
        real = imaginary = peak = jnp.zeros_like(omega)
        whole = last = 0.0
        for size, time in self._parts:
            decay, turn = jnp.exp(omega * damping * (last - time)), omega * root * (time - last)
            real, imaginary = (
                size + decay * (real * jnp.cos(turn) - imaginary * jnp.sin(turn)),
                decay * (real * jnp.sin(turn) + imaginary * jnp.cos(turn)),
            )
            whole, last = whole + size, time
            peak = jnp.maximum(peak, whole + jnp.hypot(real, imaginary) / root)
        return jnp.hypot(real, imaginary), peak
