"""Smooth approximations of any set-valued law."""

import math
from collections.abc import Callable
from typing import ClassVar, Literal, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from stickslip import _fastmath as fast
from stickslip._argument_checks import check_arguments, choice, or_none, parameters
from stickslip.friction.law import (
    AbstractFrictionLaw,
    AbstractMemorylessLaw,
    AbstractSmoothedLaw,
    Number,
    check_law,
    in_dtype_of,
    jump_in,
)

Kind = Literal["tanh", "arctan", "sqrt"]

_HALF_PI, _SQRT_E = math.pi / 2.0, math.exp(0.5)


def _arctan(u: Float[Array, "..."]) -> Float[Array, "..."]:
    return lax.atan(u * _HALF_PI) / _HALF_PI


def _sqrt(u: Float[Array, "..."]) -> Float[Array, "..."]:
    # Beyond, the square would overflow; the sign function is reached long before.
    largest = lax.full_like(u, 0.5 * float(jnp.finfo(u.dtype).max) ** 0.5)
    with jax.named_scope(fast.SMOOTH):
        u = lax.clamp(-largest, u, largest)
    return u * lax.rsqrt(1.0 + u * u)


_SIGN: dict[Kind, Callable[[Float[Array, "..."]], Float[Array, "..."]]] = {
    "tanh": fast.tanh,
    "arctan": _arctan,
    "sqrt": _sqrt,
}


class Regularised(AbstractSmoothedLaw, AbstractMemorylessLaw):
    r"""A set-valued law with its jump at rest replaced by a steep smooth curve.

    $$\mu_\varepsilon(v) = \varphi(v/v_\mathrm{reg})\,|\mu(v)| +
    \left(\mu_s - |\mu(0^\pm)|\right)\sqrt{e}\,\frac{v}{v_\mathrm{brk}}\,
    e^{-\frac12 (v/v_\mathrm{brk})^2}$$

    The first term rounds the jump off, the second keeps the breakaway peak of laws whose static
    coefficient exceeds the kinetic one: its maximum is one, at $v_\mathrm{brk}$. It vanishes for
    laws without such an excess.

    | kind | $\varphi(u)$ | $1 - \varphi(v/v_\mathrm{reg})$ as $v_\mathrm{reg} \to 0$ |
    |---|---|---|
    | `"tanh"` | $\tanh u$ | $2 e^{-2v/v_\mathrm{reg}}$: exponential |
    | `"sqrt"` | $u/\sqrt{1 + u^2}$ | $\frac12 (v_\mathrm{reg}/v)^2$: second order |
    | `"arctan"` | $\frac2\pi\arctan\frac{\pi u}2$ | $4 v_\mathrm{reg}/(\pi^2 v)$: first order |

    All have $\varphi(0) = 0$, $\varphi'(0) = 1$. With `kind="tanh"` and
    $v_\mathrm{brk} = 10\,v_\mathrm{reg}$, the default, a Coulomb law becomes the friction force of
    Simscape, $\sqrt{2e}(F_\mathrm{brk} - F_C)e^{-(v/v_\mathrm{St})^2}v/v_\mathrm{St} +
    F_C\tanh(v/v_\mathrm{Coul})$ with $v_\mathrm{St} = \sqrt2 v_\mathrm{brk}$ and
    $v_\mathrm{Coul} = v_\mathrm{brk}/10$, and its peak equals $\mu_s$ to $4\cdot10^{-9}\mu_k$. The
    slower curves reach the peak less closely, $\varphi(10)$ being 0.995 and 0.959: give them a
    larger $v_\mathrm{brk}$ if the peak matters.

    - At rest: 0, with slope $|\mu(0^\pm)|/v_\mathrm{reg} +
      \sqrt e\,(\mu_s - |\mu(0^\pm)|)/v_\mathrm{brk}$. A loaded contact creeps, it never sticks.
    - Limits: $\mu(0^\pm) = 0$; at $\pm\infty$ those of the wrapped law.
    - Smooth; odd and dissipative if the wrapped law is.

    **Arguments:**

    - `law`: the set-valued law, without internal state; also what `set_valued_limit()` returns.
    - `v_reg`: width of the rounding [m/s], positive.
    - `kind`: shape of the rounding, see the table.
    - `v_brk`: velocity of the breakaway peak [m/s], positive; ten times `v_reg` if left out.

    ??? cite "Reference"

        MathWorks, *Simscape Reference: Translational Friction*.
    """

    law: AbstractFrictionLaw
    v_reg: Float[Array, "..."]
    v_brk: Float[Array, "..."]
    kind: Kind = eqx.field(static=True)

    parameter_units: ClassVar = {"v_reg": "m/s", "v_brk": "m/s"}

    @check_arguments(kind=choice(get_args(Kind)))
    @parameters(v_reg="positive", v_brk=or_none("positive"))
    def __init__(
        self,
        law: AbstractFrictionLaw,
        v_reg: Number,
        kind: Kind = "tanh",
        v_brk: Number | None = None,
    ):
        # Any other has no jump to round off.
        self.law = check_law("law", law, "set-valued")
        self.kind = kind
        if v_brk is None:
            self.v_brk = 10.0 * self.v_reg

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense, v_reg, v_brk = in_dtype_of(v, sense, self.v_reg, self.v_brk)
        _, jump = in_dtype_of(v, jump_in(self.law, sense))
        u = v / v_brk
        peak = _SQRT_E * u * fast.exp(-0.5 * (u * u))
        return _SIGN[self.kind](v / v_reg) * (sense * self.law.kinetic(v, sense)) + jump * peak
