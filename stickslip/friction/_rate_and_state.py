"""Rate-and-state friction, of rock and other contacts that age."""

import math
from typing import ClassVar, Literal, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from stickslip import _fastmath as fast
from stickslip._argument_checks import check_arguments, choice, parameters, reals
from stickslip.friction._coulomb import Coulomb
from stickslip.friction.law import (
    AbstractFrictionLaw,
    GivenState,
    Number,
    State,
    deformation,
    in_dtype_of,
)

Evolution = Literal["ageing", "slip"]


class RateAndState(AbstractFrictionLaw):
    r"""Friction that depends on the speed and on the age of the contacts, in its regularised form.

    $$\mu = a\,\mathrm{arsinh}\left[\frac{v}{2 v_0}
      \exp\frac{\mu_0 + b\ln(v_0\theta/d_c)}{a}\right]$$

    | evolution | age $\theta$ [s] of the contacts |
    |---|---|
    | `"ageing"` (Dieterich) | $\dot\theta = 1 - w\theta/d_c$ |
    | `"slip"` (Ruina) | $\dot\theta = -(w\theta/d_c)\ln(w\theta/d_c)$ |

    with $w = |v| + v_\mathrm{rest}$. The one internal state is $z = d_c\ln(v_0\theta/d_c)$ [m], so
    that the age stays positive and spans any number of decades; $z = 0$ is steady sliding at $v_0$.

    - In motion, far above $v_0 e^{-\mu_0/a}$, which is 1e-35 m/s for rock:
      $|\mu| = \mu_0 + a\ln(|v|/v_0) + b\ln(v_0\theta/d_c)$, the form of Dieterich and Ruina.
    - Steady sliding: $|\mu| = \mu_0 + (a - b)\ln(|v|/v_0)$; weakening with speed for $b > a$.
      After a step of the speed the coefficient jumps by $a\ln(v_2/v_1)$, and comes back by
      $b\ln(v_2/v_1)$ over a slip of a few $d_c$.
    - At rest: 0, with a slope without equal. A loaded contact creeps, it never sticks. Under
      `"ageing"` contacts at rest go on to age, up to $d_c/v_\mathrm{rest}$; under `"slip"` they do not.
    - Limits: $a, b \to 0$ is Coulomb's law with $\mu_0$.
    - Smooth, odd, dissipative in steady sliding.

    On a spring the steady motion of a slider without mass gives way to stick-slip where the stiffness
    per normal force is below $(b - a)/d_c$. Such a slider needs the speed for a given coefficient:
    `velocity`.

    **Arguments:**

    - `mu_0`: coefficient of steady sliding at `v_0` [-], not negative.
    - `a`: direct effect of the speed [-], positive.
    - `b`: effect of the age [-], finite.
    - `d_c`: slip over which contacts are renewed [m], positive.
    - `v_0`: speed of reference [m/s], positive; a choice, not a property of the contact.
    - `evolution`: `"ageing"` or `"slip"`.
    - `v_rest`: contacts become no older than `d_c/v_rest` [m/s], positive. It bounds the coefficient
      of steady sliding as the speed vanishes, and matters for nothing else.

    ??? cite "Reference"

        J. H. Dieterich, *Modeling of rock friction*, Journal of Geophysical Research 84, 1979;
        A. Ruina, *Slip instability and state variable friction laws*, Journal of Geophysical Research
        88, 1983; regularised: J. R. Rice, N. Lapusta and K. Ranjith, *Rate and state dependent
        friction and the stability of sliding between elastically deformable solids*, Journal of the
        Mechanics and Physics of Solids 49, 2001.
    """

    mu_0: Float[Array, "..."]
    a: Float[Array, "..."]
    b: Float[Array, "..."]
    d_c: Float[Array, "..."]
    v_0: Float[Array, "..."]
    v_rest: Float[Array, "..."]
    evolution: Evolution = eqx.field(static=True)

    parameter_units: ClassVar = {
        "mu_0": "1", "a": "1", "b": "1", "d_c": "m", "v_0": "m/s", "v_rest": "m/s",
    }  # fmt: skip

    set_valued: ClassVar[bool] = False
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True
    num_states: ClassVar[int] = 1

    @check_arguments(evolution=choice(get_args(Evolution)))
    @parameters(
        mu_0="not negative", a="positive", b="finite", d_c="positive", v_0="positive",
        v_rest="positive",
    )  # fmt: skip
    def __init__(
        self,
        mu_0: Number,
        a: Number,
        b: Number,
        d_c: Number,
        v_0: Number,
        evolution: Evolution = "ageing",
        v_rest: Number = 1e-20,
    ):
        self.evolution = evolution

    def _strength(self, v: Number, age: Number) -> tuple[Float[Array, "..."], ...]:
        """`v`, the exponent of the direct effect for the logarithm of an age, and $a$, $v_0$."""
        v, age, mu_0, a, b, v_0 = in_dtype_of(v, age, self.mu_0, self.a, self.b, self.v_0)
        return v, (mu_0 + b * age) / a, a, v_0

    @jax.named_scope(fast.SMOOTH)
    def _coefficient(self, v: Number, age: Number) -> Float[Array, "..."]:
        v, exponent, a, v_0 = self._strength(v, age)
        u, exponent = jnp.broadcast_arrays(v / (2.0 * v_0), exponent)
        side = fast.side_of(u)
        size = side * u
        # The argument of arsinh overflows for hard contacts, and its square for most: above 1 its
        # logarithm is taken instead, and below it is small.
        away = size > 0.0
        logarithm = exponent + lax.log(lax.select(away, size, lax.full_like(size, 1.0)))
        large = away & (logarithm > 0.0)
        none = lax.full_like(size, 0.0)
        y = lax.select(large, logarithm, none)
        above = y + lax.log(1.0 + lax.sqrt(1.0 + lax.exp(-2.0 * y)))
        most = lax.full_like(exponent, 0.9 * math.log(jnp.finfo(u.dtype).max))
        below = lax.asinh(lax.select(large, none, u) * lax.exp(lax.min(exponent, most)))
        return a * lax.select(large, side * above, below)

    def _steady_age(self, v: Number) -> Float[Array, "..."]:
        """$\\ln(v_0\\theta/d_c)$ of steady sliding at `v`."""
        v, v_0, v_rest = in_dtype_of(v, self.v_0, self.v_rest)
        return lax.log(v_0 / (fast.side_of(v) * v + v_rest))

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        return self._coefficient(v, self._steady_age(v))

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return self.mu_0

    def drag(self, v: Number) -> Float[Array, "..."]:
        (v,) = in_dtype_of(v)
        return lax.full_like(v, 0.0)

    def set_valued_limit(self) -> Coulomb:
        return Coulomb(self.mu_0)

    def steady_state(self, v: Number) -> State:
        v, d_c = in_dtype_of(v, self.d_c)
        return (d_c * self._steady_age(v),)

    def state_rate(self, v: Number, state: GivenState) -> State:
        v, z, d_c, v_0, v_rest = in_dtype_of(v, *state, self.d_c, self.v_0, self.v_rest)
        w = fast.side_of(v) * v + v_rest
        if self.evolution == "slip":
            return (-w * (z / d_c + lax.log(w / v_0)),)
        return (v_0 * lax.exp(-z / d_c) - w,)

    def coefficient_from_state(self, v: Number, state: GivenState) -> Float[Array, "..."]:
        v, z, d_c = in_dtype_of(v, *state, self.d_c)
        return self._coefficient(v, z / d_c)

    @check_arguments(coefficient=reals, state=deformation)
    def velocity(self, coefficient: Number, state: GivenState) -> Float[Array, "..."]:
        """Speed [m/s] at which the signed coefficient is `coefficient`, for an internal state."""
        mu, z, d_c = in_dtype_of(coefficient, *state, self.d_c)
        mu, exponent, a, v_0 = self._strength(mu, z / d_c)
        u = mu / a
        # Both exponentials of the sine hyperbolic by themselves: the factor of either may overflow.
        return v_0 * (lax.exp(u - exponent) - lax.exp(-u - exponent))
