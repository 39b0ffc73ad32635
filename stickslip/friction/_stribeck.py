"""Stribeck friction: exponential transition from static to kinetic friction."""

from typing import ClassVar

import equinox as eqx
import jax
from jax import lax
from jaxtyping import Array, Float

from stickslip import _fastmath as fast
from stickslip._argument_checks import check_arguments, parameters
from stickslip._validation import as_parameter, check_at_least
from stickslip.friction.law import AbstractDryFrictionLaw, Number, in_dtype_of, shaped_like


class Stribeck(AbstractDryFrictionLaw):
    r"""Friction that falls exponentially from the static to the kinetic coefficient.

    $$\mu(v) = \left[\mu_k + (\mu_s - \mu_k)\,e^{-(|v|/v_s)^\delta}\right]\mathrm{sgn}\,v
    \quad (v \ne 0), \qquad |\mu(0)| \le \mu_s$$

    - At rest: the interval $[-\mu_s, \mu_s]$.
    - Limits: $\mu(0^\pm) = \pm\mu_s$ (no jump between sticking and slipping),
      $\mu(\pm\infty) = \pm\mu_k$. For $\delta < 1$ the slope is infinite at $0^\pm$.
    - Set-valued, odd, dissipative.

    Beyond $v = 0$ the branch of a slip sense is the same formula with $|v|$ replaced by the speed
    in that sense: analytic for integer exponents; for odd ones it is held constant from $v_s$ on.

    **Arguments:**

    - `mu_s`: static coefficient [-], at least `mu_k`.
    - `mu_k`: kinetic coefficient at high speed [-], not negative.
    - `v_s`: Stribeck velocity [m/s], positive.
    - `exponent`: $\delta$ [-], positive; 2 is the Gaussian form, 1 the exponential one, and Bo and
      Pavelescu report 0.5 to 1. A Python number belongs to the structure of the law, and an integer
      then costs no power function, which takes most of the time otherwise. An array is a parameter
      like the others: traced, batched and differentiated.

    ??? cite "Reference"

        R. Stribeck, *Die wesentlichen Eigenschaften der Gleit- und Rollenlager*, Zeitschrift des
        VDI 46, 1902; L. C. Bo and D. Pavelescu, *The friction-speed relation and its influence on
        the critical velocity of stick-slip motion*, Wear 82, 1982; B. Armstrong-Hélouvry, P. Dupont
        and C. Canudas de Wit, *A survey of models, analysis tools and compensation methods for the
        control of machines with friction*, Automatica 30, 1994.
    """

    mu_s: Float[Array, "..."]
    mu_k: Float[Array, "..."]
    v_s: Float[Array, "..."]
    _free_exponent: Float[Array, "..."] | None
    # Read only where the exponent is not an array.
    _fixed_exponent: float = eqx.field(static=True)

    parameter_units: ClassVar = {"mu_s": "1", "mu_k": "1", "v_s": "m/s"}

    set_valued: ClassVar[bool] = True
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    @check_arguments(exponent="positive")
    @parameters(mu_s="not negative", mu_k="not negative", v_s="positive")
    def __init__(self, mu_s: Number, mu_k: Number, v_s: Number, exponent: Number = 2):
        check_at_least("mu_s", mu_s, "mu_k", mu_k)
        fixed = isinstance(exponent, int | float)
        self._fixed_exponent = float(exponent) if fixed else 0.0
        self._free_exponent = None if fixed else as_parameter(exponent)

    @property
    def exponent(self) -> Number:
        """The exponent as it was given: a float of the structure, or an array."""
        return self._fixed_exponent if self._free_exponent is None else self._free_exponent

    def _power(self, u: Float[Array, "..."]) -> Float[Array, "..."]:
        if self._free_exponent is None and self._fixed_exponent.is_integer():
            return lax.integer_pow(u, int(self._fixed_exponent))
        u, exponent = in_dtype_of(u, self.exponent)
        u, exponent = shaped_like(exponent, u), shaped_like(u, exponent)
        return fast.power(u, exponent, lax.rem(exponent, lax.full_like(exponent, 2.0)) != 0)

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense, mu_s, mu_k, v_s = in_dtype_of(v, sense, self.mu_s, self.mu_k, self.v_s)
        decay = self._power(sense * v / v_s)
        with jax.named_scope(fast.SMOOTH):
            decay = lax.max(decay, lax.full_like(decay, -1.0))
        return sense * (mu_k + (mu_s - mu_k) * fast.exp(-decay))

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return self.mu_s

    def set_valued_limit(self) -> "Stribeck":
        return self
